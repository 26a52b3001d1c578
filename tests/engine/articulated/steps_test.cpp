// Stops, servos and tissue solved within the articulated engine's step; what it refuses and how it fails.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/contact_scenes.h"
#include "engine/models.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::Servo;
using test::refusal;
using test::settings;

constexpr double kInertia = 2e-6;  // of a fingertip about its joint [kg m^2]
constexpr Method kEuler = ArticulatedMethod::semi_implicit_euler;

double angle(const Engine& engine) { return engine.state().q[0]; }
double rate(const Engine& engine) { return engine.state().u[0]; }

void drive(Engine& engine, Servo servo, double target, int steps) {
  for (int i = 0; i < steps; ++i) {
    servo.error = target - angle(engine);
    engine.step({.servos = std::span(&servo, 1)});
  }
}

model::Model hinge(std::optional<model::Stop> stop = std::nullopt) {
  model::Model model = test::hinged_body(0, {kInertia, kInertia, kInertia});
  model.joints[0].axes[0].stop = stop;
  return model;
}

// Oracle: the recurrence of a spring at the step's start whose damping, at its end, is the damper's, or h k
// where that is more: I (v+ - v) = h (k (target - x) - max(c, h k) v+), x+ = x + h v+. 1e-12: rounding of 500
// steps.
TEST(ArticulatedServo, FollowsTheImplicitRecurrence) {
  const double w = 2 * M_PI * 8, k = kInertia * w * w;
  for (const double c : {2 * kInertia * w, 0.02 * kInertia * w})
    for (const double h : {1e-3, 5e-3, 1e-2, 2e-2}) {
      const model::Model model = hinge();
      const auto engine = make_engine(model, settings({Effect::actuation}, h, kEuler));
      double x = 0, v = 0;
      for (int i = 0; i < 500; ++i) {
        const double target = 0.7 * std::sin(0.01 * i);
        v = (v + h / kInertia * k * (target - x)) / (1 + h / kInertia * std::max(h * k, c));
        x += h * v;
        drive(*engine, {k, c, 0, 0, 10}, target, 1);
        ASSERT_NEAR(angle(*engine), x, 1e-12) << h;
      }
    }
}

// Oracle: closed form: at the limit the hinge turns with constant acceleration, and below it not.
TEST(ArticulatedServo, HoldsItsTorqueLimitAndComesOffIt) {
  const model::Model model = hinge();
  const auto engine = make_engine(model, settings({Effect::actuation}, 1e-3, kEuler));
  const double limit = 1e-4;
  drive(*engine, {0.5, 1e-5, 0, 0.2, limit}, 3, 20);
  EXPECT_NEAR(rate(*engine), 20 * 1e-3 * limit / kInertia, 1e-9);
  drive(*engine, {5e-3, 2e-4, 0, 0, limit}, 0.5, 3000);
  EXPECT_NEAR(angle(*engine), 0.5, 1e-9);
}

// Oracle: stiff limits of stability do not exist for the end of the step: gains a million times beyond the
// explicit limit hold a hand at 20 ms, and it ends where its targets are.
TEST(ArticulatedServo, IsStableAtTwentyMilliseconds) {
  const model::Model model = test::five_fingers(true, true);
  Settings with = settings({Effect::actuation, Effect::gravity, Effect::passive_tissue, Effect::joint_stops},
                           2e-2, kEuler);
  const auto engine = make_engine(model, with);
  std::vector<Servo> servos(static_cast<std::size_t>(model.dof_count()), {100, 1, 0, 0, 1e6});
  for (int i = 0; i < 500; ++i) {
    const std::vector<double> q = engine->state().q;
    for (std::size_t k = 0; k < q.size(); ++k) servos[k].error = 0.4 - q[k];
    engine->step({.servos = servos});
    for (const double speed : engine->state().u) ASSERT_LT(std::abs(speed), 50);
  }
  for (const double q : engine->state().q) EXPECT_NEAR(q, 0.4, 2e-4);
}

// Oracle: the stop's place, reached from a swing, from a start at it, and under a servo that pulls beyond.
TEST(ArticulatedStop, IsNeverPassed) {
  for (const double h : {1e-3, 2e-2}) {
    const model::Model model = hinge(model::Stop{-0.5, 0.5, 0});
    const auto engine = make_engine(model, settings({Effect::actuation, Effect::joint_stops}, h, kEuler));
    for (int i = 0; i < 300; ++i) {
      drive(*engine, {0.05, 1e-4, 0, 0, 1}, i < 150 ? 1.5 : -2, 1);
      EXPECT_LT(std::abs(angle(*engine)), 0.5 + 1e-12);
    }
    EXPECT_NEAR(angle(*engine), -0.5, 1e-12);
  }
}

// Oracle: restitution's definition, at any step; the next flight starts from the stop within one step's way.
TEST(ArticulatedStop, BouncesAsItsRestitutionSays) {
  for (const double bounce : {0.0, 0.3, 1.0}) {
    model::Model model = hinge(model::Stop{-0.5, 0.5, bounce});
    model.bodies[1].initial_angular_velocity = Vec3(0, 7, 0);
    const auto engine = make_engine(model, settings({Effect::joint_stops}, 1e-3, kEuler));
    test::run(*engine, 100);
    EXPECT_NEAR(rate(*engine), -7 * bounce, 1e-9) << bounce;
  }
}

// Oracle: the stops, which a hinge reaches at a constant rate, as it would go on without them, in a range so
// narrow that a rebound would cross it in one step. With a ball on the ground the contact solver has the
// stops.
TEST(ArticulatedStop, IsNotPassedAtAConstantRateNorByARebound) {
  for (const bool contact : {false, true})
    for (const double bounce : {0.0, 0.8}) {
      model::Model model = hinge(model::Stop{-0.1, 0.1, bounce});
      model.bodies[1].initial_angular_velocity = Vec3(0, 20, 0);
      if (contact) {
        test::add_ground(model);
        test::add_solid(model, test::sized("ball", model::ShapeKind::sphere, 0.02, 0), 0.1,
                        {Vec3(1, 0, 0.02), Quat::Identity()});
      }
      const auto engine = make_engine(
          model, settings({Effect::gravity, Effect::joint_stops, Effect::ground_contact}, 2e-2, kEuler));
      double furthest = 0;
      for (int i = 0; i < 40; ++i) {
        engine->step({});
        furthest = std::max(furthest, std::abs(angle(*engine)));
      }
      EXPECT_EQ(engine->contacts().size(), contact ? 1U : 0U);
      EXPECT_NEAR(furthest, 0.1, 1e-12) << contact << ", " << bounce;
    }
}

// Oracle: what a servo does without the stop, in its first step away from it.
TEST(ArticulatedStop, LetsGoWithoutASpike) {
  double rates[2] = {0, 0};
  for (const bool stop : {false, true}) {
    model::Model model = hinge(stop ? std::optional(model::Stop{-0.5, 0.5, 0}) : std::nullopt);
    model.joints[0].axes[0].initial = 0.5;
    const auto engine = make_engine(model, settings({Effect::actuation, Effect::joint_stops}, 1e-3, kEuler));
    drive(*engine, {0, 1e-3, 0, 1e-2, 1}, 0, 20);
    if (stop) {
      EXPECT_NEAR(angle(*engine), 0.5, 1e-12);
    }
    drive(*engine, {0, 1e-3, 0, -1e-3, 1}, 0, 1);
    rates[stop ? 1 : 0] = rate(*engine);
  }
  EXPECT_NEAR(rates[1], -1.0 / 3.0, 1e-9);
}

// Oracle: the stop's law, by hand: it pushes only where the servo alone comes back slower than erp depth / h.
TEST(ArticulatedStop, LetsAServoComeBackFasterFromBeyondIt) {
  const model::Model model = hinge(model::Stop{0, 1, 0});
  Settings with = settings({Effect::actuation, Effect::joint_stops}, 1e-3, kEuler);
  test::set_erp(with, 0.2);
  const auto engine = make_engine(model, with);
  for (const double depth : {1e-5, 1e-4, 3e-4, 6e-4, 1e-3, 4e-3}) {
    model::State state = engine->state();
    const double start = -depth, speed = 0;
    model::place_joints(model, std::span(&start, 1), std::span(&speed, 1), state);
    engine->set_state(state);
    const Servo servo{0, 0.02, 0, 0.0027, 1};
    EXPECT_EQ(engine->step({.servos = std::span(&servo, 1)}).lcp_failures, 0) << depth;
    const double alone = 1e-3 * servo.feed / (kInertia + 1e-3 * servo.damping);
    EXPECT_NEAR(rate(*engine), std::max(alone, 0.2 * depth / 1e-3), 1e-9) << depth;
  }
}

// Oracle: ODE with hard stops (no pull back, so that it does not rebound): both hands come to rest on the
// same stops on the same way. Of first order, so a tenth of the step brings them ten times as near.
TEST(ArticulatedStop, StopsAFallingHandAsOdeDoes) {
  const model::Model model = test::five_fingers(true, true);
  const auto fall = [&](Method method, double h) {
    Settings with = settings({Effect::gravity, Effect::passive_tissue, Effect::joint_stops}, h, method);
    test::set_erp(with, method == kEuler ? 0.2 : 0);
    const auto engine = make_engine(model, with);
    std::vector<double> torques(static_cast<std::size_t>(model.dof_count()), 0.02);
    int stops = 0;
    for (long i = 0; i < std::lround(0.3 / h); ++i) stops = engine->step({torques}).stop_rows;
    EXPECT_GT(stops, 2);
    return engine->state().q;
  };
  const auto distance = [&](double h) {
    const auto a = fall(kEuler, h), b = fall(OdeMethod::world_step, h);
    double out = 0;
    for (std::size_t i = 0; i < a.size(); ++i) out = std::max(out, std::abs(a[i] - b[i]));
    return out;
  };
  const double coarse = distance(1e-3), fine = distance(1e-4);
  EXPECT_LT(coarse, 0.05);
  EXPECT_LT(fine, 0.2 * coarse);
}

// Oracle: closed form of a damped oscillator, to the method's order.
TEST(ArticulatedTissue, SwingsAsADampedOscillator) {
  model::Model model = test::hinged_body(0, {1e-3, 1e-3, 1e-3});
  model.joints[0].axes[0].tissue = model::Tissue{0.05, 1e-3, 0.03};
  model.joints[0].axes[0].initial = 0.4;
  const double decay = 0.5, w = std::sqrt(0.05 / 1e-3 - decay * decay);
  const double want = 0.03 + 0.37 * std::exp(-decay) * (std::cos(w) + decay / w * std::sin(w));
  const auto end = [&](Method method, double h) {
    const auto engine = make_engine(model, settings({Effect::passive_tissue}, h, method));
    test::run(*engine, static_cast<int>(std::lround(1 / h)));
    return angle(*engine);
  };
  EXPECT_NEAR(end(ArticulatedMethod::dormand_prince, 1e-2), want, 1e-9);
  EXPECT_NEAR(end(ArticulatedMethod::rk4, 1e-3), want, 1e-9);
  EXPECT_NEAR(end(kEuler, 1e-4), want, 2e-3);
}

TEST(ArticulatedEngine, RefusesWhatItCannotDo) {
  const model::Model model = test::five_fingers(true, false, true);
  for (const Effect effect : {Effect::object_contact, Effect::self_contact, Effect::ground_contact})
    for (const Method method : {ArticulatedMethod::rk4, ArticulatedMethod::dormand_prince}) {
      EXPECT_NE(refusal(model, settings({effect}, 1e-3, method)).find("no contact with"), std::string::npos);
      EXPECT_EQ(refusal(model, settings({effect}, 1e-3, kEuler)), "");
    }
  EXPECT_NE(refusal(model, settings({Effect::joint_stops}, 1e-3, ArticulatedMethod::rk4)).find("joint_stops"),
            std::string::npos);
  EXPECT_EQ(refusal(model, settings({Effect::joint_stops}, 1e-3, kEuler)), "");
  const auto engine = make_engine(model, settings({}, 1e-3, kEuler));
  const std::vector<Servo> servos(static_cast<std::size_t>(model.dof_count()), {1, 1, 0, 0, 1});
  EXPECT_THROW(engine->step({.servos = servos}), Error);
  const std::vector<double> one = {1};
  EXPECT_THROW(engine->step({.torques = one}), Error);
}

// Oracle: the contract of Engine::step.
TEST(ArticulatedEngine, NamesWhatRunsAwayAndKeepsTheLastGoodState) {
  const model::Model model = test::five_fingers(false, false);
  for (const Method method :
       std::initializer_list<Method>{kEuler, ArticulatedMethod::rk4, ArticulatedMethod::dormand_prince}) {
    const auto engine = make_engine(model, settings({Effect::gravity}, 1e-3, method));
    test::run(*engine, 5);
    const auto good = test::bits(engine->state());
    std::vector<double> torques(static_cast<std::size_t>(model.dof_count()), 0.0);
    torques[6] = 1e9;
    std::string first;
    try {
      engine->step({torques});
      FAIL();
    } catch (const Error& error) {
      ASSERT_TRUE(error.fault());
      EXPECT_EQ(error.fault()->where.substr(0, 2), "f1");
      first = error.what();
    }
    EXPECT_EQ(test::bits(engine->state()), good);
    try {
      engine->step({});
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.what(), first);
    }
    const auto other = make_engine(model, settings({Effect::gravity}, 1e-3, method));
    torques[6] = std::nan("");
    EXPECT_THROW(other->step({torques}), Error);
  }
}

// Oracle: bit equality of two runs.
TEST(ArticulatedEngine, RepeatsItselfToTheBit) {
  const model::Model model = test::five_fingers(true, true);
  const auto with = settings({Effect::gravity, Effect::passive_tissue, Effect::joint_stops}, 1e-3, kEuler);
  const auto a = make_engine(model, with), b = make_engine(model, with);
  test::run(*a, 300);
  test::run(*b, 300);
  EXPECT_EQ(test::bits(a->state()), test::bits(b->state()));
}

}  // namespace
}  // namespace handsim::engine
