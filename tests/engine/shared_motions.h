// Motions that tests of several engines compare: falling shipped hands, a pendulum on a moving palm.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "engine/models.h"
#include "handsim/hand/build.h"
#include "places.h"
#include "support/slider_crank.h"

namespace handsim::engine::test {

/// Adds the shipped hand of a person of 1.755 m.
inline void add_shipped_hand(model::Model& model, const char* name, const hand::Placement& placement) {
  YamlNode node = load_yaml(handsim::test::in_source("handmodels/") + name);
  Diagnostics diagnostics;
  const hand::HandSpec spec = hand::read_hand_spec(node, "", diagnostics);
  diagnostics.throw_if_any();
  hand::Person person;
  person.stature = 1.755;
  person.mass = 84.5;
  person.sex = hand::Sex::male;
  hand::add_hand(model, hand::build_hand(spec, person), placement);
}

/// A shipped hand with gravity perpendicular to it.
inline model::Model shipped_hand(const char* name, hand::Mount mount) {
  model::Model model = model::make_model();
  hand::Placement placement;
  placement.mount = mount;
  placement.pose.q = rotation_quaternion({-0.4, 0.3, 0});
  if (mount == hand::Mount::free) {
    placement.velocity = Vec3(0.3, 0, 0.5);
    placement.angular_velocity = Vec3(3, -2, 4);
  }
  add_shipped_hand(model, name, placement);
  return model;
}

/// Joint coordinates after 0.2 s of gravity, tissue and small torques [N m] on every coordinate.
inline std::vector<double> fallen(const model::Model& model, Method method, double step,
                                  double tolerance = 1e-10, double torque = 1e-3) {
  Settings with = settings({Effect::gravity, Effect::passive_tissue}, step, method);
  test::set_tolerance(with, tolerance);
  const auto engine = make_engine(model, with);
  std::vector<double> torques(static_cast<std::size_t>(model.dof_count()));
  for (std::size_t i = 0; i < torques.size(); ++i) torques[i] = i % 2 == 0 ? 2 * torque : -torque;
  for (long i = 0; i < std::lround(0.2 / step); ++i) engine->step({torques});
  if (method == DaeMethod::stabilised_gear) {
    EXPECT_LT(handsim::test::largest_gap(model, engine->state()), 1e-10);
  }
  return engine->state().q;
}

/// A pendulum under a palm that moves through three keyframes.
inline model::Model carried_pendulum(model::Interpolation interpolation) {
  model::Model model = model::make_model();
  model::Body palm = body("palm", 0.3, {3e-4, 3e-4, 5e-4});
  palm.kinematic = true;
  add_body(model, palm);
  add_body(model, body("bob", 0.1, {1e-4, 2e-4, 1.5e-4}));
  add_joint(model, "pin", model::JointKind::universal, 1, 2, {Vec3(0.02, 0.1, 0), Quat::Identity()},
            {Vec3(0, 0, 0.1), Quat::Identity()}, {Vec3::UnitX(), Vec3::UnitY()});
  model::Drive drive;
  drive.body = 1;
  drive.frame = {Vec3(0, -0.05, 0.01), rotation_quaternion({0.1, 0.2, 0.3})};
  drive.motion.interpolation = interpolation;
  drive.motion.keys = {{0, drive.frame},
                       {0.153, Pose{Vec3(0.1, 0.1, -0.1), rotation_quaternion({0.5, -1, 0.5})}},
                       {0.3, Pose{Vec3(-0.1, 0, 0.1), rotation_quaternion({-0.7, 0.4, 0.1})}}};
  model.drives.push_back(drive);
  return model;
}

/// The bob's position at 0.4 s.
inline Vec3 carried(model::Interpolation interpolation, Method method, double step) {
  const model::Model model = carried_pendulum(interpolation);
  const auto engine = make_engine(model, settings({Effect::gravity, Effect::wrist_motion}, step, method));
  run(*engine, static_cast<int>(std::lround(0.4 / step)));
  const Pose want = model.drives[0].motion.at(0.4) * model.drives[0].frame.inverse();
  EXPECT_LT((engine->state().bodies[1].p - want.p).norm(), 1e-12);
  EXPECT_LT(handsim::test::largest_gap(model, engine->state()),
            method == DaeMethod::stabilised_gear ? 1e-10 : 1e-3);
  return engine->state().bodies[2].p;
}

}  // namespace handsim::engine::test
