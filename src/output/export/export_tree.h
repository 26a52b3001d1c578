// Functions that all exporters use. Private to this folder.
#pragma once

#include <string>

#include "handsim/core/error.h"
#include "handsim/engine/settings.h"
#include "handsim/model/model.h"

namespace handsim::output {

/// True if the body is the child of a joint that does not close a loop.
bool has_parent(const model::Model& model, std::size_t body);
/// True if the axis has limits that act.
bool has_stop(const model::JointAxis& axis, const engine::Settings& settings);
/// `x y z` with all digits.
std::string numbers(const Vec3& v);
/// `w x y z`, MuJoCo's order.
std::string wxyz(const Quat& q);
/// Text as an XML attribute's value.
std::string attribute(const std::string& text);

}  // namespace handsim::output
