#include "handsim/output/export/export_tree.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace handsim::output {

bool has_parent(const model::Model& model, std::size_t body) {
  return std::ranges::any_of(model.joints, [&](const model::Joint& joint) {
    return !joint.closes_loop && as_index(joint.child) == body;
  });
}

const model::Drive* drive_of(const model::Model& model, const engine::Settings& settings, int body) {
  if (!model.bodies[as_index(body)].kinematic || !settings.effects.has(model::Effect::wrist_motion))
    return nullptr;
  const auto found = std::ranges::find(model.drives, body, &model::Drive::body);
  return found == model.drives.end() ? nullptr : &*found;
}

bool has_stop(const model::JointAxis& axis, const engine::Settings& settings) {
  return axis.stop && settings.effects.has(model::Effect::joint_stops) && std::isfinite(axis.stop->low) &&
         std::isfinite(axis.stop->high);
}

std::string numbers(const Vec3& v) { return fmt::format("{:.17g} {:.17g} {:.17g}", v.x(), v.y(), v.z()); }

std::string wxyz(const Quat& q) {
  return fmt::format("{:.17g} {:.17g} {:.17g} {:.17g}", q.w(), q.x(), q.y(), q.z());
}

std::string attribute(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

}  // namespace handsim::output
