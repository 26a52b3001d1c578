// Muscles with elastic tendons: their equilibrium, their step, and their state.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "engine/models.h"
#include "handsim/engine/muscles.h"
#include "handsim/engine/tendon_kernels.h"
#include "handsim/environment/environment.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"
#include "support/thelen_curves.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::Muscle;

using handsim::test::fibres_at;
using handsim::test::long_flexor;
using handsim::test::resting_tension;
using handsim::test::root;
using handsim::test::tendon_at;

model::Model one_hinge(const Muscle& muscle) {
  model::Model model = model::make_model();
  const int child =
      test::add_body(model, test::body("link", 0.02, {6e-6, 1e-6, 6e-6}, {{0, 0.02, 0}, Quat::Identity()}));
  model::Joint joint;
  joint.name = "hinge";
  joint.child = child;
  joint.child_frame.p = {0, -0.02, 0};
  joint.axes.push_back({"flexion", Vec3::UnitX(), {}, {}, 0, 0});
  model.joints.push_back(joint);
  model.muscles.push_back(muscle);
  return model;
}

/// Steps of a muscle whose joint is held at an angle [rad].
class Held {
 public:
  Held(const Muscle& muscle, double h, double activation, double angle = 0)
      : model_(one_hinge(muscle)),
        muscles_(model_, test::settings({Effect::muscles}, h, ArticulatedMethod::semi_implicit_euler),
                 [](int, int) { return true; }),
        state_(model::initial_state(model_)) {
    state_.q = {angle};
    state_.activation = {activation};
    model::rest_muscles(model_, state_);
    muscles_.reset(state_);
  }
  /// Tension at the end [N].
  double step(double excitation) {
    muscles_.begin_step(state_.q, state_.u, {&excitation, 1});
    muscles_.store_state(state_.q, state_.u, state_);
    return state_.tendon_force[0];
  }
  const model::State& state() const { return state_; }

 private:
  model::Model model_;
  Muscles muscles_;
  model::State state_;
};

// Oracle: what a muscle tends to is its rest, which bisection finds.
TEST(ElasticTendon, ComesToRestInEquilibrium) {
  for (const double h : {1e-3, 5e-3})
    for (const double angle : {-1.0, 0.0, 2.0}) {
      Held held(long_flexor(0.049), h, 0.02, angle);
      double tension = 0;
      for (int i = 0; i < 2000; ++i) tension = held.step(0.4);
      const double activation = held.state().activation[0];
      EXPECT_NEAR(tension, resting_tension(long_flexor(0.049), 0.01 * angle, activation), 1e-9 * 200);
    }
}

/// Tension after a rise of the excitation from 0.05 to 1, by Runge and Kutta's method of order four; the
/// speed of the fibres by bisection.
double risen(const Muscle& m, double end) {
  const double taut = m.length - m.slack_length, top_speed = m.max_speed;
  const auto speed = [&](double reach, double a) {
    const double length = std::hypot(m.fibre_length * std::sin(m.pennation), reach);
    const double top = (0.25 + 0.75 * a) * top_speed, cosine = reach / length;
    const double active = fibres_at(m, reach, a) - fibres_at(m, reach, 0);
    const double passive = fibres_at(m, reach, 0), tension = tendon_at(m, taut - reach);
    const double x = root(-top, top, [&](double v) {
      const double w = v / top, factor = w < 0 ? (1 + w) / (1 - 4 * w) : (1 + 35 * w) / (1 + 25 * w);
      return active * factor + passive * (1 + 0.1 * v / top_speed) - tension;
    });
    return x * m.fibre_length / cosine;
  };
  const auto slopes = [&](const std::array<double, 2>& y) {
    return std::array<double, 2>{speed(y[0], y[1]), (1 - y[1]) / (m.activation_time * (0.5 + 1.5 * y[1]))};
  };
  std::array<double, 2> y = {
      root(1e-4, taut, [&](double w) { return fibres_at(m, w, 0.05) - tendon_at(m, taut - w); }), 0.05};
  const int steps = 2000;
  const double h = end / steps;
  const auto beyond = [&](const std::array<double, 2>& by, double much) {
    return std::array<double, 2>{y[0] + much * by[0], y[1] + much * by[1]};
  };
  for (int i = 0; i < steps; ++i) {
    const auto a = slopes(y), b = slopes(beyond(a, h / 2)), c = slopes(beyond(b, h / 2)),
               d = slopes(beyond(c, h));
    for (std::size_t k = 0; k < 2; ++k) y[k] += h / 6 * (a[k] + 2 * b[k] + 2 * c[k] + d[k]);
  }
  return tendon_at(m, taut - y[0]);
}

// Oracle: another integration of the same equations, with an error below 1e-6 N. Backward Euler is first
// order.
TEST(ElasticTendon, RisesAsAFineIntegrationToFirstOrder) {
  const Muscle m = long_flexor(0.049);
  const double end = 0.04, exact = risen(m, end);
  const auto error = [&](double h) {
    Held held(m, h, 0.05);
    double tension = 0;
    for (int i = 0; i < std::lround(end / h); ++i) tension = held.step(1);
    return std::abs(tension - exact);
  };
  const double coarse = error(2e-4), fine = error(1e-4);
  EXPECT_LT(fine, 0.01 * exact);
  EXPECT_NEAR(coarse / fine, 2, 0.1);
}

// Oracle: a rigid tendon. What a tendon stretches by, and with it the difference, goes with its strain.
TEST(ElasticTendon, TendsToTheRigidOne) {
  Muscle rigid = long_flexor(0.049);
  rigid.tendon_strain.reset();
  const auto difference = [&](double strain) {
    Held elastic(long_flexor(strain), 1e-3, 0.05, 0.5), stiff(rigid, 1e-3, 0.05, 0.5);
    double worst = 0;
    for (int i = 0; i < 100; ++i) worst = std::max(worst, std::abs(elastic.step(0.8) - stiff.step(0.8)));
    return worst;
  };
  const double coarse = difference(1e-5), fine = difference(1e-6);
  EXPECT_LT(fine, 0.03);
  EXPECT_NEAR(coarse / fine, 10, 0.5);
}

/// Angle of a hinge that a muscle moves for 50 ms.
double moved(std::optional<double> strain, Method method, double h) {
  Muscle muscle = long_flexor(0.049);
  muscle.tendon_strain = strain;
  const model::Model model = one_hinge(muscle);
  const auto engine = make_engine(model, test::settings({Effect::muscles}, h, method));
  const double excitation = 0.3;
  StepInput input;
  input.excitations = {&excitation, 1};
  for (int i = 0; i < std::lround(0.05 / h); ++i) engine->step(input);
  return engine->state().q[0];
}

// Oracle: of a joint that moves, the rigid tendon again; a step of 10 us, of which either has its own error.
TEST(ElasticTendon, MovesAJointAsTheRigidOneWhereItIsStiff) {
  const auto difference = [rigid = moved({}, ArticulatedMethod::semi_implicit_euler, 1e-5)](double strain) {
    return std::abs(moved(strain, ArticulatedMethod::semi_implicit_euler, 1e-5) / rigid - 1);
  };
  EXPECT_LT(difference(1e-3), 0.003);
  EXPECT_GT(difference(1e-2) / difference(1e-3), 5);
}

// Oracle: all engines go to the same motion as the step goes to zero, at first order; the reference is the
// articulated engine at 2 us.
TEST(ElasticTendon, MovesAJointTheSameInEveryEngine) {
  const double exact = moved(0.049, ArticulatedMethod::semi_implicit_euler, 2e-6);
  for (const Method method : {Method(ArticulatedMethod::semi_implicit_euler), Method(OdeMethod::world_step),
                              Method(DaeMethod::euler_projected)}) {
    const double coarse = std::abs(moved(0.049, method, 1e-4) - exact);
    const double fine = std::abs(moved(0.049, method, 5e-5) - exact);
    EXPECT_LT(fine, 0.005 * exact) << method.index();
    EXPECT_GT(coarse / fine, 1.7) << method.index();
  }
}

// Oracle: bits of all kernels; and fibres that carry nothing shorten by ten optimal lengths a second at most.
class ElasticBits : public testing::TestWithParam<bool> {};
TEST_P(ElasticBits, AreTheSameAtEveryWidth) {
  const bool bridged = GetParam();
  std::mt19937 random(3);
  std::uniform_real_distribution<double> number(0, 1);
  const model::Model model =
      handsim::test::shipped_scene(
          "resting_hand",
          {"hands.0.model=" + handsim::test::source("handmodels/anatomical.yaml").string(),
           "effects=[muscles]", bridged ? "hands.0.short_range_stiffness=23.4" : "title=rigid",
           "hands.0.tendon_strain=0.049"})
          .model;
  const Settings all = test::settings({Effect::muscles}, 1e-3, ArticulatedMethod::semi_implicit_euler);
  for (int sample = 0; sample < 20; ++sample) {
    model::State start = model::initial_state(model);
    for (double& q : start.q) q = 2 * number(random) - 0.5;
    std::vector<double> excitations;
    for (double& a : start.activation) {
      a = number(random) < 0.3 ? 0 : number(random);
      excitations.push_back(number(random));
    }
    model::rest_muscles(model, start);
    for (double& u : start.u) u = 20 * number(random) - 10;
    std::optional<model::State> first;
    for (const TendonKernel* kernel : tendon_kernels()) {
      Muscles muscles(
          model, all, [](int a, int b) { return a == b; }, kernel);
      model::State state = start;
      muscles.reset(state);
      for (int step = 0; step < 3; ++step) {
        muscles.begin_step(state.q, state.u, excitations);
        for (double& u : state.u) u *= 0.9;
        muscles.store_state(state.q, state.u, state);
      }
      if (!first) first = state;
      EXPECT_EQ(state.fibre_length, first->fibre_length) << kernel->name;
      EXPECT_EQ(state.tendon_force, first->tendon_force) << kernel->name;
      EXPECT_EQ(state.bridge_stretch, first->bridge_stretch) << kernel->name;
    }
    for (std::size_t m = 0; m < model.muscles.size(); ++m) {
      const Muscle& muscle = model.muscles[m];
      const double shorter = first->fibre_length[m] - start.fibre_length[m];
      EXPECT_GE(first->tendon_force[m], 0);
      if (first->tendon_force[m] > 0) continue;
      EXPECT_GE(shorter, -3e-3 * 10.01 * muscle.fibre_length) << m;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Bridges, ElasticBits, testing::Bool());

scene::Scene muscled(const std::string& engine, bool elastic = true, bool bridged = false) {
  return handsim::test::shipped_scene(
      "resting_hand", {"hands.0.model=" + handsim::test::source("handmodels/anatomical.yaml").string(),
                       "effects=[gravity, joint_stops, passive_tissue, muscles, tendon_coupling]",
                       elastic ? "hands.0.tendon_strain=0.049" : "title=rigid",
                       bridged ? "hands.0.short_range_stiffness=23.4" : "title=no bridges",
                       "solver=" + engine, "excitations={times: [0, 0.05], FDP2: [0, 0.8], EDC2: [0.3, 0]}"});
}

class ElasticState : public testing::TestWithParam<const char*> {};

// Oracle: bits. A run that goes on from a snapshot, and one from a state, are the one that was not stopped.
TEST_P(ElasticState, GoesOnWithTheSameBits) {
  const scene::Scene scene = muscled(GetParam());
  simulation::Simulation whole(scene), first(scene), second(scene);
  for (int i = 0; i < 60; ++i) whole.step();
  for (int i = 0; i < 33; ++i) first.step();
  second.restore(first.snapshot());
  for (int i = 33; i < 60; ++i) second.step();
  EXPECT_EQ(second.state().fibre_length, whole.state().fibre_length);
  EXPECT_EQ(second.state().q, whole.state().q);
  EXPECT_EQ(second.state_hash(), whole.state_hash());
  // Tendons do stretch.
  const model::Model& model = scene.model;
  double stretch = 0;
  for (std::size_t m = 0; m < model.muscles.size(); ++m) {
    const double excursion = model::path_state(model.muscles[m].path, whole.state().q).excursion;
    stretch = std::max(stretch,
                       model::fibre_at(model.muscles[m], excursion).length - whole.state().fibre_length[m]);
  }
  EXPECT_GT(stretch, 1e-3);
}

// Oracle: bits, as above, of rigid and of elastic tendons with cross-bridges, which do stretch.
TEST_P(ElasticState, GoesOnWithCrossBridgesWithTheSameBits) {
  for (const bool elastic : {false, true}) {
    const scene::Scene scene = muscled(GetParam(), elastic, true);
    simulation::Simulation whole(scene), first(scene), second(scene);
    for (int i = 0; i < 60; ++i) whole.step();
    for (int i = 0; i < 33; ++i) first.step();
    second.restore(first.snapshot());
    for (int i = 33; i < 60; ++i) second.step();
    EXPECT_EQ(second.state().bridge_stretch, whole.state().bridge_stretch);
    EXPECT_EQ(second.state().q, whole.state().q);
    EXPECT_EQ(second.state_hash(), whole.state_hash());
    EXPECT_GT(std::abs(std::ranges::max(whole.state().bridge_stretch)), 1e-4);
  }
}

INSTANTIATE_TEST_SUITE_P(Engines, ElasticState,
                         testing::Values("{engine: articulated, method: semi_implicit_euler, step: 0.001}",
                                         "{engine: ode, method: world_step, step: 0.001}",
                                         "{engine: ode, method: quick_step, step: 0.001}"));

// Oracle: bits of two resets of one environment.
TEST(ElasticTendon, StartsAgainWithTheSameBits) {
  environment::Environment env(muscled("{engine: articulated, method: semi_implicit_euler, step: 0.001}"));
  std::vector<double> fibres[2];
  for (auto& each : fibres) {
    env.reset();
    env.step({}, 40);
    each = env.simulation().state().fibre_length;
  }
  EXPECT_EQ(fibres[0], fibres[1]);
}

TEST(ElasticTendon, RefusesStrainsThatAreNone) {
  for (const char* bad : {"-0.01", "0", "0.6", "stiff"}) try {
      handsim::test::shipped_scene("resting_hand", {std::string("hands.0.tendon_strain=") + bad});
      ADD_FAILURE() << bad;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("hands.0.tendon_strain"), std::string::npos) << error.what();
    }
}

}  // namespace
}  // namespace handsim::engine
