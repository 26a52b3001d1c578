// The spatial slider-crank of the IFToMM benchmark library (Haug 1989) as a Model, and a planar one with
// redundant joints.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "handsim/model/energy.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/model.h"
#include "support/slider_crank_reference.h"

namespace handsim::test {

inline constexpr int kCrank = 1, kRod = 2, kSlider = 3;

/// Gravity of a spec; world z is up.
inline model::Model slider_crank_world(const study::SliderCrankSpec& spec) {
  model::Model model = model::make_model();
  model.gravity = {0, 0, -spec.gravity};
  return model;
}

/// Joint whose frames F and M stand as the world's axes, moved to `anchor`, in the model's zero poses.
inline model::Joint joint_at(const model::Model& model, const char* name, model::JointKind kind, int parent,
                             int child, const Vec3& anchor, const std::vector<Vec3>& axes) {
  model::Joint joint;
  joint.name = name;
  joint.kind = kind;
  joint.parent = parent;
  joint.child = child;
  const Pose world{anchor, Quat::Identity()};
  joint.parent_frame = model.bodies[static_cast<std::size_t>(parent)].zero_pose.inverse() * world;
  joint.child_frame = model.bodies[static_cast<std::size_t>(child)].zero_pose.inverse() * world;
  for (const Vec3& axis : axes) {
    joint.axes.push_back({});
    joint.axes.back().name = "axis" + std::to_string(joint.axes.size() - 1);
    joint.axes.back().axis = axis;
  }
  joint.first_dof = model.dof_count();
  return joint;
}

inline model::Body mechanism_body(const char* name, double mass, const Vec3& inertia, const Pose& pose) {
  model::Body body;
  body.name = name;
  body.mass = mass;
  body.inertia = inertia.asDiagonal();
  body.zero_pose = pose;
  return body;
}

/// The mechanism at its start, moving as it does there. Joint coordinates are zero at the start; the crank's
/// is theta less the spec's angle, up to full turns.
inline model::Model slider_crank(const study::SliderCrankSpec& spec) {
  model::Model model = slider_crank_world(spec);
  const double sine = std::sin(spec.angle), cosine = std::cos(spec.angle);
  const Vec3 axis_point(0, spec.axis_y, spec.axis_z);
  const Vec3 along_crank(0, -sine, cosine);
  const Vec3 pin = axis_point + spec.crank_length * along_crank;
  const study::SliderCrankState start = study::SliderCrankReference(spec).state(0, spec.angle, spec.speed);
  const Vec3 slider(start.x, 0, 0);
  // Rod axes: x along it, y across it and across world x, as the universal joint keeps it.
  const Vec3 along = (pin - slider).normalized();
  const Vec3 across = Vec3::UnitX().cross(along).normalized();
  Mat3 rod;
  rod << along, across, along.cross(across);
  model.bodies.push_back(mechanism_body(
      "crank", spec.crank_mass, {spec.crank_inertia, spec.crank_inertia, 1e-5},
      {axis_point + 0.5 * spec.crank_length * along_crank, rotation_quaternion({spec.angle, 0, 0})}));
  model.bodies.push_back(mechanism_body("rod", spec.rod_mass,
                                        {spec.rod_axial_inertia, spec.rod_inertia, spec.rod_inertia},
                                        {0.5 * (pin + slider), Quat(rod)}));
  model.bodies.push_back(
      mechanism_body("slider", spec.slider_mass, {1e-4, 1e-4, 1e-4}, {slider, Quat::Identity()}));
  const auto add = [&](const model::Joint& joint) { model.joints.push_back(joint); };
  using model::JointKind;
  add(joint_at(model, "crank_hinge", JointKind::hinge, 0, kCrank, axis_point, {Vec3::UnitX()}));
  add(joint_at(model, "pin", JointKind::ball, kCrank, kRod, pin, {}));
  add(joint_at(model, "guide", JointKind::slider, 0, kSlider, slider, {Vec3::UnitX()}));
  add(joint_at(model, "cross", JointKind::universal, kSlider, kRod, slider, {Vec3::UnitX(), across}));
  model.joints.back().closes_loop = true;
  // Velocities: the rod turns across itself with its ends, and along itself as the cross makes it.
  const Vec3 v_pin = spec.speed * Vec3::UnitX().cross(spec.crank_length * along_crank);
  const Vec3 v_slider(start.vx, 0, 0);
  const Vec3 w_across = along.cross(v_pin - v_slider) / spec.rod_length;
  // across stays perpendicular to x: (w x across) . x = 0.
  const Vec3 turned = along.cross(across);
  const double spin = -w_across.cross(across).x() / turned.x();
  model.bodies[kCrank].initial_angular_velocity = Vec3(spec.speed, 0, 0);
  model.bodies[kCrank].initial_velocity = 0.5 * v_pin;
  model.bodies[kRod].initial_angular_velocity = w_across + spin * along;
  model.bodies[kRod].initial_velocity = 0.5 * (v_pin + v_slider);
  model.bodies[kSlider].initial_velocity = v_slider;
  return model;
}

/// Crank, rod and slider in the x-z plane with three hinges and a slider joint: three rows too many. Crank
/// 0.08 m about y at the origin, `angle` [rad] from up towards x, turning at `speed` [rad/s]; rod 0.3 m;
/// slider on the x axis. Crank and rod are in one line at pi/2 and 3 pi/2. All but gravity turned by `tilt`.
inline model::Model planar_slider_crank(const Quat& tilt = Quat::Identity(), double angle = 0,
                                        double speed = 6) {
  study::SliderCrankSpec spec;
  model::Model model = slider_crank_world(spec);
  const double sine = spec.crank_length * std::sin(angle), cosine = spec.crank_length * std::cos(angle);
  const double run = std::sqrt(spec.rod_length * spec.rod_length - cosine * cosine);
  const Vec3 pin = tilt * Vec3(sine, 0, cosine);
  const Vec3 slider = tilt * Vec3(sine + run, 0, 0);
  const Vec3 across = tilt * Vec3::UnitY();
  const auto turned = [&](double about) { return tilt * rotation_quaternion({0, about, 0}); };
  model.bodies.push_back(
      mechanism_body("crank", spec.crank_mass, {1e-4, 1e-4, 1e-5}, {0.5 * pin, turned(angle)}));
  model.bodies.push_back(mechanism_body("rod", spec.rod_mass, {4e-4, 4e-3, 4e-3},
                                        {0.5 * (pin + slider), turned(std::atan2(cosine, run))}));
  model.bodies.push_back(mechanism_body("slider", spec.slider_mass, {1e-4, 1e-4, 1e-4}, {slider, tilt}));
  const auto add = [&](const model::Joint& joint) { model.joints.push_back(joint); };
  using model::JointKind;
  add(joint_at(model, "crank_hinge", JointKind::hinge, 0, kCrank, Vec3::Zero(), {across}));
  add(joint_at(model, "pin", JointKind::hinge, kCrank, kRod, pin, {across}));
  add(joint_at(model, "guide", JointKind::slider, 0, kSlider, slider, {tilt * Vec3::UnitX()}));
  add(joint_at(model, "wrist_pin", JointKind::hinge, kSlider, kRod, slider, {across}));
  model.joints.back().closes_loop = true;
  // The rod's end keeps the slider's height: its turning takes the pin's fall.
  const double rod_speed = -speed * sine / run;
  const Vec3 v_pin = speed * across.cross(pin);
  const Vec3 v_slider = v_pin + rod_speed * across.cross(slider - pin);
  model.bodies[kCrank].initial_angular_velocity = speed * across;
  model.bodies[kCrank].initial_velocity = 0.5 * v_pin;
  model.bodies[kRod].initial_angular_velocity = rod_speed * across;
  model.bodies[kRod].initial_velocity = 0.5 * (v_pin + v_slider);
  model.bodies[kSlider].initial_velocity = v_slider;
  return model;
}

inline double largest_gap(const model::Model& model, const model::State& state) {
  double gap = 0;
  for (const model::Joint& joint : model.joints) gap = std::max(gap, model::joint_gap(joint, state));
  return gap;
}

/// Kinetic and potential energy [J] with gravity.
inline double energy(const model::Model& model, const model::State& state) {
  model::Effects effects;
  effects.add(model::Effect::gravity);
  return model::kinetic_energy(model, state) + model::potential_energy(model, state, effects);
}

}  // namespace handsim::test
