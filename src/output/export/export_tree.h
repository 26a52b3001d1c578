// A model's joints as a tree for file formats that know only trees: which body is the
// parent of which, in the model's order. Not for users.
#pragma once

#include <string>
#include <vector>

#include "handsim/core/error.h"
#include "handsim/model/model.h"

namespace handsim::output {

/// Body of the model -> indices of its joints to children; joints that close loops are left out.
std::vector<std::vector<int>> children_of(const model::Model& model);
/// Body of the model -> the joint to its parent, or -1.
std::vector<int> holder_of(const model::Model& model);
/// `x y z` with all digits.
std::string numbers(const Vec3& v);
/// `w x y z`, as MuJoCo has it.
std::string wxyz(const Quat& q);
/// Text as an XML attribute's value.
std::string attribute(const std::string& text);

}  // namespace handsim::output
