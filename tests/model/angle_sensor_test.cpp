#include "handsim/model/angle_sensor.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "engine/models.h"
#include "handsim/model/kinematics.h"

namespace handsim::model {
namespace {

using engine::test::random_pose;
using engine::test::random_vector;

/// A joint of the given kind between random frames, on the world or on a free body.
Model sensed_joint(std::mt19937& random, JointKind kind, bool on_world) {
  Model model = make_model();
  int parent = 0;
  if (!on_world)
    parent = engine::test::add_body(
        model, engine::test::body("parent", 0.4, {3e-4, 4e-4, 5e-4}, random_pose(random)));
  const int child = engine::test::add_body(model, engine::test::body("child", 0.2, {1e-4, 2e-4, 2.5e-4}));
  std::vector<Vec3> axes;
  const Vec3 a = random_vector(random).normalized();
  if (kind != JointKind::ball) axes.push_back(a);
  if (kind == JointKind::universal) axes.push_back(a.unitOrthogonal());
  const Pose on_parent = random_pose(random), on_child = random_pose(random);
  engine::test::add_joint(model, "joint", kind, parent, child, on_parent, on_child, axes);
  return model;
}

// Oracle: two independent ways that must agree; the fast reading against update_coordinates, all round.
TEST(JointSensors, ReadTheModelsCoordinatesAndRates) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> turn(-3.1, 3.1);
  for (const JointKind kind : {JointKind::hinge, JointKind::universal, JointKind::slider, JointKind::ball})
    for (int trial = 0; trial < 300; ++trial) {
      Model model = sensed_joint(random, kind, trial % 2 == 0);
      for (JointAxis& axis : model.joints[0].axes) axis.initial = turn(random);
      State state = initial_state(model);
      state.bodies.back().w = Vec3(turn(random), turn(random), turn(random));
      update_coordinates(model, state);
      State read = state;
      JointSensors(model).read(read);
      for (std::size_t i = 0; i < state.q.size(); ++i) {
        EXPECT_NEAR(read.q[i], state.q[i], 1e-12);
        EXPECT_NEAR(read.u[i], state.u[i], 1e-12);
      }
    }
}

/// Rotation by an angle about the unit axis.
Mat3 turned(double angle, const Vec3& axis) { return Eigen::AngleAxisd(angle, axis).toRotationMatrix(); }

// Oracle: matrices of Eigen: R_WP R_PF Rot(a, q0) Rot(b, q1) R_MC, with a spin of the parent and q0' a + q1'
// b of the child against it; angles all round, for -q as for q. Tolerance: rounding of some products.
TEST(JointSensors, ReadAnglesOfRotationsMadeByEigen) {
  std::mt19937 random(17);
  std::uniform_real_distribution<double> turn(-3.1, 3.1);
  for (const JointKind kind : {JointKind::hinge, JointKind::universal})
    for (int trial = 0; trial < 200; ++trial) {
      const Model model = sensed_joint(random, kind, false);
      const Joint& joint = model.joints[0];
      const bool two = kind == JointKind::universal;
      const double q[] = {turn(random), turn(random)}, u[] = {turn(random), turn(random)};
      State state = initial_state(model);
      BodyState &parent = state.bodies[1], &child = state.bodies[2];
      parent.w = random_vector(random);
      const Mat3 frame = (parent.q * joint.parent_frame.q).toRotationMatrix();
      const Mat3 first = frame * turned(q[0], joint.axes[0].axis);
      const Mat3 both = two ? Mat3(first * turned(q[1], joint.axes[1].axis)) : first;
      const Vec3 a = frame * joint.axes[0].axis, b = two ? Vec3(first * joint.axes[1].axis) : Vec3::Zero();
      child.q = Quat(Mat3(both * joint.child_frame.q.toRotationMatrix().transpose()));
      if (trial % 2 == 0) child.q.coeffs() *= -1;
      child.w = parent.w + u[0] * a + u[1] * b;

      JointSensors sensors(model);
      sensors.read(state);
      for (std::size_t k = 0; k < joint.axes.size(); ++k) {
        EXPECT_NEAR(state.q[k], q[k], 1e-13);
        EXPECT_NEAR(state.u[k], u[k], 1e-13);
        EXPECT_LT((sensors.axes()[k] - (k == 0 ? a : b)).norm(), 1e-14);
        const Direction& direction = sensors.directions()[k];
        EXPECT_NEAR(direction.angle(), q[k], 1e-13);
        EXPECT_NEAR(std::hypot(direction.sin, direction.cos), 1, 1e-13);
      }
    }
}

// Oracle: definition; of a slider the axis alone, at angle 0, and of a ball neither.
TEST(JointSensors, HaveTheAxisOfASliderAndNoneOfABall) {
  std::mt19937 random(18);
  const Model slider = sensed_joint(random, JointKind::slider, false);
  const Joint& joint = slider.joints[0];
  State state = initial_state(slider);
  JointSensors sensors(slider);
  sensors.read(state);
  const Mat3 frame = (state.bodies[1].q * joint.parent_frame.q).toRotationMatrix();
  EXPECT_LT((sensors.axes()[0] - frame * joint.axes[0].axis).norm(), 1e-15);
  EXPECT_EQ(sensors.directions()[0].angle(), 0);
  const Model ball = sensed_joint(random, JointKind::ball, false);
  state = initial_state(ball);
  JointSensors none(ball);
  none.read(state);
  ASSERT_EQ(none.axes().size(), 3U);
  for (const Vec3& axis : none.axes()) EXPECT_EQ(axis, Vec3::Zero());
}

}  // namespace
}  // namespace handsim::model
