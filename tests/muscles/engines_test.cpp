// Muscles in the engines: the step's law, stability on stiff muscles, and bits.
#include <cmath>
#include <cstdio>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "engine/models.h"
#include "handsim/engine/muscles.h"
#include "handsim/engine/tendon_kernels.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::engine {
namespace {

using model::Effect;
using test::settings;

/// Two links in a plane without gravity, and a tendon across both joints.
model::Model two_links() {
  model::Model model = model::make_model();
  const auto add = [&](const std::string& name, int parent, double y) {
    const int child = test::add_body(
        model, test::body(name, 0.02, {6e-6, 1e-6, 6e-6}, {{0, y + 0.02, 0}, Quat::Identity()}));
    model::Joint joint;
    joint.name = name + "_joint";
    joint.parent = parent;
    joint.child = child;
    joint.parent_frame.p = {0, parent == model::kWorld ? 0.0 : 0.02, 0};
    joint.child_frame.p = {0, -0.02, 0};
    joint.axes.push_back({"flexion", Vec3::UnitX(), {}, {}, 0, 0});
    joint.first_dof = model.dof_count();
    model.joints.push_back(joint);
  };
  add("first", model::kWorld, 0);
  add("second", 1, 0.04);
  model::Muscle muscle;
  muscle.name = "m";
  muscle.path.arms = {{0, {0.012}, -4, 4}, {1, {0.007}, -4, 4}};
  muscle.force = 150;
  muscle.fibre_length = 0.06;
  muscle.slack_length = 0.2;
  muscle.length = 0.265;
  model.muscles.push_back(muscle);
  return model;
}

Settings with(Method method, double step) { return settings({Effect::muscles}, step, method); }

/// H of the two links, in closed form: planar links of mass m with the centre at l/2.
Eigen::Matrix2d inertia(double q2) {
  const double m = 0.02, l = 0.04, c = 0.02, I = 6e-6;
  Eigen::Matrix2d H;
  H(1, 1) = I + m * c * c;
  H(0, 1) = H(1, 0) = H(1, 1) + m * l * c * std::cos(q2);
  H(0, 0) = 2 * I + m * c * c + m * (l * l + c * c + 2 * l * c * std::cos(q2));
  return H;
}

// Oracle: the law of engine/muscles.h for the first step from rest, solved densely beside it:
// (H + h B) u = h r F(l, 0, a), B = (h k + d) r r^T.
TEST(MusclesInEngines, TheArticulatedStepSolvesTheCoupledLaw) {
  const model::Model model = two_links();
  for (const double h : {1e-3, 5e-3}) {
    const auto engine = make_engine(model, with(ArticulatedMethod::semi_implicit_euler, h));
    const double excitation = 0.9;
    StepInput input;
    input.excitations = {&excitation, 1};
    engine->step(input);
    const model::Muscle& m = model.muscles[0];
    const double a = model::next_activation(m, 0, excitation, h);
    const model::Tension at = model::tension(m, 0, 0, a);
    const Eigen::Vector2d r(0.012, 0.007);
    const Eigen::Matrix2d A =
        inertia(0) + h * (h * std::max(0.0, at.stiffness) + at.damping) * r * r.transpose();
    const Eigen::Vector2d u = A.ldlt().solve(h * at.force * r);
    const model::State& state = engine->state();
    EXPECT_NEAR(state.u[0], u[0], 1e-9 * u.norm());
    EXPECT_NEAR(state.u[1], u[1], 1e-9 * u.norm());
    EXPECT_EQ(state.activation[0], a);
    // The torques that acted are the tension's at the step's end.
    EXPECT_NEAR(state.tau[0], r[0] * state.tendon_force[0], 1e-9);
    EXPECT_NEAR(state.tau[1], r[1] * state.tendon_force[0], 1e-9);
    EXPECT_NEAR((inertia(0) * u / h - r * state.tendon_force[0]).norm(), 0, 1e-9);
  }
}

/// Torques and B of a step's start.
struct Start {
  Eigen::VectorXd torques;
  Eigen::MatrixXd B;
};

Start start_of(const model::Model& model, Muscles& muscles, const model::State& state,
               const std::vector<double>& excitations) {
  muscles.reset(state);
  muscles.begin_step(state.q, state.u, excitations);
  const auto n = static_cast<Eigen::Index>(model.dof_count());
  Start out = {Eigen::VectorXd(n), Eigen::MatrixXd::Zero(n, n)};
  for (Eigen::Index i = 0; i < n; ++i) out.torques[i] = muscles.torques()[static_cast<std::size_t>(i)];
  for (const Muscles::Slope& each : muscles.slopes()) out.B(each.row, each.column) = each.value;
  return out;
}

/// The law of engine/muscles.h, one tendon at a time.
Start law(const model::Model& model, double h, const TendonLayout::Solves& solves, const model::State& state,
          const std::vector<double>& excitations) {
  const auto n = static_cast<Eigen::Index>(model.dof_count());
  Start out = {Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n)};
  const auto add = [&](const model::TendonPath& path, const auto& pull) {
    const model::PathState at = model::path_state(path, state.q);
    double rate = 0;
    for (std::size_t i = 0; i < path.arms.size(); ++i)
      rate -= at.arm[i] * state.u[static_cast<std::size_t>(path.arms[i].dof)];
    const auto [force, slope] = pull(at.excursion, rate);
    for (std::size_t i = 0; i < path.arms.size(); ++i) {
      const int a = path.arms[i].dof;
      out.torques[a] += at.arm[i] * force;
      out.B(a, a) += at.arm[i] * at.arm[i] * slope + h * std::max(0.0, -at.bend[i] * force);
      for (std::size_t j = 0; j < i; ++j) {
        const int b = path.arms[j].dof;
        const double entry = at.arm[i] * at.arm[j] * slope;
        if (solves(a, b)) {
          out.B(std::max(a, b), std::min(a, b)) += entry;
        } else {
          out.B(a, a) += std::abs(entry);
          out.B(b, b) += std::abs(entry);
        }
      }
    }
  };
  for (std::size_t m = 0; m < model.muscles.size(); ++m)
    add(model.muscles[m].path, [&](double excursion, double rate) {
      const model::Muscle& muscle = model.muscles[m];
      const double a = model::next_activation(muscle, state.activation[m], excitations[m], h);
      const model::Tension found = model::tension(muscle, excursion, rate, a);
      return std::pair(std::max(0.0, found.force + h * found.stiffness * rate),
                       h * std::max(0.0, found.stiffness) + found.damping);
    });
  for (const model::Band& band : model.bands)
    add(band.path, [&](double excursion, double rate) {
      const double then = -excursion - band.rest + h * rate;
      const bool slack = !band.both_ways && then <= 0;
      const double force = slack ? 0 : band.stiffness * then + band.damping * rate;
      return std::pair(band.both_ways ? force : std::max(0.0, force),
                       slack ? 0 : h * band.stiffness + band.damping);
    });
  return out;
}

model::Model muscled_hand(const std::string& mount) {
  return handsim::test::shipped_scene(
             "resting_hand", {"hands.0.model=" + handsim::test::source("handmodels/anatomical.yaml").string(),
                              "effects=[muscles, tendon_coupling]", "hands.0.wrist={mount: " + mount + "}"})
      .model;
}

// Oracle: the law, one tendon at a time, at angles within and beyond the ranges of the arms: sums in another
// order differ by rounding. All kernels have the same bits.
TEST(TendonLanes, AddUpTheLawWithTheSameBitsAtEveryWidth) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> number(0, 1);
  for (const char* mount : {"fixed", "universal"})
    for (const bool diagonal : {false, true}) {
      const model::Model model = muscled_hand(mount);
      const TendonLayout::Solves solves = [&](int a, int b) {
        return a == b || (!diagonal && a / 6 == b / 6);
      };
      const Settings all =
          settings({Effect::muscles, Effect::tendon_coupling}, 1e-3, ArticulatedMethod::semi_implicit_euler);
      for (int sample = 0; sample < 20; ++sample) {
        model::State state = model::initial_state(model);
        for (double& q : state.q) q = 3 * number(random) - 1;
        for (double& u : state.u) u = 20 * number(random) - 10;
        std::vector<double> excitations;
        for (double& a : state.activation) {
          a = number(random);
          excitations.push_back(number(random));
        }
        const Start expected = law(model, all.step, solves, state, excitations);
        std::optional<Start> first;
        for (const TendonKernel* kernel : tendon_kernels()) {
          Muscles muscles(model, all, solves, kernel);
          const Start found = start_of(model, muscles, state, excitations);
          if (!first) first = found;
          EXPECT_EQ(found.torques, first->torques) << kernel->name;
          EXPECT_EQ(found.B, first->B) << kernel->name;
          EXPECT_LT((found.torques - expected.torques).norm(), 1e-13 * expected.torques.norm());
          EXPECT_LT((found.B - expected.B).norm(), 1e-13 * expected.B.norm());
        }
      }
    }
}

// Oracle: all engines go to the same motion as the step goes to zero, at first order. The reference is the
// articulated engine at 5 us. The others bound B on the diagonal and lag by an inertia of h times its row
// sums: after 20 ms by 0.017 rad at 50 us, with links as light as fingertips.
TEST(MusclesInEngines, ConvergeToTheSameMotion) {
  const model::Model model = two_links();
  const auto after = [&](Method method, double h) {
    const auto engine = make_engine(model, with(method, h));
    const double excitation = 0.05;
    StepInput input;
    input.excitations = {&excitation, 1};
    for (int i = 0; i < std::lround(0.02 / h); ++i) engine->step(input);
    return Eigen::Vector2d(engine->state().q[0], engine->state().q[1]);
  };
  const Eigen::Vector2d exact = after(ArticulatedMethod::semi_implicit_euler, 5e-6);
  for (const Method method : {Method(ArticulatedMethod::semi_implicit_euler), Method(OdeMethod::world_step),
                              Method(DaeMethod::euler_projected)}) {
    const double coarse = (after(method, 1e-4) - exact).norm(), fine = (after(method, 5e-5) - exact).norm();
    EXPECT_LT(fine, std::holds_alternative<ArticulatedMethod>(method) ? 5e-4 : 0.02) << method.index();
    EXPECT_GT(coarse / fine, 1.6) << method.index();
  }
}

constexpr const char* kAll = "effects=[gravity, joint_stops, passive_tissue, muscles, tendon_coupling]";

/// The largest rate [rad/s] over a run of a hand whose muscles are switched on and off in steps.
double largest_rate(const std::string& person, const std::string& engine, double step,
                    const std::string& tendons) {
  const scene::Scene scene = handsim::test::shipped_scene(
      "resting_hand",
      {"hands.0.model=" + handsim::test::source("handmodels/anatomical.yaml").string(),
       "hands.0.person=" + (person == "newborn"
                                ? "{stature: 0.5, mass: 3.5, sex: male, age: 1}"
                                : handsim::test::source("config/persons/" + person + ".yaml").string()),
       "solver={engine: " + engine + ", step: " + std::to_string(step) + "}", kAll, tendons,
       "hands.0.wrist={mount: universal}"});
  simulation::Simulation run(scene, simulation::no_watchers);
  std::mt19937 random(7);
  std::vector<double> excitations(scene.model.muscles.size());
  double largest = 0;
  for (double time = 0; time < 0.6; time += step) {
    // Steps from none to all every 50 ms: the fastest that activation can be asked for.
    if (std::fmod(time, 0.05) < step)
      for (double& each : excitations) each = random() % 3 == 0 ? 1 : 0;
    StepInput input;
    input.excitations = excitations;
    run.step(input);
    for (const double u : run.state().u) largest = std::max(largest, std::abs(u));
    for (const double force : run.state().tendon_force) EXPECT_TRUE(std::isfinite(force) && force >= 0);
  }
  return largest;
}

// Oracle: muscles cannot move a joint faster than they shorten: 10 fibre lengths a second over the smallest
// arm, 0.75 m/s over 2 mm, is 375 rad/s; a step that is not stable passes that within some steps.
class StableMuscles
    : public testing::TestWithParam<std::tuple<const char*, double, const char*, const char*>> {};

TEST_P(StableMuscles, KeepJointsWithinWhatMusclesCanShorten) {
  const auto& [engine, step, person, tendons] = GetParam();
  EXPECT_LT(largest_rate(person, engine, step, tendons), 375);
}

constexpr const char* kRigidTendons = "hands.0.tissue.stiffness=1";  // the default: nothing changes
constexpr const char* kElastic = "hands.0.tendon_strain=0.049";
constexpr const char* kNearlyRigid = "hands.0.tendon_strain=0.0001";

INSTANTIATE_TEST_SUITE_P(Articulated, StableMuscles,
                         testing::Combine(testing::Values("articulated, method: semi_implicit_euler"),
                                          testing::Values(1e-3, 5e-3),
                                          testing::Values("median_man", "child", "giant", "newborn"),
                                          testing::Values(kRigidTendons, kElastic, kNearlyRigid)));
INSTANTIATE_TEST_SUITE_P(
    Ode, StableMuscles,
    testing::Combine(testing::Values("ode, method: world_step", "ode, method: quick_step"),
                     testing::Values(1e-3), testing::Values("median_man", "child", "giant", "newborn"),
                     testing::Values(kRigidTendons, kElastic)));

/// Angles after 0.3 s at random excitations. @param factor on the first excitation
std::vector<double> angles_of(const std::string& side, const std::string& engine, const std::string& contact,
                              double factor = 1) {
  const scene::Scene scene = handsim::test::shipped_scene(
      "resting_hand",
      {"hands.0={side: " + side +
           ", wrist: {mount: fixed}, model: " + handsim::test::source("handmodels/anatomical.yaml").string() +
           ", person: " + handsim::test::source("config/persons/median_man.yaml").string() + "}",
       "effects=[gravity, joint_stops, passive_tissue, muscles, tendon_coupling" + contact + "]",
       "solver={engine: " + engine + ", step: 1 ms}"});
  simulation::Simulation run(scene, simulation::no_watchers);
  std::mt19937 random(5);
  std::vector<double> excitations(scene.model.muscles.size());
  for (int i = 0; i < 300; ++i) {
    if (i % 5 == 0)
      for (double& each : excitations) each = static_cast<double>(random() % 1000) / 1000;
    if (i == 0) excitations[0] = 0.5 * factor;
    run.step({.excitations = excitations});
  }
  return run.state().q;
}

double apart(const std::vector<double>& a, const std::vector<double>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

// Oracle: symmetry. Engine ode rounds the two hands differently, about 1e-16 in each of 300 steps; friction
// between its fingers makes any rounding grow, that of one hand as that of two: printed, not judged.
TEST(MirroredHands, StayMirrorImages) {
  const std::string fingers = ", self_contact", friction = ", self_contact, friction";
  for (const std::string& contact : {std::string(), fingers, friction})
    EXPECT_EQ(angles_of("right", "articulated", contact), angles_of("left", "articulated", contact));
  for (const std::string& contact : {std::string(), fingers})
    EXPECT_LT(apart(angles_of("right", "ode", contact), angles_of("left", "ode", contact)), 1e-12);
  const std::vector<double> right = angles_of("right", "ode", friction);
  std::printf("friction on ode: left and right %.0e rad apart, the right hand of itself %.0e\n",
              apart(right, angles_of("left", "ode", friction)),
              apart(right, angles_of("right", "ode", friction, 1 + 4e-16)));
}

}  // namespace
}  // namespace handsim::engine
