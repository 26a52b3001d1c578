// The control law, feed-forward terms, and gains designed for the built hand.
#include "handsim/control/controller.h"
#include "handsim/model/kinematics.h"

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include <cmath>
#include <random>

#include "engine/models.h"
#include "handsim/control/joint_space.h"
#include "scene_files.h"

namespace handsim::control {
namespace {

using engine::test::settings;
using model::Effect;

constexpr double kInertia = 2e-6;  // of a fingertip [kg m^2]
constexpr double kStep = 1e-3;

/// A hinge under control, without files: one axis, one target.
struct Bench {
  explicit Bench(DrivenAxis axis, Form form = Form::explicit_torque, double target = 0, double start = 0)
      : model(engine::test::hinged_body(0, {kInertia, kInertia, kInertia})) {
    model.joints[0].axes[0].initial = start;
    plan.form = form;
    axis.name = "pin";
    plan.axes = {axis};
    HandPlan hand{"right", model::Side::right, Trajectory(1, model::Interpolation::linear)};
    hand.trajectory.add(0, std::vector<double>{target});
    plan.hands = {hand};
  }
  Controller controller() const { return {model, plan, kStep, model::initial_state(model)}; }
  /// State at an angle and a rate.
  model::State at(double angle, double rate) const {
    model::State state = model::state_at(model, std::vector<double>{angle});
    state.bodies[1].w = Vec3(0, rate, 0);
    model::update_coordinates(model, state);
    return state;
  }
  model::Model model;
  Plan plan;
};

DrivenAxis gains(double p, double d, double i, double limit) {
  DrivenAxis out;
  out.proportional = p, out.derivative = d, out.integral = i, out.torque_limit = limit;
  return out;
}

// Oracle: the law itself, P e - D q' + I h e after one step.
TEST(Pid, GivesTheTextbookTorque) {
  const Bench bench(gains(0.2, 0.01, 5, 10), Form::explicit_torque, 0.7);
  Controller controller = bench.controller();
  const model::State state = bench.at(0.3, 2);
  controller.observe(state);
  controller.command(state);
  EXPECT_NEAR(controller.torques()[0], 0.2 * 0.4 - 0.01 * 2 + 5 * kStep * 0.4, 1e-14);
}

// A jump of the target changes the torque by P times the jump only.
TEST(Pid, TakesItsDerivativeFromTheMeasurement) {
  Bench bench(gains(0.2, 0.01, 0, 10));
  bench.plan.hands[0].trajectory.add(0.5, std::vector<double>{0});
  bench.plan.hands[0].trajectory.add(0.5, std::vector<double>{1});
  Controller controller = bench.controller();
  model::State state = bench.at(0, 0);
  state.time = 0.6;
  controller.observe(state);
  controller.command(state);
  EXPECT_NEAR(controller.torques()[0], 0.2, 1e-14);
}

// Oracle: first-order low-pass, backward Euler: the share 1 - (1 + 2 pi f h)^-n of a constant rate after n
// steps.
TEST(Pid, LowPassesItsDerivative) {
  DrivenAxis low = gains(0, 0.01, 0, 10);
  low.derivative_cutoff = 20;
  const Bench bench(low);
  Controller controller = bench.controller();
  const model::State state = bench.at(0, 3);
  for (int n = 1; n <= 30; ++n) {
    controller.observe(state);
    controller.command(state);
    EXPECT_NEAR(controller.torques()[0], -0.01 * 3 * (1 - std::pow(1 + 2 * M_PI * 20 * kStep, -n)), 1e-14);
  }
}

// Oracle: the same filter on the engine's own motion: I (v+ - v) = -h D d+, d+ = d + s (v+ - d).
TEST(Pid, LowPassesItsDerivativeWithinTheStepInTheImplicitForm) {
  DrivenAxis low = gains(0, 1e-3, 0, 10);
  low.derivative_cutoff = 20;
  Bench bench(low, Form::implicit_gain);
  bench.model.bodies[1].initial_angular_velocity = Vec3(0, 3, 0);
  const auto engine = engine::make_engine(bench.model, settings({Effect::actuation}));
  Controller controller(bench.model, bench.plan, kStep, engine->state());
  const double x = 2 * M_PI * 20 * kStep, s = x / (1 + x);
  double v = 3, d = 3;
  for (int n = 0; n < 100; ++n) {
    v = (v - kStep / kInertia * 1e-3 * (1 - s) * d) / (1 + kStep / kInertia * 1e-3 * s);
    d += s * (v - d);
    controller.command(engine->state());
    engine->step({controller.torques(), controller.servos()});
    controller.observe(engine->state());
    EXPECT_NEAR(controller.axes()[0].rate, v, 1e-9) << n;
  }
}

// Oracle: the integral's limit. A blocked joint is driven for 10 s; then the error changes sign, and a
// wound-up integral would keep the torque's sign for as long.
TEST(Pid, DoesNotWindUpAtItsLimit) {
  const Bench bench(gains(0.2, 0, 5, 0.1), Form::explicit_torque, 1);
  Controller controller = bench.controller();
  for (int n = 0; n < 10'000; ++n) {
    controller.observe(bench.at(0, 0));
    controller.command(bench.at(0, 0));
    ASSERT_LE(std::abs(controller.torques()[0]), 0.1);
  }
  const model::State beyond = bench.at(1.6, 0);
  controller.observe(beyond);
  controller.command(beyond);
  EXPECT_LT(controller.torques()[0], 0);
}

// Oracle: bit equality of a controller with the one from whose saved state it was restored.
TEST(Pid, ContinuesFromASavedStateToTheBit) {
  DrivenAxis full = gains(0.2, 0.01, 5, 1);
  full.derivative_cutoff = 50;
  const Bench bench(full, Form::implicit_gain, 0.5);
  Controller first = bench.controller();
  for (int n = 0; n < 50; ++n) {
    first.command(bench.at(0.01 * n, 1));
    first.observe(bench.at(0.01 * n, 1));
  }
  Controller second(bench.model, bench.plan, kStep, bench.at(0.49, 1));
  ArchiveWriter saved;
  first.save(saved);
  ArchiveReader restored(saved.bytes(), "controller");
  second.restore(restored);
  const model::State state = bench.at(0.49, 1);
  first.command(state);
  second.command(state);
  EXPECT_EQ(first.servos()[0].feed, second.servos()[0].feed);
  EXPECT_EQ(first.servos()[0].error, second.servos()[0].error);
}

// Oracle: the torque that the engine applied, from I dv / h.
TEST(Implicit, ReportsTheTorqueThatActed) {
  for (const double limit : {10.0, 1e-3}) {
    const Bench bench(gains(0.005, 1e-4, 0.01, limit), Form::implicit_gain, 0.8);
    const auto engine = engine::make_engine(bench.model, settings({Effect::actuation}));
    Controller controller = bench.controller();
    double before = 0;
    for (int n = 0; n < 20; ++n) {
      controller.command(engine->state());
      engine->step({controller.torques(), controller.servos()});
      controller.observe(engine->state());
      const double rate = engine->state().u[0];
      EXPECT_NEAR(controller.axes()[0].torque, kInertia * (rate - before) / kStep, 1e-12);
      before = rate;
    }
    EXPECT_EQ(controller.axes()[0].at_limit, limit < 1);
  }
}

/// The right hand of a scene with its axes.
struct HandAt {
  explicit HandAt(const scene::Scene& scene)
      : model(scene.model), axes(hand_axes(model, model.hands[0])), random(3) {}
  /// A random posture within the joints' ranges.
  model::State posture() {
    std::vector<double> q(static_cast<std::size_t>(model.dof_count()));
    for (const HandAxis& axis : axes.axes)
      q[axis.dof] = std::uniform_real_distribution<double>(axis.stop->low, axis.stop->high)(random);
    return model::state_at(model, q);
  }
  const model::Model& model;
  HandAxes axes;
  std::mt19937 random;
};

// Oracle: the derivative of potential energy by central differences; 1e-9 is their error at 1e-5 rad.
TEST(Gravity, IsTheGradientOfPotentialEnergy) {
  const scene::Scene scene = test::shipped_scene("resting_hand");
  HandAt hand(scene);
  const Vec3 g(1, -2, -9);
  GravityLoad load(hand.model, g);
  const auto energy = [&](const std::vector<double>& q) {
    const model::State state = model::state_at(hand.model, q);
    double sum = 0;
    for (std::size_t b = 1; b < state.bodies.size(); ++b)
      sum -= hand.model.bodies[b].mass * g.dot(state.bodies[b].p);
    return sum;
  };
  for (int trial = 0; trial < 10; ++trial) {
    const model::State state = hand.posture();
    const std::span<const double> torques = load.torques(state);
    std::vector<double> q = state.q;
    for (std::size_t i = 0; i < q.size(); ++i) {
      const double middle = q[i];
      q[i] = middle + 1e-5;
      const double above = energy(q);
      q[i] = middle - 1e-5;
      EXPECT_NEAR(torques[i], (above - energy(q)) / 2e-5, 1e-9) << hand.axes.axes[i].name();
      q[i] = middle;
    }
  }
}

// Oracle: the engine. From rest, rates after one step times M are the torques times h; 1e-6 relative is the
// compliance (CFM) of the joints' constraints.
void expect_inertia_of_engine(const scene::Scene& scene) {
  HandAt hand(scene);
  const auto engine = engine::make_engine(hand.model, settings({}, 1e-5));
  for (int trial = 0; trial < 5; ++trial) {
    const model::State state = hand.posture();
    const Eigen::MatrixXd inertia = joint_inertia(hand.model, state, hand.model.hands[0], hand.axes);
    std::vector<double> torques;
    for (std::size_t i = 0; i < hand.axes.axes.size(); ++i)
      torques.push_back(1e-3 * std::uniform_real_distribution<double>(-1, 1)(hand.random));
    engine->set_state(state);
    engine->step({.torques = torques});
    const std::vector<double> rates = engine->state().u;
    const Eigen::VectorXd found =
        inertia * Eigen::Map<const Eigen::VectorXd>(rates.data(), inertia.cols()) / 1e-5;
    for (Eigen::Index i = 0; i < found.size(); ++i)
      EXPECT_NEAR(found[i], torques[static_cast<std::size_t>(i)], 1e-6)
          << hand.axes.axes[static_cast<std::size_t>(i)].name();
  }
}

TEST(Inertia, OfAHeldWristIsWhatTheEngineMoves) {
  expect_inertia_of_engine(test::shipped_scene("resting_hand"));
}
TEST(Inertia, OfAFreeHandIsWhatTheEngineMoves) {
  expect_inertia_of_engine(test::shipped_scene("dropped_hand"));
}

// Oracle: Gershgorin's bound, on which the designed damping ratio depends.
TEST(Inertia, EffectiveInertiaBoundsEveryMode) {
  const scene::Scene scene = test::shipped_scene("resting_hand");
  HandAt hand(scene);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::MatrixXd inertia = joint_inertia(hand.model, hand.posture(), hand.model.hands[0], hand.axes);
    const Eigen::VectorXd root = effective_inertia(inertia).cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(root.asDiagonal() * inertia *
                                                               root.asDiagonal());
    EXPECT_LE(modes.eigenvalues().maxCoeff(), 1 + 1e-12);
    EXPECT_GT(modes.eigenvalues().minCoeff(), 0);
  }
}

/// Largest angle of a hinge released at 1 mrad under explicit gains, over 2000 steps.
double excursion(double proportional, double derivative) {
  const Bench bench(gains(proportional, derivative, 0, 1e6), Form::explicit_torque, 0, 1e-3);
  const auto engine = engine::make_engine(bench.model, settings({Effect::actuation}));
  Controller controller = bench.controller();
  double largest = 0;
  for (int n = 0; n < 2000 && largest < 0.1; ++n) {
    controller.command(engine->state());
    engine->step({controller.torques(), controller.servos()});
    controller.observe(engine->state());
    largest = std::max(largest, std::abs(controller.axes()[0].angle));
  }
  return largest;
}

// Oracle: the engine on both sides of the limit, 3 % away from it: 1 mrad stays small, or grows a
// hundredfold.
TEST(Stability, LimitOfExplicitGainsIsWhereTheEngineDiverges) {
  const Eigen::MatrixXd inertia = Eigen::MatrixXd::Constant(1, 1, kInertia);
  for (const double a : {1.999, 1.5, 1.0, 0.3}) {  // a = D h / I at the limit, b = K h^2 / I = 4 - 2 a
    for (const double share : {0.97, 1.03}) {
      const double d = share * a * kInertia / kStep;
      const double k = share * (4 - 2 * a) * kInertia / (kStep * kStep);
      const Stability found = explicit_stability(inertia, Eigen::VectorXd::Constant(1, k),
                                                 Eigen::VectorXd::Constant(1, d), kStep);
      EXPECT_NEAR(found.eigenvalue, 4 * share, 1e-9);
      EXPECT_EQ(found.largest_step<kStep, share> 1);
      if (share < 1)
        EXPECT_LT(excursion(k, d), 0.02) << a;
      else
        EXPECT_GT(excursion(k, d), 0.1) << a;
    }
  }
}

// Oracle: the formula, with the effective inertia of each axis.
TEST(Design, FrequencyAndDampingRatioBecomeGainsOnTheBuiltInertia) {
  const scene::Scene scene = test::shipped_scene("every_pose");
  ASSERT_EQ(scene.control->axes.size(), 40U);
  for (const DrivenAxis& axis : scene.control->axes) {
    const double w = 2 * M_PI * 8;
    EXPECT_NEAR(axis.proportional, axis.inertia * w * w, 1e-12 * axis.proportional);
    EXPECT_NEAR(axis.derivative, 2 * axis.inertia * w, 1e-12 * axis.derivative);
  }
}

TEST(Design, FollowsThePersonsSize) {
  const scene::Scene child =
      test::shipped_scene("every_pose", {"hands.0.person.stature=1.1", "hands.0.person.mass=18"});
  const scene::Scene giant =
      test::shipped_scene("every_pose", {"hands.0.person.stature=2.1", "hands.0.person.mass=140"});
  for (std::size_t i = 0; i < 20; ++i)
    EXPECT_GT(giant.control->axes[i].inertia, 10 * child.control->axes[i].inertia);
}

}  // namespace
}  // namespace handsim::control
