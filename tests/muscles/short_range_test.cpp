// Muscles whose cross-bridges give: a spring for small and fast changes of length, the curve of the speed for
// slow ones, and what a joint does that they hold.
#include <cmath>
#include <complex>
#include <functional>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "engine/models.h"
#include "handsim/engine/articulated/articulated_engine_derivatives.h"
#include "handsim/engine/muscles.h"
#include "handsim/environment/environment.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "scene_files.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::Muscle;

constexpr double kGamma = 23.4;

/// A muscle of one coordinate, with an arm of 1 cm and fibres of their optimal length at zero.
Muscle puller(double arm = 0.01) {
  Muscle out;
  out.name = arm > 0 ? "m" : "n";
  out.path.arms = {{0, {arm}, -4, 4}};
  out.force = 200;
  out.fibre_length = 0.06;
  out.slack_length = 0.2;
  out.length = 0.26;
  out.short_range = kGamma;
  return out;
}

model::Model one_hinge(const std::vector<Muscle>& muscles, double inertia = 6e-6) {
  model::Model model = model::make_model();
  const int child = test::add_body(
      model, test::body("link", 0.02, {inertia, 1e-6, inertia}, {{0, 0, 0}, Quat::Identity()}));
  model::Joint joint;
  joint.name = "hinge";
  joint.child = child;
  joint.axes.push_back({"flexion", Vec3::UnitX(), {}, {}, 0, 0});
  model.joints.push_back(joint);
  model.muscles = muscles;
  return model;
}

/// A muscle at a constant activation, whose joint is moved.
class Moved {
 public:
  Moved(const Muscle& muscle, double h, double activation)
      : model_(one_hinge({muscle})),
        muscles_(model_, test::settings({Effect::muscles}, h, ArticulatedMethod::semi_implicit_euler),
                 [](int, int) { return true; }),
        state_(model::initial_state(model_)),
        h_(h),
        activation_(activation) {
    state_.activation = {activation};
    model::rest_muscles(model_, state_);
    muscles_.reset(state_);
  }
  /// @param rate of the fibres at the end [optimal lengths/s]. @returns the tension at the end [N]
  double step(double rate) {
    const Muscle& muscle = model_.muscles[0];
    muscles_.begin_step(state_.q, state_.u, {&activation_, 1});
    state_.u = {-rate * muscle.fibre_length / muscle.path.arms[0].c[0]};
    state_.q[0] += h_ * state_.u[0];
    muscles_.store_state(state_.q, state_.u, state_);
    return state_.tendon_force[0];
  }
  const model::State& state() const { return state_; }

 private:
  model::Model model_;
  Muscles muscles_;
  model::State state_;
  double h_, activation_;
};

// Oracle: K = gamma F / optimal length, the measured law (Cui 2008). What the contractile part gives in 10 us
// is 10 us over its time of 30 ms.
TEST(ShortRange, IsASpringInProportionToTheForce) {
  for (const double activation : {0.05, 0.3, 1.0})
    for (const double rate : {-0.5, 0.5}) {
      const Muscle muscle = puller();
      Moved moved(muscle, 1e-5, activation);
      const double before = moved.step(0), after = moved.step(rate);
      const double stretched = 1e-5 * rate * muscle.fibre_length;
      EXPECT_NEAR((after - before) / stretched, kGamma * before / muscle.fibre_length,
                  2e-3 * kGamma * before / muscle.fibre_length);
    }
}

// Oracle: the curve of the speed, which hands without cross-bridges have.
TEST(ShortRange, PullsAtAConstantSpeedAsFibresWithout) {
  for (const double activation : {0.1, 0.7})
    for (const double rate : {-1.5, -0.3, 0.2, 0.8}) {
      const Muscle muscle = puller();
      Moved moved(muscle, 1e-4, activation);
      const int steps = 2500;  // 0.25 s: at most 0.4 of the fibres' length
      double tension = 0;
      for (int i = 0; i < steps; ++i) tension = moved.step(rate);
      const double exact =
          model::tension(muscle, 0.01 * moved.state().q[0], rate * muscle.fibre_length, activation).force;
      // 8 times their time has passed at the low activation's slowest.
      EXPECT_NEAR(tension, exact, 0.02 * exact) << activation << " " << rate;
    }
}

/// Stretch of cross-bridges of fibres that swing, by Runge and Kutta's method of order four.
double swung(double activation, double end, const std::function<double(double)>& rate) {
  const double top = 10 * (0.25 + 0.75 * activation);
  const auto slope = [&](double t, double s) {
    const double factor = 1 + kGamma * s;
    const double contractile =
        factor < 1 ? (factor - 1) / (1 + 4 * factor) : (factor - 1) / (35 - 25 * factor);
    return rate(t) - top * contractile;
  };
  double s = 0;
  const int steps = 20000;
  const double h = end / steps;
  for (int i = 0; i < steps; ++i) {
    const double t = i * h, a = slope(t, s), b = slope(t + h / 2, s + h / 2 * a),
                 c = slope(t + h / 2, s + h / 2 * b), d = slope(t + h, s + h * c);
    s += h / 6 * (a + 2 * b + 2 * c + d);
  }
  return s;
}

// Oracle: another integration of the same equation. Backward Euler is first order.
TEST(ShortRange, StretchesAsAFineIntegrationToFirstOrder) {
  const auto rate = [](double t) { return 2 * std::sin(60 * t) + 0.5 * std::cos(170 * t); };
  for (const double activation : {0.05, 0.6}) {
    const double end = 0.08;
    double largest = 0;
    // Sum over four times: at a single one the error may go through zero.
    const auto error = [&](double h) {
      Moved moved(puller(), h, activation);
      double sum = 0;
      for (int i = 1; i <= std::lround(end / h); ++i) {
        moved.step(rate(i * h));
        if (i % std::lround(0.02 / h) != 0) continue;
        const double exact = swung(activation, i * h, rate);
        largest = std::max(largest, std::abs(exact));
        sum += std::abs(moved.state().bridge_stretch[0] - exact);
      }
      return sum;
    };
    const double coarse = error(2e-4), fine = error(1e-4);
    EXPECT_LT(fine, 0.03 * largest);
    EXPECT_NEAR(coarse / fine, 2, 0.1);
  }
}

/// Turning points of a hinge that two muscles hold and a kick moves, in a second.
struct Swing {
  int turns = 0;
  double frequency = 0;  ///< [Hz]
};
Swing kicked(std::optional<double> gamma, std::optional<double> strain, Method method, double h) {
  std::vector<Muscle> muscles = {puller(0.012), puller(-0.012)};
  for (Muscle& each : muscles) {
    each.short_range = gamma;
    each.tendon_strain = strain;
    each.force = 1000;
    each.initial = 0.02;
  }
  const model::Model model = one_hinge(muscles, 3e-3);
  const auto engine = make_engine(model, test::settings({Effect::muscles}, h, method));
  model::State start = model::initial_state(model);
  model::rest_muscles(model, start);
  start.bodies[1].w = {0.05, 0, 0};
  engine->set_state(start);
  const std::vector<double> excitations(2, 0.02);
  StepInput input;
  input.excitations = excitations;
  Swing out;
  double first = 0, last = 0, before = 0;
  for (int i = 1; i <= std::lround(1 / h); ++i) {
    engine->step(input);
    const double rate = engine->state().u[0];
    if (before * rate < 0) {
      last = h * (i - rate / (rate - before));
      if (++out.turns == 1) first = last;
    }
    before = rate;
  }
  if (out.turns > 1) out.frequency = (out.turns - 1) / (2 * (last - first));
  return out;
}

// Oracle: the eigenvalue of a mass on two linear Maxwell elements. For small motion their dashpots are
// between the slopes of shortening and lengthening, which changes the frequency by less than the bound.
TEST(ShortRange, LetsAHeldJointSwing) {
  const double stiffness = 2 * kGamma * 1000 * 0.02 / 0.06 * 0.012 * 0.012, top = 10 * (0.25 + 0.75 * 0.02);
  const double rate = kGamma * top / 7.5;  // of relaxation, between top/5 and top/10
  Eigen::Matrix3d linear;
  linear << 0, 1, 0, 0, 0, -stiffness / 3e-3, 0, 1, -rate;
  double frequency = 0;
  for (const std::complex<double>& value : linear.eigenvalues())
    frequency = std::max(frequency, value.imag() / (2 * 3.14159265358979));
  const Swing swing = kicked(kGamma, {}, ArticulatedMethod::semi_implicit_euler, 1e-4);
  EXPECT_GE(swing.turns, 4);
  EXPECT_NEAR(swing.frequency, frequency, 0.1 * frequency);
  // Without cross-bridges it creeps.
  EXPECT_LE(kicked({}, {}, ArticulatedMethod::semi_implicit_euler, 1e-4).turns, 1);
  // In the other engines, and at the step of scenes.
  for (const Method method : {Method(OdeMethod::world_step), Method(ArticulatedMethod::semi_implicit_euler),
                              Method(DaeMethod::euler_projected)})
    EXPECT_NEAR(kicked(kGamma, {}, method, 1e-3).frequency, swing.frequency, 0.1 * swing.frequency);
  // A tendon in series is softer.
  const double elastic = kicked(kGamma, 0.049, ArticulatedMethod::semi_implicit_euler, 1e-4).frequency;
  EXPECT_LT(elastic, swing.frequency);
  EXPECT_GT(elastic, 0.3 * swing.frequency);
}

TEST(ShortRange, HasNoDerivativesAndSaysSo) {
  const model::Model model = one_hinge({puller()});
  const auto engine =
      make_engine(model, test::settings({Effect::muscles}, 1e-3, ArticulatedMethod::semi_implicit_euler));
  articulated::StepDerivatives out;
  try {
    articulated::derive(*engine, &out);
    engine->step({});
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("short-range stiffness"), std::string::npos) << error.what();
  }
}

TEST(ShortRange, RefusesWhatIsNone) {
  for (const char* bad : {"-1", "0", "stiff"}) try {
      handsim::test::shipped_scene("resting_hand", {std::string("hands.0.short_range_stiffness=") + bad});
      ADD_FAILURE() << bad;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("hands.0.short_range_stiffness"), std::string::npos)
          << error.what();
    }
}

}  // namespace
}  // namespace handsim::engine
