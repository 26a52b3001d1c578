#include "handsim/model/newton_euler.h"

#include <cmath>

#include <gtest/gtest.h>

#include "engine/models.h"
#include "handsim/core/error.h"
#include "handsim/model/kinematics.h"
#include "scene_files.h"
#include "support/momentum_torques.h"

namespace handsim::model {
namespace {

// Oracle: the principle of equivalence. Wrists that accelerate evenly need the torques of resting ones whose
// weight is less by the acceleration, from the first moment of the motion to its last.
TEST(NewtonEuler, AMovingWristHasNoJoltAtTheEndsOfItsMotion) {
  const Vec3 acceleration(3, -2, 5);
  Model moving = handsim::test::shipped_scene("bench", {}).model;
  ASSERT_EQ(moving.drives.size(), 2U);
  for (Drive& drive : moving.drives) {
    const Pose start = drive.motion.at(0);
    drive.motion = {{}, Interpolation::linear, {}};
    for (int n = 0; n <= 100; ++n) {
      const double time = 1e-3 * n;
      drive.motion.keys.push_back({time, {start.p + 0.5 * time * time * acceleration, start.q}});
    }
  }
  const std::vector<double> q(as_index(moving.dof_count()), 0.2), rest(q.size(), 0.0);
  const auto torques = [&](const Model& model, const Vec3& gravity, double time) {
    NewtonEuler dynamics(model, gravity);
    dynamics.set_roots(initial_state(model), time);
    dynamics.place(q, rest, rest);
    const std::span<const double> found = dynamics.torques();
    return std::vector<double>(found.begin(), found.end());
  };
  Model resting = moving;
  for (Drive& drive : resting.drives) drive.motion.keys.resize(1);
  const std::vector<double> need = torques(resting, resting.gravity - acceleration, 0);
  for (const double time : {0.0, 1e-3, 0.05, 0.099, 0.1}) {
    const std::vector<double> found = torques(moving, moving.gravity, time);
    for (std::size_t i = 0; i < need.size(); ++i) EXPECT_NEAR(found[i], need[i], 1e-8) << time << ", " << i;
  }
}

// Oracle: the rate of change of momentum of all bodies beyond each joint between two states, computed body by
// body from their velocities; first order in the time between them.
TEST(NewtonEuler, AgreesWithTheChangeOfMomentum) {
  const scene::Scene scene =
      handsim::test::shipped_scene("every_pose", {"criteria={}", "hands.0.wrist.mount=universal"});
  const Model& model = scene.model;
  const auto n = static_cast<std::size_t>(model.dof_count());
  std::vector<double> q(n), u(n), a(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double x = static_cast<double>(i);
    q[i] = 0.3 + 0.2 * std::sin(x), u[i] = 2 * std::cos(2 * x), a[i] = 10 * std::sin(3 * x);
  }
  const auto state_at = [&](double t) {
    std::vector<double> angles(n), rates(n);
    for (std::size_t i = 0; i < n; ++i)
      angles[i] = q[i] + u[i] * t + 0.5 * a[i] * t * t, rates[i] = u[i] + a[i] * t;
    State out = initial_state(model);
    place_joints(model, angles, rates, out);
    out.time = t;
    return out;
  };
  NewtonEuler dynamics(model, model.gravity);
  dynamics.set_roots(state_at(0), 0);
  dynamics.place(q, u, a);
  const std::span<const double> torques = dynamics.torques();
  // A central difference of the momentum removes the first order.
  const std::vector<double> before =
      handsim::test::momentum_torques(model, state_at(-1e-5), state_at(0), model.gravity);
  const std::vector<double> after =
      handsim::test::momentum_torques(model, state_at(0), state_at(1e-5), model.gravity);
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    EXPECT_NEAR(torques[i], 0.5 * (before[i] + after[i]), 2e-6 + 1e-4 * std::abs(torques[i])) << i;
    largest = std::max(largest, std::abs(torques[i]));
  }
  EXPECT_GT(largest, 0.05);
}

constexpr double kMass = 0.3, kLength = 0.4, kMoment = 2e-3, kFar = 0.25, kSpin = 2;

/// A table that spins about z and is the world's frame at 0.5 s, and a bob on it.
Model turntable(JointKind kind, const Vec3& axis, const Vec3& from_bob) {
  Model model = make_model();
  Body table = engine::test::body("table", 1, {1, 1, 1});
  table.kinematic = true;
  engine::test::add_body(model, table);
  engine::test::add_body(model, engine::test::body("bob", kMass, Vec3::Constant(kMoment)));
  engine::test::add_joint(model, "pin", kind, 1, 2, {{0, kFar, 0}, Quat::Identity()},
                          {from_bob, Quat::Identity()}, {axis});
  const auto turned = [](double angle) { return Pose{Vec3::Zero(), rotation_quaternion({0, 0, angle})}; };
  model.drives.push_back(
      {1, {}, {{{0, turned(-0.5 * kSpin)}, {1, turned(0.5 * kSpin)}}, Interpolation::linear, {}}});
  return model;
}

// Oracle: closed form, with the bob's acceleration a = r'' in the turning frame, and spin x spin x r and
// twice spin x r' more: force m (a - g), moment about the pin r x that and the change of the bob's own spin.
// The table's motion is a difference over 2 ms of a quaternion: 1e-10.
TEST(NewtonEuler, APendulumOnATurntableHasTheReactionOfItsClosedForm) {
  const Model model = turntable(JointKind::hinge, Vec3::UnitX(), {0, 0, kLength});
  NewtonEuler dynamics(model, model.gravity);
  State start = initial_state(model);
  for (const double q : {-0.7, 0.4, 2.5}) {
    const double u = 3, change = -5, s = std::sin(q), c = std::cos(q);
    dynamics.set_roots(start, 0.5);
    dynamics.place({&q, 1}, {&u, 1}, {&change, 1});
    const double torque = dynamics.torques()[0];
    const Wrench& reaction = dynamics.reactions()[0];
    const Vec3 arm = kLength * Vec3(0, s, -c), along = kLength * Vec3(0, c, s), spin(0, 0, kSpin);
    const Vec3 place = Vec3(0, kFar, 0) + arm, axis = Vec3::UnitX();
    const Vec3 a = change * along - u * u * arm + spin.cross(spin.cross(place)) + 2 * spin.cross(u * along);
    const Vec3 force = kMass * (a - model.gravity);
    const Vec3 moment = arm.cross(force) + kMoment * (change * axis + spin.cross(u * axis));
    EXPECT_LT((reaction.force - force).norm(), 1e-8);
    EXPECT_LT((reaction.moment - moment).norm(), 1e-9);
    // Of the axis alone: the pendulum's equation with the table's pull outward.
    const double out = kFar + kLength * s;
    EXPECT_NEAR(torque,
                (kMoment + kMass * kLength * kLength) * change +
                    kMass * kLength * (9.80665 * s - kSpin * kSpin * out * c),
                1e-9);
  }
}

// Oracle: closed form: a bead on a spoke needs m (r'' - spin^2 r) along it, and twice m spin r' across.
TEST(NewtonEuler, ABeadOnATurntableHasTheReactionOfItsClosedForm) {
  const Model model = turntable(JointKind::slider, Vec3::UnitY(), Vec3::Zero());
  NewtonEuler dynamics(model, Vec3::Zero());
  const double q = 0.15, u = 0.7, change = -1.2;
  dynamics.set_roots(initial_state(model), 0.5);
  dynamics.place({&q, 1}, {&u, 1}, {&change, 1});
  const double along = kMass * (change - kSpin * kSpin * (kFar + q)), across = -2 * kMass * kSpin * u;
  EXPECT_NEAR(dynamics.torques()[0], along, 1e-8);
  EXPECT_LT((dynamics.reactions()[0].force - Vec3(across, along, 0)).norm(), 1e-8);
}

// Oracle: the exact derivatives of the motion, taken from the driven frame to the body's centre. Differences
// over 2 ms miss 1e-4 of it, as a minimum-jerk curve of 1 s has a fourth derivative of 360.
TEST(NewtonEuler, ADrivenBodyHasTheDerivativesOfItsMotion) {
  Model model = turntable(JointKind::hinge, Vec3::UnitX(), Vec3::Zero());
  Drive& drive = model.drives[0];
  drive.frame = {Vec3(0.1, -0.2, 0.3), rotation_quaternion({0.2, 0.5, -0.4})};
  drive.motion.interpolation = Interpolation::minimum_jerk;
  drive.motion.keys[1].pose = {Vec3(0.4, 0.3, -0.5), rotation_quaternion({1, -0.6, 0.5})};
  NewtonEuler dynamics(model, model.gravity);
  for (const double time : {0.2, 0.5, 0.7}) {
    dynamics.set_roots(initial_state(model), time);
    const BodyMotion& found = dynamics.bodies()[1];
    const PoseRate rate = drive.motion.rate(time, KeySide::after);
    const PoseRate change = drive.motion.acceleration(time, KeySide::after);
    const Vec3 arm = found.p - drive.motion.at(time).p;
    EXPECT_LT((found.pose() * drive.frame.p - drive.motion.at(time).p).norm(), 1e-15);
    EXPECT_LT((found.w - rate.w).norm(), 3e-4);
    EXPECT_LT((found.alpha - change.w).norm(), 3e-4);
    EXPECT_LT((found.v - rate.v - rate.w.cross(arm)).norm(), 3e-4);
    EXPECT_LT((found.a - change.v - change.w.cross(arm) - rate.w.cross(rate.w.cross(arm))).norm(), 3e-4);
  }
}

// Oracle: statics: a load against each body's weight leaves nothing to do at rest, a moment on the last body
// goes through all joints below it, and a moment along a hinge is its torque with the other sign.
TEST(NewtonEuler, LoadsTakeTheirPartOfForcesAndMoments) {
  const Model model = engine::test::five_fingers(false, false);
  std::vector<double> q(as_index(model.dof_count())), rest(q.size(), 0.0);
  for (std::size_t i = 0; i < q.size(); ++i) q[i] = 0.4 * std::sin(1.0 + static_cast<double>(i));
  NewtonEuler dynamics(model, model.gravity);
  dynamics.set_roots(state_at(model, q), 0);
  dynamics.place(q, rest, rest);
  std::vector<Wrench> loads(model.bodies.size());
  for (std::size_t i = 1; i < loads.size(); ++i) loads[i].force = -model.bodies[i].mass * model.gravity;
  for (const double torque : dynamics.torques(loads)) EXPECT_NEAR(torque, 0, 1e-17);
  const Vec3 moment(0.3, -0.2, 0.5);
  loads.back().moment = moment;
  const std::span<const double> torques = dynamics.torques(loads);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const bool below = j + 3 >= model.joints.size();
    const Joint& joint = model.joints[j];
    EXPECT_LT((dynamics.reactions()[j].moment + (below ? moment : Vec3::Zero())).norm(), 1e-15) << j;
    EXPECT_LT(dynamics.reactions()[j].force.norm(), 1e-15) << j;
    if (joint.kind != JointKind::hinge) continue;
    const Vec3 axis = dynamics.bodies()[as_index(joint.child)].q * joint.axes[0].axis;
    EXPECT_NEAR(torques[as_index(joint.first_dof)], below ? -moment.dot(axis) : 0, 1e-15) << j;
  }
}

// Oracle: closed form: a body on an oblique slider needs its mass times the change of speed over the time,
// less its weight along the slider.
TEST(NewtonEuler, TakesAccelerationsFromTwoStates) {
  Model model = make_model();
  engine::test::add_body(model, engine::test::body("b", 0.4, {1e-3, 2e-3, 2.5e-3}));
  const Vec3 axis = Vec3(2, -1, 2) / 3;
  const Pose frame{{0.1, 0.2, 0.3}, rotation_quaternion({0.4, -0.2, 0.9})};
  engine::test::add_joint(model, "rail", JointKind::slider, 0, 1, frame, {{0, 0.1, 0}, frame.q}, {axis});
  const double q = 0.3, before = -0.2, after = 0.5, step = 0.01;
  State from = initial_state(model), to = from;
  place_joints(model, {&q, 1}, {&before, 1}, from);
  place_joints(model, {&q, 1}, {&after, 1}, to);
  from.time = 3;
  to.time = 3 + step;
  NewtonEuler dynamics(model, model.gravity);
  dynamics.place(from, to);
  const double weight = model.gravity.dot(frame.q * axis);
  EXPECT_NEAR(dynamics.torques()[0], 0.4 * ((after - before) / step - weight), 1e-11);
}

TEST(NewtonEuler, RefusesALoopByTheNameOfItsJoint) {
  Model model = engine::test::hinged_body();
  engine::test::add_joint(model, "second", JointKind::hinge, 0, 1, {}, {}, {Vec3::UnitY()}).closes_loop =
      true;
  try {
    const NewtonEuler dynamics(model, model.gravity);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::input);
    EXPECT_NE(std::string(error.what()).find("second"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace handsim::model
