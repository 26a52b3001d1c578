// ODE's angles, stops and torques against the model's own joint coordinates.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "engine/models.h"
#include "handsim/engine/ode/ode_engine.h"
#include "handsim/model/kinematics.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::JointKind;
using test::settings;

/// A joint of the given kind between random frames, on the world or on a free body.
model::Model random_joint(std::mt19937& random, JointKind kind, bool on_world) {
  model::Model model = model::make_model();
  int parent = 0;
  if (!on_world)
    parent = test::add_body(model, test::body("parent", 0.4, {3e-4, 4e-4, 5e-4}, test::random_pose(random)));
  const int child = test::add_body(model, test::body("child", 0.2, {1e-4, 2e-4, 2.5e-4}));
  std::vector<Vec3> axes;
  const Vec3 a = test::random_vector(random).normalized();
  if (kind != JointKind::ball) axes.push_back(a);
  if (kind == JointKind::universal) axes.push_back(a.unitOrthogonal());
  test::add_joint(model, "joint", kind, parent, child, test::random_pose(random), test::random_pose(random),
                  axes);
  return model;
}

double ode_coordinate(dJointID id, JointKind kind, std::size_t axis) {
  switch (kind) {
    case JointKind::hinge:
      return dJointGetHingeAngle(id);
    case JointKind::universal:
      return axis == 1 ? dJointGetUniversalAngle1(id) : dJointGetUniversalAngle2(id);
    case JointKind::slider:
      return dJointGetSliderPosition(id);
    case JointKind::ball:
      break;
  }
  return 0;
}

struct JointCase {
  JointKind kind;
  bool on_world;
};

class EveryJoint : public testing::TestWithParam<JointCase> {};

const std::vector<JointCase> kAxial = {{JointKind::hinge, false},     {JointKind::hinge, true},
                                       {JointKind::universal, false}, {JointKind::universal, true},
                                       {JointKind::slider, false},    {JointKind::slider, true}};

// Oracle: two independent ways that must agree; ODE's own angle from its own reference rotation.
TEST_P(EveryJoint, HasTheModelsCoordinatesInOde) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> angle(-1.5, 1.5);
  for (int trial = 0; trial < 50; ++trial) {
    model::Model model = random_joint(random, GetParam().kind, GetParam().on_world);
    for (model::JointAxis& axis : model.joints[0].axes) axis.initial = angle(random);
    ode::OdeEngine engine(model, settings({}));
    const std::vector<double> q = engine.state().q;
    for (std::size_t i = 0; i < model.joints[0].axes.size(); ++i) {
      EXPECT_NEAR(q[i], model.joints[0].axes[i].initial, 1e-12);
      EXPECT_NEAR(ode_coordinate(engine.joints().id(0), GetParam().kind, i), q[i], 1e-12) << "axis " << i;
    }
  }
}

// Oracle: as above, for axes along the frame's own, where ODE's default axes stand parallel to the new
// ones while a universal joint is being set up, and at quarter turns and more.
TEST(Universal, HasTheModelsCoordinatesForAxesAlongTheFrame) {
  const Vec3 units[] = {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()};
  for (const Vec3& a : units)
    for (const Vec3& b : units) {
      if (a == b) continue;
      model::Model model = model::make_model();
      test::add_body(model, test::body("bob", 0.1, {1e-4, 1e-4, 1e-4}));
      test::add_joint(model, "cross", JointKind::universal, 0, 1, {}, {}, {a, b});
      for (const double q0 : {-3.0, -1.6, 0.0, 0.4, 3.0}) {
        model.joints[0].axes[0].initial = q0;
        model.joints[0].axes[1].initial = -0.6;
        ode::OdeEngine engine(model, settings({}));
        EXPECT_NEAR(dJointGetUniversalAngle2(engine.joints().id(0)), q0, 1e-12);
        EXPECT_NEAR(dJointGetUniversalAngle1(engine.joints().id(0)), -0.6, 1e-12);
      }
    }
}

// Oracle: closed form; the coordinate must come to rest inside its stop, a push outward on each side, for
// each axis by itself. Tolerance: past the stop by at most one step's travel.
TEST_P(EveryJoint, HoldsEachStopOnItsOwnSide) {
  std::mt19937 random(11);
  const double step = 1e-3;
  for (int trial = 0; trial < 8; ++trial) {
    model::Model model = random_joint(random, GetParam().kind, GetParam().on_world);
    const std::size_t axes = model.joints[0].axes.size();
    // Four different ends, so that none can stand in for another.
    const model::Stop stops[] = {{-0.11, 0.17, 0}, {-0.23, 0.07, 0}};
    for (std::size_t i = 0; i < axes; ++i) model.joints[0].axes[i].stop = stops[i];
    for (std::size_t i = 0; i < axes; ++i)
      for (const double side : {-1.0, 1.0}) {
        ode::OdeEngine engine(model, settings({Effect::joint_stops}, step));
        std::vector<double> tau(axes, 0.0);
        tau[i] = side * (GetParam().kind == JointKind::slider ? 0.2 : 0.01);
        const double bound = side < 0 ? -stops[i].low : stops[i].high;
        double fastest = 0;
        bool reached = false;
        for (int k = 0; k < 3000; ++k) {
          const StepReport report = engine.step({tau});
          const double rate = side * engine.state().u[i];
          fastest = std::max(fastest, rate);
          reached = reached || report.stop_rows > 0;
          ASSERT_LE(side * engine.state().q[i], bound + fastest * step + 1e-6);
        }
        EXPECT_TRUE(reached);
        EXPECT_NEAR(side * engine.state().q[i], bound, 1e-3);
      }
  }
}

// Oracle: closed form, the torque does work tau qdot on the joint alone: from rest, in one step, the pair's
// generalised momentum is h tau, so kinetic energy = h tau qdot / 2; and momentum of the pair stays zero.
TEST_P(EveryJoint, TurnsTorqueIntoMotionAlongItsCoordinateAndReactsOnItsParent) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 20; ++trial) {
    model::Model model = random_joint(random, GetParam().kind, GetParam().on_world);
    const double step = 1e-4;
    Settings exact = settings({}, step);
    exact.ode().cfm = 1e-13;
    ode::OdeEngine engine(model, exact);
    std::vector<double> tau(model.joints[0].axes.size());
    for (double& t : tau) t = std::copysign(0.01, test::random_vector(random).x());
    engine.step({tau});
    const std::vector<double> rate = engine.state().u;
    double power = 0;
    double energy = 0;
    Vec3 momentum = Vec3::Zero();
    for (std::size_t i = 0; i < tau.size(); ++i) power += tau[i] * rate[i];
    for (std::size_t i = 1; i < model.bodies.size(); ++i) {
      const model::BodyState& b = engine.state().bodies[i];
      const Vec3 w_B = b.q.conjugate() * b.w;
      energy += 0.5 * model.bodies[i].mass * b.v.squaredNorm() + 0.5 * w_B.dot(model.bodies[i].inertia * w_B);
      momentum += model.bodies[i].mass * b.v;
    }
    EXPECT_GT(energy, 0);
    // 1e-5: the turn of the lever arms within the step, and rounding of a gap over the step.
    EXPECT_NEAR(energy, 0.5 * step * power, 1e-5 * energy);
    if (!GetParam().on_world) {
      EXPECT_LT(momentum.norm(), 1e-12);
    }
  }
}

std::string case_name(const testing::TestParamInfo<JointCase>& info) {
  const char* kinds[] = {"Hinge", "Universal", "Ball", "Slider"};
  return std::string(kinds[static_cast<int>(info.param.kind)]) + (info.param.on_world ? "OnWorld" : "OnBody");
}

INSTANTIATE_TEST_SUITE_P(Joints, EveryJoint, testing::ValuesIn(kAxial), case_name);

// Oracle: closed form, q'' = tau / I, and the semi-implicit Euler recurrence q_n = h^2 n (n + 1) / 2 q''.
TEST(Torque, GivesAHingeTheAccelerationTauOverI) {
  const model::Model model = test::hinged_body();
  ode::OdeEngine engine(model, settings({}));
  const double tau = 2e-5;
  for (int n = 1; n <= 100; ++n) {
    engine.step({std::span(&tau, 1)});
    // cfm 1e-9 softens no row along the axis; the rest is rounding.
    EXPECT_NEAR(engine.state().u[0], 1e-3 * n * tau / 1e-4, 1e-12);
  }
  // ODE's infinitesimal rotation turns by atan(w h / 2) * 2: w^3 h^3 / 12 short a step, 1e-13 in all.
  EXPECT_NEAR(engine.state().q[0], 1e-6 * 5050 * 0.2, 1e-10);
}

// Oracle: closed form, three torques on a ball joint of a body with equal moments turn it about their sum.
TEST(Torque, OnABallActsInTheParentFrame) {
  std::mt19937 random(3);
  model::Model model = model::make_model();
  test::add_body(model, test::body("bob", 0.1, {1e-4, 1e-4, 1e-4}));
  const Pose frame = test::random_pose(random);
  test::add_joint(model, "ball", JointKind::ball, 0, 1, frame, {Vec3::Zero(), test::random_pose(random).q},
                  {});
  ode::OdeEngine engine(model, settings({}));
  const std::vector<double> tau = {1e-5, -2e-5, 3e-5};
  engine.step({tau});
  const std::vector<double> rate = engine.state().u;
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(rate[i], 1e-3 * tau[i] / 1e-4, 1e-13);
  EXPECT_LT((engine.state().bodies[1].w - frame.q * Vec3(1e-4, -2e-4, 3e-4)).norm(), 1e-13);
}

// Oracle: conservation; a free pair has no outside force, so both momenta keep their start.
TEST(Pair, KeepsItsMomentumWhileTheJointWorks) {
  std::mt19937 random(2);
  model::Model model = random_joint(random, JointKind::universal, false);
  ode::OdeEngine engine(model, settings({}, 1e-4));
  const auto momenta = [&] {
    Vec3 linear = Vec3::Zero();
    Vec3 angular = Vec3::Zero();
    for (std::size_t i = 1; i < model.bodies.size(); ++i) {
      const model::BodyState& b = engine.state().bodies[i];
      const Mat3 R = b.q.toRotationMatrix();
      linear += model.bodies[i].mass * b.v;
      angular += model.bodies[i].mass * b.p.cross(b.v) + R * model.bodies[i].inertia * R.transpose() * b.w;
    }
    return std::pair(linear, angular);
  };
  const std::vector<double> tau = {2e-2, -1e-2};
  for (int i = 0; i < 1000; ++i) engine.step({tau});
  EXPECT_LT(momenta().first.norm(), 1e-12);
  // The bodies turn at tens of rad/s, so each carries about 2e-3 kg m^2/s; angular momentum errs by the
  // first-order treatment of the gyroscopic torque, below 2 % at this step.
  EXPECT_GT(engine.state().bodies[1].w.norm(), 1);
  EXPECT_LT(momenta().second.norm(), 4e-5);
}

// Oracle: Newton's law of restitution at the stop, within 0.05.
TEST(Stop, BouncesByItsRatio) {
  for (const double bounce : {0.3, 0.5, 0.8}) {
    model::Model model = test::hinged_body();
    model.joints[0].axes[0].stop = model::Stop{-1, 0.3, bounce};
    model.bodies[1].initial_angular_velocity = Vec3(0, 10, 0);
    ode::OdeEngine engine(model, settings({Effect::joint_stops}));
    test::run(engine, 60);
    EXPECT_NEAR(engine.state().u[0], -10 * bounce, 0.5);
  }
}

// Oracle: Newton's law of restitution, at any ERP (which is what ODE's own stop rebounds with) and step; a
// stop that is caught in time is never passed.
TEST(Stop, ReboundsByItsRatioAtAnyErpAndIsNotPassed) {
  for (const double speed : {10.0, 50.0, 200.0})
    for (const double step : {1e-3, 5e-3})
      for (const double erp : {0.2, 0.8, 1.0})
        for (const double bounce : {0.0, 0.5}) {
          SCOPED_TRACE(testing::Message()
                       << speed << " rad/s, step " << step << ", ERP " << erp << ", bounce " << bounce);
          model::Model model = test::hinged_body();
          model.joints[0].axes[0].stop = model::Stop{-3, 0.3, bounce};
          model.bodies[1].initial_angular_velocity = Vec3(0, speed, 0);
          Settings how = settings({Effect::joint_stops}, step);
          test::set_erp(how, erp);
          ode::OdeEngine engine(model, how);
          double back = 0;
          for (int i = 0; i < static_cast<int>(0.3 / speed / step) + 2; ++i) {
            engine.step({});
            EXPECT_LE(engine.state().q[0], 0.3 + 1e-9);
            back = std::max(back, -engine.state().u[0]);
          }
          EXPECT_NEAR(back, bounce * speed, 1e-5 * speed);
        }
}

// Oracle: identity; a stop that is out of reach, or that the joint leaves, changes no bit.
TEST(Stop, OutOfReachChangesNothing) {
  model::Model with = test::hinged_body(), without = with;
  with.joints[0].axes[0].stop = model::Stop{-0.01, 3, 0};
  with.bodies[1].initial_angular_velocity = without.bodies[1].initial_angular_velocity = Vec3(0, 20, 0);
  ode::OdeEngine a(with, settings({Effect::joint_stops})), b(without, settings({Effect::joint_stops}));
  for (int i = 0; i < 140; ++i) {
    a.step({});
    b.step({});
    ASSERT_EQ(test::bits(a.state()), test::bits(b.state())) << i;
  }
}

// Oracle: the range; stops whose outside is narrower than a step's turn are not jumped over.
TEST(Stop, JustShortOfHalfATurnIsNotJumpedOver) {
  model::Model model = test::hinged_body();
  model.joints[0].axes[0].stop = model::Stop{-3.14, 3.14, 0.9};
  model.bodies[1].initial_angular_velocity = Vec3(0, 50, 0);
  ode::OdeEngine engine(model, settings({Effect::joint_stops}));
  double last = 0;
  for (int i = 0; i < 1000; ++i) {
    engine.step({});
    const double q = engine.state().q[0];
    ASSERT_LT(std::abs(q - last), 0.06) << i;
    last = q;
  }
}

// Oracle: the model; a joint that starts at rest on a stop of zero must move freely off it, and says why.
TEST(Stop, AtZeroIsMovedOutwardAndSaysSo) {
  model::Model model = test::hinged_body();
  model.joints[0].axes[0].stop = model::Stop{0, 0.5, 0};
  ode::OdeEngine engine(model, settings({Effect::joint_stops}));
  ASSERT_EQ(engine.notes().size(), 1U);
  EXPECT_NE(engine.notes()[0].find("pin.axis0: low stop 0 rad moved to -1e-05 rad"), std::string::npos);
  const double tau = 2e-5;
  EXPECT_EQ(engine.step({std::span(&tau, 1)}).stop_rows, 0);
  EXPECT_NEAR(engine.state().u[0], 1e-3 * 0.2, 1e-13);
}

// Oracle: the effect's definition; a stop that is not asked for is not there.
TEST(Stop, IsAbsentWithoutItsEffect) {
  model::Model model = test::hinged_body();
  model.joints[0].axes[0].stop = model::Stop{-0.1, 0.1, 0};
  model.bodies[1].initial_angular_velocity = Vec3(0, 2, 0);
  ode::OdeEngine engine(model, settings({}));
  test::run(engine, 500);
  EXPECT_NEAR(engine.state().q[0], 1.0, 1e-6);
}

}  // namespace
}  // namespace handsim::engine
