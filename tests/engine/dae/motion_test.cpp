// The differential-algebraic engine compared with closed forms: pendulum, free rotation, torques, tissue,
// drives.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/shared_motions.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::JointKind;
using test::carried;
using test::settings;

constexpr Method kAll[] = {DaeMethod::stabilised_gear, DaeMethod::lagrange_penalty,
                           DaeMethod::euler_linearised, DaeMethod::euler_projected};

// Oracle: the period of a pendulum at any amplitude is 4 K(sin(a/2)) / w0 (complete elliptic integral).
TEST(StabilisedGear, BringsALargePendulumBackAfterItsExactPeriod) {
  model::Model model = test::hinged_body(0.1);
  const double amplitude = 2.5;
  model.joints[0].axes[0].initial = amplitude;
  const double w0 = std::sqrt(0.1 * 9.80665 * 0.1 / (1e-4 + 0.1 * 0.01));
  const double period = 4 * std::comp_ellint_1(std::sin(amplitude / 2)) / w0;
  const auto engine =
      make_engine(model, settings({Effect::gravity}, period / 200, DaeMethod::stabilised_gear));
  test::run(*engine, 100);
  EXPECT_NEAR(engine->state().q[0], -amplitude, 1e-7);
  test::run(*engine, 100);
  EXPECT_NEAR(engine->state().q[0], amplitude, 1e-7);
}

model::Model spinning_body(const Vec3& inertia, const Vec3& w) {
  model::Model model = model::make_model();
  test::add_body(model, test::body("top", 0.1, inertia));
  model.bodies[1].initial_angular_velocity = w;
  return model;
}

// Oracle: conservation to 1e-8, ten times the tolerance, during unstable rotation about the middle axis.
TEST(StabilisedGear, KeepsEnergyAndMomentumOfATumblingBody) {
  const model::Model model = spinning_body({1e-4, 2e-4, 2.8e-4}, {0.01, 20, 0.02});
  const auto engine = make_engine(model, settings({}, 5e-3, DaeMethod::stabilised_gear));
  const auto momentum = [&]() -> Vec3 {
    const model::BodyState& b = engine->state().bodies[1];
    return b.q * (model.bodies[1].inertia * (b.q.conjugate() * b.w));
  };
  const auto energy = [&] { return 0.5 * engine->state().bodies[1].w.dot(momentum()); };
  const Vec3 l = momentum();
  const double e = energy();
  double least = 20;
  for (int i = 0; i < 400; ++i) {
    engine->step({});
    ASSERT_LT((momentum() - l).norm(), 1e-8 * l.norm());
    ASSERT_NEAR(energy(), e, 1e-8 * e);
    const model::BodyState& b = engine->state().bodies[1];
    least = std::min(least, (b.q.conjugate() * b.w).y());
  }
  // It tumbled: the angular velocity about the middle axis changed its sign in body axes.
  EXPECT_LT(least, -19);
}

// Oracle: the axis of a symmetric top precesses about its angular momentum at |L| / I1.
TEST(StabilisedGear, RotatesASymmetricTopByEulersEquations) {
  const double across = 1e-4, along = 3e-5;
  const Vec3 w(3, 0, 40);
  const model::Model model = spinning_body({across, across, along}, w);
  const auto engine = make_engine(model, settings({}, 0.01, DaeMethod::stabilised_gear));
  test::run(*engine, 50);
  const double t = 0.5;
  const Vec3 l(across * w.x(), 0, along * w.z());
  const Quat want =
      rotation_quaternion(t / across * l) * rotation_quaternion({0, 0, t * (1 - along / across) * w.z()});
  EXPECT_LT(want.angularDistance(engine->state().bodies[1].q), 1e-8);
}

// Oracle: Newton, x = F t^2 / 2 m, and Euler about a principal axis.
TEST(DaeEngine, AppliesTorquesToSlidersAndBallJoints) {
  model::Model model = model::make_model();
  test::add_body(model, test::body("slide", 0.2, {1e-3, 1e-3, 1e-3}));
  test::add_body(model, test::body("ball", 0.2, {1e-3, 2e-3, 3e-3}));
  const Pose tilted{Vec3(0.1, 0.2, 0), rotation_quaternion({0.3, -1, 0.2})};
  test::add_joint(model, "rail", JointKind::slider, 0, 1, tilted, {Vec3(0.05, 0, 0), Quat::Identity()},
                  {Vec3(0.6, 0, 0.8)});
  test::add_joint(model, "socket", JointKind::ball, 0, 2, tilted, {}, {});
  const std::vector<double> torques = {0.7, 0, 0.02, 0};
  for (const Method method : {DaeMethod::stabilised_gear, DaeMethod::lagrange_penalty}) {
    const auto engine = make_engine(model, settings({}, 1e-3, method));
    for (int i = 0; i < 100; ++i) engine->step({torques});
    const std::vector<double> q = engine->state().q;
    // BDF2 starts with one step of implicit Euler, whose error is a h^2 / 2.
    const double margin = method == DaeMethod::stabilised_gear ? 1e-9 : 2e-5;
    EXPECT_NEAR(q[0], 0.7 * 0.01 / 2 / 0.2, margin);
    EXPECT_NEAR(q[2], 0.02 * 0.01 / 2 / 2e-3, margin);
    EXPECT_NEAR(q[1], 0, 1e-9);
  }
}

// Oracle: closed form of a damped oscillator, on a hinge.
TEST(StabilisedGear, MovesTissueAsADampedOscillator) {
  model::Model model = test::hinged_body(0, {1e-3, 1e-3, 1e-3});
  model.joints[0].axes[0].tissue = model::Tissue{0.05, 1e-3, 0.03};
  model.joints[0].axes[0].initial = 0.4;
  const auto engine =
      make_engine(model, settings({Effect::passive_tissue}, 0.01, DaeMethod::stabilised_gear));
  test::run(*engine, 100);
  const double decay = 0.5, t = 1;
  const double w = std::sqrt(0.05 / 1e-3 - decay * decay);
  const double want = 0.03 + 0.37 * std::exp(-decay * t) * (std::cos(w * t) + decay / w * std::sin(w * t));
  EXPECT_NEAR(engine->state().q[0], want, 1e-9);
}

// Oracle: the effect's definition.
TEST(DaeEngine, HasTissueAndGravityOnlyAsEffects) {
  model::Model model = test::hinged_body(0.1);
  model.joints[0].axes[0].tissue = model::Tissue{0.05, 1e-3, 0.03};
  model.joints[0].axes[0].initial = 0.4;
  for (const Method method : kAll) {
    const auto engine = make_engine(model, settings({}, 1e-3, method));
    test::run(*engine, 50);
    EXPECT_NEAR(engine->state().q[0], 0.4, 1e-12);
  }
}

// Oracle: four methods and another engine that must agree; keyframes are between steps. A linear motion
// starts with a velocity jump, which each method applies at the end of its own step.
TEST(DaeEngine, FollowsDrivenBodiesInEveryFormulation) {
  for (const auto interpolation : {model::Interpolation::minimum_jerk, model::Interpolation::linear}) {
    const Vec3 want = carried(interpolation, DaeMethod::stabilised_gear, 1e-2);
    EXPECT_LT((carried(interpolation, DaeMethod::stabilised_gear, 1e-3) - want).norm(), 1e-8);
    for (const Method method :
         std::initializer_list<Method>{DaeMethod::lagrange_penalty, DaeMethod::euler_linearised,
                                       DaeMethod::euler_projected, OdeMethod::world_step})
      EXPECT_LT((carried(interpolation, method, 1e-4) - want).norm(), 1e-3) << name(method);
  }
}

// Oracle: the uninterrupted motion, within the error of the method; torques change during the run.
TEST(DaeEngine, ContinuesFromASavedState) {
  const model::Model model = test::five_fingers(false, true);
  const std::vector<double> torques(static_cast<std::size_t>(model.dof_count()), 1e-3);
  for (const Method method : kAll) {
    const auto with = settings({Effect::gravity, Effect::passive_tissue}, 1e-3, method);
    const auto engine = make_engine(model, with);
    test::run(*engine, 20);
    const model::State saved = engine->state();
    const auto finish = [&](Engine& each) {
      for (int i = 0; i < 20; ++i) each.step({torques});
      return each.state().q;
    };
    const std::vector<double> want = finish(*engine);
    engine->set_state(saved);
    EXPECT_EQ(engine->state().time, 0.02);
    const std::vector<double> again = finish(*engine);
    const auto fresh = make_engine(model, with);
    fresh->set_state(saved);
    const std::vector<double> anew = finish(*fresh);
    const double margin = method == DaeMethod::stabilised_gear    ? 1e-8
                          : method == DaeMethod::lagrange_penalty ? 1e-3
                                                                  : 1e-9;
    for (std::size_t i = 0; i < want.size(); ++i) {
      EXPECT_NEAR(again[i], want[i], margin) << name(method);
      EXPECT_EQ(anew[i], again[i]) << name(method);
    }
  }
}

// Oracle: bit equality of two runs.
TEST(DaeEngine, RepeatsItselfToTheBit) {
  const model::Model model = test::five_fingers(false, true);
  for (const Method method : kAll) {
    const auto with = settings({Effect::gravity, Effect::passive_tissue}, 1e-3, method);
    const auto a = make_engine(model, with), b = make_engine(model, with);
    test::run(*a, 30);
    test::run(*b, 30);
    EXPECT_EQ(test::bits(a->state()), test::bits(b->state())) << name(method);
  }
}

}  // namespace
}  // namespace handsim::engine
