// Spring-damper drives solved within ODE's step.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/models.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::JointKind;
using model::Servo;
using test::settings;

constexpr double kInertia = 2e-6;  // of a fingertip about its joint [kg m^2]

double angle(const Engine& engine) { return engine.state().q[0]; }

/// Steps a hinge with a servo towards a target; the error is taken anew at each step.
void drive(Engine& engine, Servo servo, double target, int steps) {
  for (int i = 0; i < steps; ++i) {
    servo.error = target - angle(engine);
    engine.step({.servos = std::span(&servo, 1)});
  }
}

/// The implicit spring-damper's recurrence: I (v+ - v) = h (k (target - x - h v+) - c v+), then
/// x+ = x + 2 atan(h v+ / 2), which is how ODE's first-order quaternion update turns a body.
struct Recurrence {
  double x = 0, v = 0;
  void step(double k, double c, double target, double h) {
    v = (v + h / kInertia * k * (target - x)) / (1 + h / kInertia * (h * k + c));
    x += 2 * std::atan(0.5 * h * v);
  }
};

double worst_departure(Method method, double h) {
  const double w = 2 * M_PI * 8;
  const double k = kInertia * w * w, c = 2 * kInertia * w;
  const model::Model model = test::hinged_body(0, {kInertia, kInertia, kInertia});
  Settings with = settings({Effect::actuation}, h, method);
  with.ode().iterations = 50;
  const auto engine = make_engine(model, with);
  Recurrence reference;
  double worst = 0;
  for (int i = 0; i < 500; ++i) {
    const double target = 0.7 * std::sin(0.01 * i);
    reference.step(k, c, target, h);
    drive(*engine, {k, c, 0, 0, 10}, target, 1);
    worst = std::max(worst, std::abs(angle(*engine) - reference.x));
  }
  return worst;
}

// Oracle: the discrete recurrence. 1e-12: rounding of 500 steps; the iterative solver's bound is looser.
TEST(Servo, FollowsTheImplicitRecurrenceWithWorldStepTo1e12) {
  for (const double h : {1e-3, 5e-3, 1e-2, 2e-2})
    EXPECT_LT(worst_departure(OdeMethod::world_step, h), 1e-12) << h;
}

TEST(Servo, FollowsTheImplicitRecurrenceWithQuickStepTo1e3) {
  for (const double h : {1e-3, 5e-3, 1e-2, 2e-2})
    EXPECT_LT(worst_departure(OdeMethod::quick_step, h), 1e-3) << h;
}

// Oracle: closed form. At the limit the hinge turns with constant acceleration limit / I.
TEST(Servo, HoldsItsTorqueLimit) {
  const model::Model model = test::hinged_body(0, {kInertia, kInertia, kInertia});
  const auto engine = make_engine(model, settings({Effect::actuation}));
  const double limit = 1e-4;
  drive(*engine, {0.5, 1e-5, 0, 0.2, limit}, 3, 100);
  EXPECT_NEAR(engine->state().u[0], 100 * 1e-3 * limit / kInertia, 1e-9);
}

// Oracle: the limit. In steps with contact a servo far below its limit has none in a first solution; here the
// error jumps in one step from nothing to 200 times what the limit allows.
TEST(Servo, HoldsItsTorqueLimitInAStepWithContact) {
  model::Model model = test::hinged_body(0, {kInertia, kInertia, kInertia});
  test::add_ground(model);
  model::Shape ball = test::shape("ball", model::ShapeKind::sphere, 0);
  ball.radius = 0.02;
  ball.body = test::add_body(
      model, test::body("ball", 0.1, Vec3::Constant(1e-5), {Vec3(0, 0, 0.02), Quat::Identity()}));
  model.shapes.push_back(ball);
  const auto engine = make_engine(
      model, settings({Effect::actuation, Effect::gravity, Effect::ground_contact, Effect::friction}));
  const double limit = 1e-4;
  drive(*engine, {0.05, 1e-5, 0, 0, limit}, angle(*engine), 20);
  ASSERT_FALSE(engine->contacts().empty());
  drive(*engine, {0.05, 1e-5, 0, 0, limit}, angle(*engine) + 0.4, 1);
  EXPECT_NEAR(engine->state().tau_servo[0], limit, 1e-9 * limit);
}

// Oracle: the stop's place. The servo pulls beyond the stop with 20 times what the stop is tested with
// elsewhere.
TEST(Servo, LeavesTheStopOfItsJointAlive) {
  model::Model model = test::hinged_body(0, {kInertia, kInertia, kInertia});
  model.joints[0].axes[0].stop = model::Stop{-0.5, 0.5, 0};
  const auto engine = make_engine(model, settings({Effect::actuation, Effect::joint_stops}));
  drive(*engine, {0.05, 1e-4, 0, 0, 1}, 1.5, 2000);
  EXPECT_NEAR(angle(*engine), 0.5, 1e-3);
}

// Oracle: closed form, h feed / (I + h damping) = 1/3 rad/s, with and without a stop. A motor sharing the
// stop's row would leave it with a spike (ODE's fudge factor); 1e-6 of the rate is the softness of the stop's
// row.
TEST(Servo, LeavesAStopWithoutASpike) {
  double rates[2] = {0, 0};
  for (const bool stop : {false, true}) {
    model::Model model = test::hinged_body(0, {kInertia, kInertia, kInertia});
    model.joints[0].axes[0].initial = 0.5;
    if (stop) model.joints[0].axes[0].stop = model::Stop{-0.5, 0.5, 0};
    const auto engine = make_engine(model, settings({Effect::actuation, Effect::joint_stops}));
    drive(*engine, {0, 1e-3, 0, -1e-3, 1}, 0, 1);
    rates[stop ? 1 : 0] = engine->state().u[0];
  }
  EXPECT_NEAR(rates[0], -1.0 / 3.0, 1e-9);
  EXPECT_NEAR(rates[1], rates[0], 1e-6 * std::abs(rates[0]));
}

// Oracle: two ways that must agree. On each axis of a universal joint a servo without gains but a tiny damper
// gives what the same torque gives.
TEST(Servo, TurnsBothAxesOfAUniversalJointAsTheTorqueDoes) {
  model::Model model = model::make_model();
  test::add_body(model, test::body("bob", 0.1, {1e-4, 2e-4, 3e-4}));
  test::add_joint(model, "cross", JointKind::universal, 0, 1, {}, {Vec3(0, 0.02, 0.1), Quat::Identity()},
                  {Vec3::UnitX(), Vec3::UnitY()});
  model.joints[0].axes[0].initial = 0.4;
  model.joints[0].axes[1].initial = -0.3;
  const auto pushed = make_engine(model, settings({Effect::actuation}));
  const auto served = make_engine(model, settings({Effect::actuation}));
  const std::vector<double> tau = {3e-3, -5e-3};
  const std::vector<Servo> servos = {{0, 1e-12, 0, tau[0], 1}, {0, 1e-12, 0, tau[1], 1}};
  for (int i = 0; i < 200; ++i) {
    pushed->step({.torques = tau});
    served->step({.servos = servos});
  }
  const std::vector<double> a = pushed->state().q;
  const std::vector<double> b = served->state().q;
  EXPECT_GT(std::abs(a[0] - 0.4), 1e-2);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_NEAR(a[i], b[i], 1e-9);
}

TEST(Servo, DrivesASlider) {
  model::Model model = model::make_model();
  test::add_body(model, test::body("cart", 0.5, {1e-4, 1e-4, 1e-4}));
  test::add_joint(model, "rail", JointKind::slider, 0, 1, {}, {}, {Vec3::UnitX()});
  const auto engine = make_engine(model, settings({Effect::actuation}));
  drive(*engine, {200, 20, 0, 0, 100}, 0.05, 2000);
  EXPECT_NEAR(angle(*engine), 0.05, 1e-6);
}

// Oracle: never having been driven. A limit of 0, and no servos after some, leave the joint alone.
TEST(Servo, LetsGoOfWhatItNoLongerDrives) {
  const model::Model model = test::hinged_body(0, {kInertia, kInertia, kInertia});
  const auto engine = make_engine(model, settings({Effect::actuation}));
  drive(*engine, {1e-3, 1e-5, 0, 0, 1}, 0.3, 5);
  const double rate = engine->state().u[0];
  engine->step({});
  EXPECT_NEAR(engine->state().u[0], rate, 1e-12);
  drive(*engine, {1e-3, 1e-5, 0, 0, 0}, 0.3, 5);
  EXPECT_NEAR(engine->state().u[0], rate, 1e-12);
}

TEST(Servo, WithoutActuationOrWithBadGainsIsRefused) {
  const model::Model model = test::hinged_body();
  const Servo good{1, 1, 0, 0, 1};
  const auto passive = make_engine(model, settings({}));
  EXPECT_THROW(passive->step({.servos = std::span(&good, 1)}), Error);
  const auto engine = make_engine(model, settings({Effect::actuation}));
  const double nan = std::nan("");
  for (const Servo& bad :
       {Servo{-1, 1, 0, 0, 1}, Servo{0, 0, 0, 0, 1}, Servo{nan, 1, 0, 0, 1}, Servo{1, 1, 0, 0, nan}})
    EXPECT_THROW(engine->step({.servos = std::span(&bad, 1)}), Error);
  const Servo lost{1, 1, nan, 0, 1};
  try {
    engine->step({.servos = std::span(&lost, 1)});
    FAIL();
  } catch (const Error& error) {
    ASSERT_TRUE(error.fault());
    EXPECT_EQ(error.fault()->where, "pin");
  }
}

}  // namespace
}  // namespace handsim::engine
