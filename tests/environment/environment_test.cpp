// An environment against the simulation that it is, closed forms of what acts on it, and the scene compiled
// with the numbers that it was given.
#include "handsim/environment/environment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "handsim/core/index.h"
#include "handsim/environment/batch.h"
#include "handsim/model/kinematics.h"
#include "scene_files.h"
#include "support/state_bits.h"

namespace handsim::environment {
namespace {

using test::bits;
using test::shipped_scene;

const std::vector<std::string> kArticulated = {"solver={engine: articulated, step: 1 ms}"};
const std::vector<std::string> kOde = {"solver={engine: ode, method: world_step, step: 1 ms}"};

void steps(Environment& environment, int count, const Action& action = {}) {
  for (int i = 0; i < count; ++i) environment.step(action);
}

class OnEngine : public testing::TestWithParam<std::vector<std::string>> {
 protected:
  scene::Scene scene(const std::string& name, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), GetParam().begin(), GetParam().end());
    return shipped_scene(name, more);
  }
};
INSTANTIATE_TEST_SUITE_P(Engines, OnEngine, testing::Values(kArticulated, kOde),
                         [](const auto& engine) { return engine.index == 0 ? "articulated" : "ode"; });

TEST_P(OnEngine, MovesAsTheSimulationAndComesBackToTheBit) {
  for (const char* name : {"dropped_hand", "every_pose"}) {
    const scene::Scene scene = this->scene(name);
    simulation::Simulation simulation(scene, simulation::no_watchers);
    Environment environment(scene);
    for (int round = 0; round < 2; ++round) {
      steps(environment, 150 + 100 * round);
      if (round == 1) environment.step({}, 3);
      environment.reset();
    }
    for (int i = 0; i < 200; ++i) simulation.step();
    environment.step({}, 200);
    EXPECT_EQ(bits(environment), bits(simulation.state())) << name;
    const simulation::MotionSnapshot moment = environment.motion();
    steps(environment, 50);
    Environment other(scene);
    other.reset(moment);
    steps(other, 50);
    EXPECT_EQ(bits(environment), bits(other)) << name;
    EXPECT_EQ(environment.steps(), 250);
  }
}

TEST_P(OnEngine, StartsWhereItIsTold) {
  Environment environment(scene("dropped_hand"));
  const auto dofs = static_cast<std::size_t>(environment.scene().model.dof_count());
  std::vector<double> q(dofs), u(dofs);
  for (std::size_t i = 0; i < dofs; ++i)
    q[i] = 0.05 + 0.001 * static_cast<double>(i), u[i] = 0.1 * std::sin(i);
  const std::vector<Pose> objects = {{{0.3, 0.2, 0.5}, rotation_quaternion({0.1, 0.2, 0.3})},
                                     {{-0.3, 0.2, 0.4}, Quat::Identity()}};
  environment.reset(Start{q, u, objects});
  const model::State& state = environment.simulation().state();
  for (std::size_t i = 0; i < dofs; ++i) {
    EXPECT_NEAR(state.q[i], q[i], 1e-12);
    EXPECT_NEAR(state.u[i], u[i], 1e-12);
  }
  for (const model::Joint& joint : environment.scene().model.joints)
    EXPECT_LT(model::joint_gap(joint, state), 1e-14);
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const auto& bodies = environment.scene().model.bodies;
    const std::size_t body = bodies.size() - objects.size() + i;
    EXPECT_LT((state.bodies[body].p - objects[i].p).norm(), 1e-15) << bodies[body].name;
  }
  EXPECT_EQ(state.time, 0);
}

// Oracle: v = F t / m and w = M t / I of a sphere; nothing else acts.
TEST_P(OnEngine, ForcesMoveAFreeBody) {
  Environment environment(scene("dropped_hand", {"effects=[joint_stops]", "objects.0.velocity=[0, 0, 0]"}));
  const auto& bodies = environment.scene().model.bodies;
  const int ball = static_cast<int>(bodies.size()) - 2;
  ASSERT_EQ(bodies[static_cast<std::size_t>(ball)].name, "ball");
  const Vec3 force(0.01, -0.02, 0.03), moment(1e-5, 2e-5, -1e-5);
  const std::vector<engine::BodyForce> forces = {{ball, 0.5 * force, moment},
                                                 {ball, 0.5 * force, Vec3::Zero()}};
  steps(environment, 100, {.forces = forces});
  const model::BodyState& state = environment.simulation().state().bodies[static_cast<std::size_t>(ball)];
  const model::Body& body = bodies[static_cast<std::size_t>(ball)];
  EXPECT_LT((state.v - 0.1 / body.mass * force).norm(), 1e-12);
  EXPECT_LT((state.w - 0.1 / body.inertia(0, 0) * moment).norm(), 1e-9 * state.w.norm());
  // The next step without them keeps the velocity.
  const Vec3 v = state.v;
  environment.step();
  EXPECT_LT((environment.simulation().state().bodies[static_cast<std::size_t>(ball)].v - v).norm(), 1e-15);
}

// Oracle: momentum. A hand that spins at 50 rad/s, at which the engine watches energy and momentum, gains
// what a force gives it.
TEST(BodyForces, MoveAHandThatSpinsFast) {
  scene::Scene scene =
      shipped_scene("dropped_hand", {"solver={engine: articulated, step: 1 ms}", "effects=[joint_stops]"});
  Environment environment(scene);
  model::State state = environment.simulation().state();
  for (const int body : scene.model.hands[0].bodies) {
    model::BodyState& each = state.bodies[static_cast<std::size_t>(body)];
    each.w = Vec3(0, 0, 50);
    each.v = each.w.cross(each.p);
  }
  simulation::Simulation simulation(scene, simulation::no_watchers);
  simulation.reset(state);
  const auto momentum = [&] {
    Vec3 out = Vec3::Zero();
    for (const int body : scene.model.hands[0].bodies)
      out += scene.model.bodies[static_cast<std::size_t>(body)].mass *
             simulation.state().bodies[static_cast<std::size_t>(body)].v;
    return out;
  };
  const Vec3 before = momentum(), force(3, 0, 20);
  const std::vector<engine::BodyForce> forces = {{scene.model.hands[0].palm, force, Vec3::Zero()}};
  for (int i = 0; i < 50; ++i) simulation.step({.forces = forces});
  EXPECT_LT((momentum() - before - 0.05 * force).norm(), 0.1 * 0.05 * force.norm());
}

// Oracle: the principle of virtual work. A force on a segment moves the hand as the torques J^T f do.
TEST(BodyForces, MoveAFingerAsTheirTorquesDo) {
  const scene::Scene scene = shipped_scene("two_hands", {"solver={engine: articulated, step: 1 ms}"});
  const model::Model& model = scene.model;
  const auto dofs = static_cast<std::size_t>(model.dof_count());
  const auto body_index = [&](const std::string& name) {
    for (std::size_t i = 0; i < model.bodies.size(); ++i)
      if (model.bodies[i].name == name) return static_cast<int>(i);
    return -1;
  };
  const int tip = body_index("right.index_distal");
  ASSERT_GT(tip, 0);
  const Vec3 force(0.1, 0.3, -0.2);
  Environment by_force(scene), by_torque(scene);
  const model::State start = by_force.simulation().state();
  std::vector<double> torques(dofs);
  for (std::size_t i = 0; i < dofs; ++i) {
    // Column of the Jacobian: the tip's velocity at unit rate of one coordinate.
    std::vector<double> u(dofs);
    u[i] = 1;
    model::State moving = start;
    model::place_joints(model, start.q, u, moving);
    torques[i] = moving.bodies[static_cast<std::size_t>(tip)].v.dot(force);
  }
  const std::vector<engine::BodyForce> forces = {{tip, force, Vec3::Zero()}};
  by_force.step({.forces = forces});
  by_torque.step({.torques = torques});
  const auto& a = by_force.simulation().state().u;
  const auto& b = by_torque.simulation().state().u;
  for (std::size_t i = 0; i < dofs; ++i) EXPECT_NEAR(a[i], b[i], 1e-11) << i;
}

// Oracle: the scene's own motion, given as targets step by step; and a closed form at constant velocity.
TEST_P(OnEngine, WristsGoWhereTheyAreTold) {
  const scene::Scene scene = this->scene("pose_tracking", {"duration=60 s"});
  Environment own(scene), told(scene);
  // Where the wrists swing.
  const double h = scene.spec.solver.step;
  for (int i = 0; i < 100; ++i) {
    std::vector<Pose> targets;
    for (const model::Drive& drive : scene.model.drives) targets.push_back(drive.motion.at((i + 1) * h));
    own.step();
    told.step({.wrists = targets});
  }
  EXPECT_EQ(bits(own), bits(told));
  const std::vector<model::PoseRate> rates = {{{0.1, 0, 0.05}, {0, 0.3, 0}}, {{0, 0, 0}, {0.1, 0, 0}}};
  const Pose before = told.simulation().state().bodies[1].pose();
  const model::Drive& drive = scene.model.drives[0];
  const Pose start = before * drive.frame;
  told.step({.wrist_rates = rates}, 50);
  const Pose end = told.simulation().state().bodies[1].pose() * drive.frame;
  EXPECT_LT((end.p - start.p - 50 * h * rates[0].v).norm(), 1e-12);
  EXPECT_LT((rotation_vector(end.q * start.q.conjugate()) - 50 * h * rates[0].w).norm(), 1e-9);
}

// Oracle: the controller's own law: at rest on the targets no driven axis errs.
TEST(Angles, AreHeldByTheScenesController) {
  Environment environment(shipped_scene("every_pose", {"solver={engine: articulated, step: 1 ms}"}));
  const auto axes = environment.simulation().controller()->axes();
  std::vector<double> angles(axes.size(), 0.2);
  environment.step({.angles = angles}, 3000);
  for (const control::AxisState& axis : environment.simulation().controller()->axes())
    EXPECT_NEAR(axis.angle, 0.2, 0.02);
  // Without angles the scene's poses are in force again.
  environment.step();
  EXPECT_NE(environment.simulation().controller()->axes()[0].target, 0.2);
}

// Oracle: the scene compiled with these numbers, to the bit (mass: the inertia is scaled, so within
// rounding).
TEST_P(OnEngine, NumbersActAsInTheSceneCompiledWithThem) {
  const scene::Scene scene = this->scene("dropped_hand");
  Environment environment(scene);
  const std::vector<double> gravity = {0.5, 0, -5}, friction = {0.3}, mass = {0.116};
  environment.set("gravity", gravity);
  environment.set("objects.1.friction", friction);
  environment.reset();
  steps(environment, 250);
  Environment compiled(this->scene("dropped_hand", {"gravity=[0.5, 0, -5]", "objects.1.friction=0.3"}));
  steps(compiled, 250);
  EXPECT_EQ(bits(environment), bits(compiled));
  environment.set("objects.0.mass", mass);
  environment.reset();
  EXPECT_EQ(environment.get("objects.0.mass"), mass);
  steps(environment, 100);
  Environment heavy(this->scene("dropped_hand",
                                {"gravity=[0.5, 0, -5]", "objects.1.friction=0.3", "objects.0.mass=116 g"}));
  steps(heavy, 100);
  for (std::size_t i = 0; i < scene.model.bodies.size(); ++i)
    EXPECT_LT((environment.simulation().state().bodies[i].p - heavy.simulation().state().bodies[i].p).norm(),
              1e-9)
        << scene.model.bodies[i].name;
}

TEST(Gains, AndTorqueLimitsAreFactorsOfTheControllers) {
  Environment environment(shipped_scene("every_pose", {"solver={engine: articulated, step: 1 ms}"}));
  const control::DrivenAxis before = environment.scene().control->axes[3];
  environment.set("gains", std::vector<double>{2.0});
  environment.set("torque_limits", std::vector<double>{0.01});
  environment.reset();
  const control::DrivenAxis& now = environment.scene().control->axes[3];
  EXPECT_EQ(now.proportional, 2 * before.proportional);
  EXPECT_EQ(now.derivative, 2 * before.derivative);
  EXPECT_EQ(now.torque_limit, 0.01 * before.torque_limit);
  const std::vector<double> far(environment.simulation().controller()->axes().size(), 1.0);
  environment.step({.angles = far}, 20);
  const auto axes = environment.simulation().controller()->axes();
  int at_limit = 0;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const double limit = environment.scene().control->axes[i].torque_limit;
    EXPECT_LE(std::abs(axes[i].torque), limit * (1 + 1e-9));
    at_limit += std::abs(axes[i].torque) > 0.999 * limit ? 1 : 0;
  }
  EXPECT_GT(at_limit, 0);
}

TEST(Seeds, DrawTheSameNumbersAgainAndOthersBesides) {
  environment::Setup setup;
  setup.randomise = {{"objects.0.mass", Distribution::uniform, 0.1, 0.5},
                     {"objects.1.friction", Distribution::log_uniform, 0.1, 1},
                     {"objects.0.position", Distribution::normal, 0.5, 0.01},
                     {"q", Distribution::uniform, 0, 0.1}};
  const scene::Scene scene = shipped_scene("dropped_hand", kArticulated);
  Environment a(scene, setup), b(scene, setup);
  double mean = 0, square = 0;
  constexpr int kDraws = 2000;
  for (int seed = 0; seed < kDraws; ++seed) {
    a.reset(static_cast<std::uint64_t>(seed));
    const double mass = a.get("objects.0.mass")[0];
    ASSERT_GT(mass, 0.1);
    ASSERT_LT(mass, 0.5);
    mean += mass / kDraws;
    square += mass * mass / kDraws;
    if (seed > 20) continue;
    steps(a, 5);
    b.reset(static_cast<std::uint64_t>(seed));
    steps(b, 5);
    EXPECT_EQ(bits(a), bits(b)) << seed;
    EXPECT_EQ(a.get("objects.1.friction"), b.get("objects.1.friction"));
  }
  // Standard errors: 0.115 / sqrt(2000).
  EXPECT_NEAR(mean, 0.3, 4 * 0.0026);
  EXPECT_NEAR(std::sqrt(square - mean * mean), 0.4 / std::sqrt(12), 0.006);
}

// Oracle: momentum. What the hand is pushed with in a step is what its momentum and weight say.
TEST(ObservedContacts, AddUpToTheChangeOfMomentum) {
  environment::Setup setup;
  setup.observe = {"finger_contacts", "contact_pairs", "time", "wrists", "fingertips", "objects", "q"};
  Environment environment(shipped_scene("dropped_hand", kOde), setup);
  const scene::Scene& scene = environment.scene();
  double mass = 0;
  const auto momentum = [&] {
    Vec3 out = Vec3::Zero();
    mass = 0;
    for (const int body : scene.model.hands[0].bodies) {
      const double m = scene.model.bodies[static_cast<std::size_t>(body)].mass;
      out += m * environment.simulation().state().bodies[static_cast<std::size_t>(body)].v;
      mass += m;
    }
    return out;
  };
  const auto part = [&](const std::string& name) {
    for (const ObservedPart& each : environment.observation().parts())
      if (each.name == name) return environment.observe().subspan(each.first, each.columns.size());
    return std::span<const double>();
  };
  double largest = 0;
  for (int i = 0; i < 300; ++i) {
    const Vec3 before = momentum();
    environment.step();
    const double h = scene.spec.solver.step;
    const Vec3 pushed = (momentum() - before) / h - mass * scene.model.gravity;
    Vec3 sum = Vec3::Zero();
    const auto fingers = part("finger_contacts");
    ASSERT_EQ(fingers.size(), 24U);
    for (std::size_t k = 0; k < fingers.size(); k += 4)
      sum += Vec3(fingers[k], fingers[k + 1], fingers[k + 2]);
    EXPECT_LT((sum - pushed).norm(), 1e-6 * (pushed.norm() + 1)) << i;
    largest = std::max(largest, sum.norm());
    const auto pairs = part("contact_pairs");
    ASSERT_EQ(pairs.size(), 6U * 3 * 2);
    double points_of_pairs = 0, points_of_fingers = 0;
    for (std::size_t k = 1; k < pairs.size(); k += 2) points_of_pairs += pairs[k];
    for (std::size_t k = 3; k < fingers.size(); k += 4) points_of_fingers += fingers[k];
    EXPECT_EQ(points_of_pairs, points_of_fingers);
  }
  EXPECT_GT(largest, 10);
  EXPECT_NEAR(part("time")[0], 0.3, 1e-12);
  const auto wrists = part("wrists");
  const model::BodyState& palm =
      environment.simulation().state().bodies[static_cast<std::size_t>(scene.model.hands[0].palm)];
  EXPECT_LT((Vec3(wrists[0], wrists[1], wrists[2]) - palm.pose() * scene.model.hands[0].wrist_frame.p).norm(),
            1e-15);
  EXPECT_EQ(part("objects").size(), 26U);
  EXPECT_EQ(part("q").size(), environment.simulation().state().q.size());
}

// Oracle: the capsule of a last segment starts at its joint and ends with its cap at the tip (hand/build.h).
TEST(ObservedFingertips, AreASegmentsLengthBeyondTheirJoint) {
  environment::Setup setup;
  setup.observe = {"fingertips"};
  Environment environment(shipped_scene("two_hands", kArticulated), setup);
  const std::span<const double> tips = environment.observe();
  ASSERT_EQ(tips.size(), 70U);
  const scene::Scene& scene = environment.scene();
  const std::vector<std::string>& columns = environment.observation().parts()[0].columns;
  for (std::size_t t = 0; t < tips.size(); t += 7) {
    const std::string segment = columns[t].substr(0, columns[t].find(".tip"));
    for (const model::Joint& joint : scene.model.joints) {
      const auto& child = scene.model.bodies[static_cast<std::size_t>(joint.child)];
      if (child.name != segment) continue;
      const Pose body = environment.simulation().state().bodies[static_cast<std::size_t>(joint.child)].pose();
      const double reach = (Vec3(tips[t], tips[t + 1], tips[t + 2]) - body * joint.child_frame.p).norm();
      double length = 0;
      for (const model::Shape& shape : scene.model.shapes)
        if (shape.body == joint.child) length = shape.length + shape.radius;
      EXPECT_NEAR(reach, length, 1e-12) << segment;
    }
  }
}

// Each problem of a setup is named; a start out of range leaves the environment as it was.
TEST(Refused, DistributionsAndStartsOutOfRange) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const scene::Scene scene = shipped_scene("grasp_power_can", kArticulated);
  try {
    Environment(scene, {.randomise = {{"gravity", Distribution::uniform, 1, 0},
                                      {"gains", Distribution::normal, 1, -1},
                                      {"objects.0.friction", Distribution::log_uniform, 0, 1},
                                      {"objects.0.mass", Distribution::uniform, -1, 1},
                                      {"torque_limits", Distribution::normal, kNaN, 1},
                                      {"toes", Distribution::uniform, 0, 1},
                                      {"q", Distribution::uniform, 0, 10}}});
    FAIL() << "nothing was refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.problems().size(), 6 + as_index(scene.model.dof_count())) << error.what();
    EXPECT_EQ(error.problems()[0].key, "randomise.gravity");
  }
  for (const int threads : {-1, 1025})
    EXPECT_THROW(Batch(scene, 2, BatchSetup{.threads = threads}), Error) << threads;
  Environment environment(scene);
  environment.step({}, 3);
  const std::uint64_t before = bits(environment);
  const std::vector<double> q(as_index(scene.model.dof_count()), 10.0), nan(q.size(), kNaN);
  EXPECT_THROW(environment.reset(Start{q, {}, {}}), Error);
  EXPECT_THROW(environment.reset(Start{{}, nan, {}}), Error);
  environment.set("q", q);
  EXPECT_THROW(environment.reset(), Error);
  EXPECT_EQ(bits(environment), before);
  EXPECT_EQ(environment.steps(), 3);
}

// Oracle: an environment that was never elsewhere. Each position is the scene's own plus one difference: sums
// of differences would round.
TEST(Seeds, LeaveNothingOfEarlierOnes) {
  const environment::Setup setup{.randomise = {{"objects.0.position", Distribution::normal, 0.3, 0.1},
                                               {"objects.0.mass", Distribution::uniform, 0.1, 0.5}}};
  const scene::Scene scene = shipped_scene("dropped_hand", kArticulated);
  Environment used(scene, setup), fresh(scene, setup);
  for (std::uint64_t seed = 0; seed < 20; ++seed) used.reset(seed);
  used.step({}, 5);
  for (Environment* each : {&used, &fresh}) each->reset(100);
  EXPECT_EQ(bits(used), bits(fresh));
}

TEST(Refused, WhatIsNotThere) {
  const scene::Scene scene = shipped_scene("dropped_hand", kArticulated);
  const auto text = [](const auto& call) -> std::string {
    try {
      call();
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::input);
      return error.what();
    }
    return "nothing";
  };
  EXPECT_NE(text([&] {
              Environment(scene, {{"q", "fingertip"}, {}});
            }).find("got fingertip"),
            std::string::npos);
  EXPECT_NE(text([&] {
              Environment(scene, {{"q"}, {{"objects.0.weight", {}, 0, 1}}});
            }).find("objects.0.weight"),
            std::string::npos);
  EXPECT_NE(text([&] { Environment(scene, {{"failed"}, {}}); }).find("watchers"), std::string::npos);
  Environment environment(scene);
  const std::uint64_t before = bits(environment);
  const std::vector<double> few(3), bad(static_cast<std::size_t>(scene.model.dof_count()), std::nan(""));
  EXPECT_NE(text([&] { environment.step({.torques = few}); }).find("torques: got 3"), std::string::npos);
  EXPECT_NE(text([&] { environment.step({.torques = bad}); }).find("finite"), std::string::npos);
  EXPECT_NE(text([&] { environment.step({.angles = few}); }).find("drives no joint"), std::string::npos);
  EXPECT_NE(text([&] { environment.step({}, 0); }).find("substeps"), std::string::npos);
  const std::vector<engine::BodyForce> on_world = {{0, Vec3::Ones(), Vec3::Zero()}},
                                       infinite = {{1, Vec3(0, INFINITY, 0), Vec3::Zero()}};
  EXPECT_NE(text([&] { environment.step({.forces = on_world}); }).find("forces"), std::string::npos);
  EXPECT_NE(text([&] { environment.step({.forces = infinite}); }).find("finite"), std::string::npos);
  EXPECT_NE(text([&] { environment.set("objects.9.mass", std::vector{1.0}); }).find("object 9"),
            std::string::npos);
  EXPECT_NE(text([&] { environment.set("objects.0.mass", std::vector{-1.0}); }).find("above 0"),
            std::string::npos);
  EXPECT_NE(text([&] { environment.set("gains", std::vector{1.0}); }).find("control"), std::string::npos);
  EXPECT_NE(text([&] { environment.set("wind", std::vector{1.0}); }).find("one of gravity"),
            std::string::npos);
  EXPECT_EQ(bits(environment), before);
  EXPECT_EQ(environment.failure(), nullptr);
  Environment reference(shipped_scene("slider_crank_iftomm", {"solver={engine: dae}"}));
  EXPECT_NE(text([&] { reference.step({.forces = infinite}); }).find("engine dae"), std::string::npos);
}

TEST_P(OnEngine, ADivergedEnvironmentSaysSoAndWorksAgainAfterItsReset) {
  Environment environment(scene("dropped_hand")), calm(scene("dropped_hand"));
  const std::vector<engine::BodyForce> wild = {{1, Vec3(1e6, 0, 0), Vec3::Zero()}};
  EXPECT_THROW(steps(environment, 1000, {.forces = wild}), Error);
  ASSERT_NE(environment.failure(), nullptr);
  EXPECT_EQ(environment.failure()->kind(), ErrorKind::physics);
  EXPECT_THROW(environment.step(), Error);
  environment.reset();
  EXPECT_EQ(environment.failure(), nullptr);
  steps(environment, 30);
  steps(calm, 30);
  EXPECT_EQ(bits(environment), bits(calm));
}

}  // namespace
}  // namespace handsim::environment
