#include "handsim/model/kinematics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "handsim/model/validate.h"

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

TEST(Motion, KeyframesAreMetAndMinimumJerkStartsAndEndsAtRest) {
  PoseMotion motion;
  motion.keys = {{1, {{0, 0, 0}, Quat::Identity()}}, {2, {{1, 0, 0}, rotation_quaternion({0, 0, 1})}}};
  EXPECT_EQ(motion.at(0).p.x(), 0);
  EXPECT_EQ(motion.at(9).p.x(), 1);
  EXPECT_NEAR(motion.at(1.5).p.x(), 0.5, 1e-15);
  EXPECT_NEAR(rotation_vector(motion.at(1.5).q).z(), 0.5, 1e-12);
  EXPECT_LT(motion.at(1.001).p.x(), 1.1e-8);  // 10 s^3
}

TEST(Defects, SoundModelsHaveNone) {
  for (const JointKind kind : {JointKind::hinge, JointKind::universal, JointKind::ball, JointKind::slider})
    EXPECT_TRUE(defects(one_joint(kind)).empty());
}

TEST(Defects, EachIsNamed) {
  const auto defect = [](auto change) {
    Model model = one_joint(JointKind::universal);
    change(model);
    const std::vector<Problem> found = defects(model);
    return found.size() == 1 ? found[0].key : std::to_string(found.size()) + " defects";
  };
  EXPECT_EQ(defect([](Model& m) { m.bodies[1].mass = 0; }), "b.mass");
  EXPECT_EQ(defect([](Model& m) { m.bodies[1].mass = std::nan(""); }), "b.mass");
  EXPECT_EQ(defect([](Model& m) { m.bodies[1].inertia(0, 0) = 5; }), "b.inertia");
  EXPECT_EQ(defect([](Model& m) { m.bodies[1].inertia(0, 0) = -1; }), "b.inertia");
  EXPECT_EQ(defect([](Model& m) { m.bodies[1].zero_pose.q.coeffs() *= 0; }), "b.zero_pose.rotation");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[1].axis = m.joints[0].axes[0].axis; }), "j.axes");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[0].stop = Stop{1, -1, 0}; }), "j.a.stop");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[0].stop = Stop{std::nan(""), 1, 0}; }), "j.a.stop");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes.pop_back(); }), "j.axes");
  EXPECT_EQ(defect([](Model& m) { m.gravity.z() = INFINITY; }), "gravity");
  EXPECT_EQ(defect([](Model& m) { m.contact_rules.push_back({0, 3}); }), "contact_rules");
}

}  // namespace
}  // namespace handsim::model
