// What the exporters share. Not for users.
#pragma once

#include <string>

#include "handsim/core/error.h"
#include "handsim/model/model.h"

namespace handsim::output {

/// Whether a joint that closes no loop ties the body to a parent.
bool has_parent(const model::Model& model, std::size_t body);
/// `x y z` with all digits.
std::string numbers(const Vec3& v);
/// `w x y z`, as MuJoCo has it.
std::string wxyz(const Quat& q);
/// Text as an XML attribute's value.
std::string attribute(const std::string& text);

}  // namespace handsim::output
