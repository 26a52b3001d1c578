// A model's joints as a tree for file formats that know only trees: which body hangs on which, in the model's
// order. Not for users.
#pragma once

#include <string>
#include <vector>

#include "handsim/core/error.h"
#include "handsim/model/model.h"

namespace handsim::output {

/// Body of the model -> indices of the joints that hang children on it, loop-closing ones excepted.
std::vector<std::vector<int>> children_of(const model::Model& model);
/// Body of the model -> the joint it hangs on, or -1.
std::vector<int> holder_of(const model::Model& model);
/// `x y z` with all digits.
std::string numbers(const Vec3& v);
/// `w x y z`, as MuJoCo has it.
std::string wxyz(const Quat& q);
/// Text as an XML attribute's value.
std::string attribute(const std::string& text);

}  // namespace handsim::output
