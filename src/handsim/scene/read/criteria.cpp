#include "handsim/scene/read/criteria.h"

#include <algorithm>
#include <cmath>

#include "handsim/core/units.h"
#include "handsim/scene/read/scene_file.h"

namespace handsim::scene {

namespace {

using Limits = std::vector<const char*>;
const Limits kOfTracking = {"rms_error", "largest_error"}, kOfHolds = {"steady_error"},
             kOfMovements = {"overshoot", "settling_time"};

/// Reports a problem for each of these limits that the scene states.
void refuse(MapReader& reader, const Limits& limits, const char* got, const char* need) {
  for (const char* limit : limits)
    if (reader.has(limit)) reader.problem(limit, got, std::string(need) + ", or no such limit");
}

bool has_tasks(const SceneSpec& scene, std::string_view list) {
  return std::ranges::any_of(scene.tasks, [&](const auto& task) { return task->kind->list == list; });
}

/// Largest movement of any driven axis to a pose [rad]; nothing without programs of poses.
std::optional<double> largest_movement(const control::Plan& plan) {
  std::optional<double> largest;
  for (const control::DrivenAxis& axis : plan.axes) {
    const control::Trajectory& trajectory = plan.hands[axis.hand].trajectory;
    std::vector<double> from(trajectory.width()), to(trajectory.width());
    for (const control::Phase& phase : trajectory.phases()) {
      trajectory.at(phase.start - 1e-9, from);
      trajectory.at(phase.arrive + 1e-9, to);
      largest = std::max(largest.value_or(0), std::abs(to[axis.column] - from[axis.column]));
    }
  }
  return largest;
}

}  // namespace

Criteria read_criteria(MapReader reader) {
  Criteria out;
  out.joint_gap = reader.maybe_number("joint_gap", {Dimension::length, 0, 1});
  out.stop_overshoot = reader.maybe_number("stop_overshoot", {Dimension::angle, 0, 10});
  out.stop_rest = reader.maybe_number("stop_rest", {Dimension::angle, 0, 10});
  if (reader.has("lcp_failures")) out.lcp_failures = reader.integer("lcp_failures", 0, 1'000'000'000, 0);
  out.penetration = reader.maybe_number("penetration", {Dimension::length, 0, 1});
  if (reader.has("tunnelling")) out.tunnelling = reader.integer("tunnelling", 0, 1'000'000'000, 0);
  out.grasp_slip = reader.maybe_number("grasp_slip", {Dimension::speed, 0, 10});
  out.climb_load = reader.maybe_number("climb_load", {Dimension::force, 0, 1e5});
  out.tracking.rms_error = reader.maybe_number("rms_error", {Dimension::angle, 0, 10});
  out.tracking.largest_error = reader.maybe_number("largest_error", {Dimension::angle, 0, 10});
  out.tracking.steady_error = reader.maybe_number("steady_error", {Dimension::angle, 0, 10});
  out.tracking.overshoot = reader.maybe_number("overshoot", {Dimension::none, 0, 10});
  out.tracking.settling_time = reader.maybe_number("settling_time", {Dimension::time, 0, 1e5});
  reader.finish();
  return out;
}

void check_criteria(MapReader reader, const SceneSpec& scene) {
  const model::Effects& effects = scene.solver.effects;
  // lcp_failures is measured in every scene.
  if (scene.hands.empty() && scene.mechanism.joints.empty())
    refuse(reader, {"joint_gap"}, "a limit in a scene without joints", "a hand or a joint");
  if (!effects.has(model::Effect::joint_stops))
    refuse(reader, {"stop_overshoot", "stop_rest"}, "a limit without the effect joint_stops",
           "joint_stops among the effects");
  if (!effects.any_contact())
    refuse(reader, {"penetration", "tunnelling"}, "a limit in a scene without contact",
           "object_contact, self_contact or ground_contact among the effects");
  if (!has_tasks(scene, "grasps"))
    refuse(reader, {"grasp_slip"}, "a limit in a scene without grasps", "a grasps block");
  if (!has_tasks(scene, "climbs"))
    refuse(reader, {"climb_load"}, "a limit in a scene without climbs", "a climbs block");
  if (!scene.control)
    for (const Limits& some : {kOfTracking, kOfHolds, kOfMovements})
      refuse(reader, some, "a limit in a scene without control", "a control block");
}

void check_tracked(const YamlNode& root, const control::Plan& plan, Diagnostics& diagnostics) {
  const YamlNode* criteria = root.find("criteria");
  if (!criteria) return;
  MapReader reader(*criteria, "criteria", diagnostics);
  const std::optional<double> movement = largest_movement(plan);
  if (plan.axes.empty()) {
    for (const Limits& some : {kOfTracking, kOfHolds, kOfMovements})
      refuse(reader, some, "a limit in a scene whose controller drives no joint", "gains for some joint");
  } else if (!movement) {
    for (const Limits& some : {kOfHolds, kOfMovements})
      refuse(reader, some, "a limit with a motion file, which holds no pose", "a program of poses");
  } else if (*movement < control::kSmallestMovement) {
    refuse(reader, kOfMovements, "a limit with a program that moves no joint by 5 deg",
           "a program that does");
  }
}

}  // namespace handsim::scene
