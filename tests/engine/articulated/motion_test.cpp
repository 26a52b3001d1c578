// Smooth and falling motion on the articulated engine: conservation, and engines that share nothing but the
// Model.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/shared_motions.h"
#include "handsim/model/energy.h"
#include "support/sanitized.h"

namespace handsim::engine {
namespace {

using model::Effect;
using test::carried;
using test::fallen;
using test::settings;
using test::shipped_hand;

double largest_distance(const std::vector<double>& a, const std::vector<double>& b) {
  double out = 0;
  for (std::size_t i = 0; i < a.size(); ++i) out = std::max(out, std::abs(a[i] - b[i]));
  return out;
}

/// Twice the finer less the coarser: what first-order results tend to.
std::vector<double> extrapolated(const std::vector<double>& fine, const std::vector<double>& coarse) {
  std::vector<double> out(fine.size());
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = 2 * fine[i] - coarse[i];
  return out;
}

// Oracle: conservation of angular momentum, and the proof in spin.h that energy never rises; first order, at
// spins of up to a radian in a step.
TEST(FreeSpin, KeepsItsMomentumAndNeverGainsEnergy) {
  for (const double speed : {5.0, 30.0, 200.0}) {
    model::Model model = model::make_model();
    test::add_body(model,
                   test::body("block", 2, {0.8, 0.68, 0.14}, {Vec3::Zero(), rotation_quaternion({1, 2, 3})}));
    model.bodies[1].initial_angular_velocity = speed * Vec3(0.3, 0.9, -0.4).normalized();
    const auto engine = make_engine(model, settings({}, 5e-3, ArticulatedMethod::semi_implicit_euler));
    const auto momentum = [&]() -> Vec3 {
      const model::BodyState& at = engine->state().bodies[1];
      return at.q * (model.bodies[1].inertia * (at.q.conjugate() * at.w));
    };
    const Vec3 start = momentum();
    double last = model::kinetic_energy(model, engine->state());
    for (int i = 0; i < 2000; ++i) {
      engine->step({});
      const double energy = model::kinetic_energy(model, engine->state());
      ASSERT_LE(energy, last * (1 + 1e-13)) << speed << " rad/s, step " << i;
      last = energy;
    }
    EXPECT_LT((momentum() - start).norm(), 1e-10 * start.norm()) << speed;
    EXPECT_EQ(engine->state().bodies[1].p, Vec3::Zero());
  }
}

class FallingHand : public testing::TestWithParam<std::pair<const char*, hand::Mount>> {
 protected:
  model::Model model_ = shipped_hand(GetParam().first, GetParam().second);
};

// Oracle: the reference engine, in maximal coordinates. Bound: 1e-8 rad.
TEST_P(FallingHand, FallsAsTheReferenceEngineHasItTo1e8) {
  if (GetParam().second != hand::Mount::fixed)
    HANDSIM_SKIP_WITH_SANITIZER("a fixed hand falls by the same code");
  const auto reference = fallen(model_, DaeMethod::stabilised_gear, 1e-2, 1e-11);
  EXPECT_LT(largest_distance(fallen(model_, ArticulatedMethod::dormand_prince, 1e-2), reference), 1e-8);
}

// Oracle: the same motion by another order; each method's error falls as its order says.
TEST_P(FallingHand, ConvergesWithItsMethodsOrders) {
  const auto reference = fallen(model_, ArticulatedMethod::dormand_prince, 1e-2, 1e-11);
  const auto error = [&](Method method, double h) {
    return largest_distance(fallen(model_, method, h), reference);
  };
  EXPECT_NEAR(std::log2(error(ArticulatedMethod::semi_implicit_euler, 2e-4) /
                        error(ArticulatedMethod::semi_implicit_euler, 1e-4)),
              1, 0.1);
  EXPECT_NEAR(std::log2(error(ArticulatedMethod::rk4, 2e-4) / error(ArticulatedMethod::rk4, 1e-4)), 4, 0.5);
}

// Oracle: ODE. Both are of first order, so what their steps tend to must agree as the second.
TEST_P(FallingHand, TendsToWhatOdeTendsTo) {
  const auto limit = [&](Method method, double h) {
    return extrapolated(fallen(model_, method, h), fallen(model_, method, 2 * h));
  };
  const auto distance = [&](double h) {
    return largest_distance(limit(ArticulatedMethod::semi_implicit_euler, h),
                            limit(OdeMethod::world_step, h));
  };
  EXPECT_LT(distance(1e-4), 2e-5);
  EXPECT_LT(distance(1e-4), 0.35 * distance(2e-4));
}

INSTANTIATE_TEST_SUITE_P(Hands, FallingHand,
                         testing::Values(std::pair("anatomical.yaml", hand::Mount::fixed),
                                         std::pair("anatomical.yaml", hand::Mount::universal),
                                         std::pair("anatomical.yaml", hand::Mount::free)),
                         [](const auto& each) { return "N" + std::to_string(each.index); });

// Oracle: the same of the prototype's hand, of hinges without tissue, on which torques would spin a fingertip
// beyond what the reference engine can follow: the reference engine to 1e-8 rad.
TEST(ArticulatedMotion, ThePrototypesHandFallsAsTheReferenceEngineHasItTo1e8) {
  for (const hand::Mount mount : {hand::Mount::fixed, hand::Mount::free}) {
    const model::Model model = shipped_hand("prototype.yaml", mount);
    const auto reference = fallen(model, DaeMethod::stabilised_gear, 1e-2, 1e-11, 0);
    EXPECT_LT(largest_distance(fallen(model, ArticulatedMethod::dormand_prince, 1e-2, 1e-10, 0), reference),
              1e-8);
  }
}

// Oracle: conservation, and the order of the method. A limp hand swings for 10 s. Bounds: 1e-8 of the energy
// it swings with at 0.25 ms; an eighth of the error at half the step.
TEST(ArticulatedMotion, KeepsEnergyForTenSecondsWithRk4) {
  HANDSIM_SKIP_WITH_SANITIZER("shorter tests step with this method");
  const model::Model model = shipped_hand("anatomical.yaml", hand::Mount::free);
  const auto worst = [&](double step) {
    const auto engine = make_engine(model, settings({}, step, ArticulatedMethod::rk4));
    const double start = model::kinetic_energy(model, engine->state());
    double out = 0;
    for (long i = 0; i < std::lround(10 / step); ++i) {
      engine->step({});
      out = std::max(out, std::abs(model::kinetic_energy(model, engine->state()) / start - 1));
    }
    return out;
  };
  const double coarse = worst(1e-3), middle = worst(5e-4), fine = worst(2.5e-4);
  RecordProperty("relative_energy_error", std::to_string(fine * 1e9) + "e-9");
  EXPECT_LT(middle, coarse / 8);
  EXPECT_LT(fine, 1e-8);
}

struct MomentumSum {
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
};
MomentumSum momentum_sum(const model::Model& model, const model::State& state) {
  MomentumSum out;
  for (std::size_t i = 1; i < model.bodies.size(); ++i) {
    const model::BodyState& at = state.bodies[i];
    const Vec3 p = model.bodies[i].mass * at.v;
    out.linear += p;
    out.angular += at.p.cross(p) + at.q * (model.bodies[i].inertia * (at.q.conjugate() * at.w));
  }
  return out;
}

// Oracle: conservation, of a hand with tissue that nothing else touches; relative to the momentum there is.
TEST(ArticulatedMotion, KeepsTheMomentumOfAFreeHand) {
  const model::Model model = shipped_hand("anatomical.yaml", hand::Mount::free);
  Settings with = settings({Effect::passive_tissue}, 1e-2, ArticulatedMethod::dormand_prince);
  test::set_tolerance(with, 1e-11);
  const auto engine = make_engine(model, with);
  const MomentumSum start = momentum_sum(model, engine->state());
  for (int i = 0; i < 200; ++i) engine->step({});
  const MomentumSum end = momentum_sum(model, engine->state());
  EXPECT_LT((end.linear - start.linear).norm(), 1e-10 * start.linear.norm());
  EXPECT_LT((end.angular - start.angular).norm(), 1e-10 * start.angular.norm());
}

// Oracle: rigid-body theory, to which the reference engine is held too: a body spinning freely keeps energy.
TEST(ArticulatedMotion, SpinsAFreeBodyWithoutLoss) {
  model::Model model = model::make_model();
  test::add_body(model, test::body("stone", 0.5, {1e-3, 2e-3, 2.5e-3}));
  model.bodies[1].initial_angular_velocity = Vec3(1, 20, 1);
  model.bodies[1].initial_velocity = Vec3(1, 2, 3);
  const auto engine =
      make_engine(model, settings({Effect::gravity}, 1e-2, ArticulatedMethod::dormand_prince));
  const auto other = make_engine(model, settings({Effect::gravity}, 1e-2, DaeMethod::stabilised_gear));
  test::run(*engine, 100);
  test::run(*other, 100);
  EXPECT_LT((engine->state().bodies[1].p - (Vec3(1, 2, 3) + 0.5 * model.gravity)).norm(), 1e-12);
  EXPECT_LT(engine->state().bodies[1].q.angularDistance(other->state().bodies[1].q), 1e-7);
}

// Oracle: another engine. A linear motion sets off and turns with jerks.
TEST(ArticulatedMotion, FollowsDrivenBodiesInEveryMethod) {
  for (const auto interpolation : {model::Interpolation::minimum_jerk, model::Interpolation::linear}) {
    const Vec3 want = carried(interpolation, DaeMethod::stabilised_gear, 1e-2);
    EXPECT_LT((carried(interpolation, ArticulatedMethod::dormand_prince, 1e-2) - want).norm(), 1e-8);
    EXPECT_LT((carried(interpolation, ArticulatedMethod::rk4, 1e-3) - want).norm(), 1e-7);
    EXPECT_LT((carried(interpolation, ArticulatedMethod::semi_implicit_euler, 1e-4) - want).norm(), 1e-3);
    EXPECT_LT((carried(interpolation, ArticulatedMethod::semi_implicit_euler, 1e-5) - want).norm(), 1e-4);
  }
}

// Oracle: going on without stopping.
TEST(ArticulatedMotion, GoesOnFromASavedState) {
  const model::Model model = test::five_fingers(true, true);
  for (const Method method :
       {ArticulatedMethod::semi_implicit_euler, ArticulatedMethod::rk4, ArticulatedMethod::dormand_prince}) {
    const auto with = settings({Effect::gravity, Effect::passive_tissue}, 1e-3, method);
    const auto engine = make_engine(model, with);
    test::run(*engine, 20);
    const model::State saved = engine->state();
    test::run(*engine, 20);
    const model::State want = engine->state();
    engine->set_state(saved);
    EXPECT_EQ(engine->state().time, saved.time);
    test::run(*engine, 20);
    EXPECT_LT(largest_distance(engine->state().q, want.q), 1e-9);
  }
}

}  // namespace
}  // namespace handsim::engine
