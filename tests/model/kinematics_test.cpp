#include "handsim/model/kinematics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "engine/shared_motions.h"

namespace handsim::model {
namespace {

/// World - one joint - body, with arbitrary frames.
Model one_joint(JointKind kind) {
  Model model = make_model();
  Body body;
  body.name = "b";
  body.mass = 1;
  body.inertia = Mat3::Identity();
  model.bodies.push_back(body);
  Joint joint;
  joint.name = "j";
  joint.kind = kind;
  joint.child = 1;
  joint.parent_frame = {{0.3, -0.2, 0.9}, rotation_quaternion({0.4, 0.1, -0.7})};
  joint.child_frame = {{-0.1, 0.05, 0.2}, rotation_quaternion({-0.2, 0.9, 0.3})};
  const Vec3 a = Vec3(1, 2, -1).normalized();
  const Vec3 b = a.cross(Vec3(0.3, -1, 0.2)).normalized();
  if (kind != JointKind::ball) joint.axes.push_back({"a", a, {}, {}, 0});
  if (kind == JointKind::universal) joint.axes.push_back({"b", b, {}, {}, 0});
  model.joints.push_back(joint);
  return model;
}

class EveryJoint : public ::testing::TestWithParam<JointKind> {};
INSTANTIATE_TEST_SUITE_P(, EveryJoint,
                         ::testing::Values(JointKind::hinge, JointKind::universal, JointKind::ball,
                                           JointKind::slider));

TEST_P(EveryJoint, CoordinatesGoToPosesAndBack) {
  const Model model = one_joint(GetParam());
  std::mt19937 random(7);
  std::uniform_real_distribution<double> angle(-1.5, 1.5);
  for (int n = 0; n < 100; ++n) {
    std::vector<double> q(static_cast<std::size_t>(model.dof_count()));
    for (double& value : q) value = angle(random);
    const State state = state_at(model, q);
    const std::vector<double>& back = state.q;
    for (std::size_t i = 0; i < q.size(); ++i) EXPECT_NEAR(back[i], q[i], 1e-13);
    EXPECT_LT(joint_gap(model.joints[0], state), 1e-15);
  }
}

// Oracle: a difference along the motion: after h the frame M is turned by exp(h u) in F.
TEST(BallJoint, RatesAreTheChildsAngularVelocityInTheParentsFrame) {
  const Model model = one_joint(JointKind::ball);
  const Joint& joint = model.joints[0];
  const Vec3 u(0.7, -0.3, 1.1);
  const std::vector<double> q = {0.5, -0.8, 0.3}, rates = {u.x(), u.y(), u.z()};
  State state = initial_state(model);
  place_joints(model, q, rates, state);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(state.u[i], rates[i], 1e-15);
  const double h = 1e-5;
  const auto moved = [&](double t) {
    const Vec3 turned = rotation_vector(rotation_quaternion(t * u) * rotation_quaternion({q[0], q[1], q[2]}));
    return state_at(model, std::vector<double>{turned.x(), turned.y(), turned.z()})
        .bodies[as_index(joint.child)];
  };
  const BodyState ahead = moved(h), behind = moved(-h);
  EXPECT_LT((state.bodies[1].v - (ahead.p - behind.p) / (2 * h)).norm(), 1e-9);
  EXPECT_LT((state.bodies[1].w - rotation_vector(ahead.q * behind.q.conjugate()) / (2 * h)).norm(), 1e-9);
}

// Oracle: definition: the driven frame of a palm is where its motion starts, its pendulum hangs there at the
// angles given, and bodies have the velocities given.
TEST(InitialState, IsThatOfDrivesAxesAndVelocities) {
  Model model = engine::test::carried_pendulum(Interpolation::linear);
  Drive& drive = model.drives[0];
  drive.motion.keys[0].pose = {{0.2, -0.3, 0.1}, rotation_quaternion({1, 0.4, -0.8})};
  model.joints[0].axes[0].initial = 0.4;
  model.joints[0].axes[1].initial = -0.7;
  model.bodies[2].initial_velocity = {1, 2, 3};
  model.bodies[2].initial_angular_velocity = {-4, 5, 6};
  const State state = initial_state(model);
  const Pose driven = state.bodies[1].pose() * drive.frame;
  EXPECT_LT((driven.p - drive.motion.keys[0].pose.p).norm(), 1e-15);
  EXPECT_LT(driven.q.angularDistance(drive.motion.keys[0].pose.q), 1e-15);
  EXPECT_LT(joint_gap(model.joints[0], state), 1e-15);
  EXPECT_NEAR(state.q[0], 0.4, 1e-15);
  EXPECT_NEAR(state.q[1], -0.7, 1e-15);
  EXPECT_EQ(state.bodies[2].v, Vec3(1, 2, 3));
  EXPECT_EQ(state.bodies[2].w, Vec3(-4, 5, 6));
}

// Oracle: definition: a child that is moved by a vector has a gap of its length; on a slider, of what is
// across its axis.
TEST_P(EveryJoint, GapIsTheDistanceThatTheAnchorsAreApart) {
  const Model model = one_joint(GetParam());
  const Joint& joint = model.joints[0];
  State state = state_at(model, std::vector<double>(as_index(model.dof_count()), 0.3));
  const Vec3 moved(0.003, -0.004, 0.012);
  state.bodies[1].p += moved;
  double want = 0.013;
  if (GetParam() == JointKind::slider) want = moved.cross(joint.parent_frame.q * joint.axes[0].axis).norm();
  EXPECT_NEAR(joint_gap(joint, state), want, 1e-15);
}

// Oracle: central differences of the coordinates along the body's motion. (A ball joint's rates are an
// angular velocity and no derivatives.)
class EveryJointWithAxes : public ::testing::TestWithParam<JointKind> {};
INSTANTIATE_TEST_SUITE_P(, EveryJointWithAxes,
                         ::testing::Values(JointKind::hinge, JointKind::universal, JointKind::slider));

TEST_P(EveryJointWithAxes, RatesAreTheDerivativesOfCoordinates) {
  const Model model = one_joint(GetParam());
  const double h = 1e-6;
  std::vector<double> q(static_cast<std::size_t>(model.dof_count()), 0.4);
  std::vector<double> u = {0.7, -0.3};
  u.resize(q.size());
  std::vector<double> before = q, after = q;
  for (std::size_t i = 0; i < q.size(); ++i) {
    before[i] -= h * u[i];
    after[i] += h * u[i];
  }
  State state = state_at(model, q);
  const State a = state_at(model, before);
  const State b = state_at(model, after);
  state.bodies[1].v = (b.bodies[1].p - a.bodies[1].p) / (2 * h);
  state.bodies[1].w = rotation_vector(b.bodies[1].q * a.bodies[1].q.conjugate()) / (2 * h);
  update_coordinates(model, state);
  const std::vector<double>& found = state.u;
  for (std::size_t i = 0; i < u.size(); ++i) EXPECT_NEAR(found[i], u[i], 1e-8);
}

}  // namespace
}  // namespace handsim::model
