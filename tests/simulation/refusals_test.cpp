// Starts that make energy from nothing, and steps that there is no memory for.
#include <gtest/gtest.h>

#include <fstream>

#include <sys/resource.h>
#include <unistd.h>

#include <fmt/format.h>

#include "handsim/core/memory.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"
#include "support/sanitized.h"

namespace handsim::simulation {
namespace {

scene::Scene scene_of(const std::string& text) { return scene::compile_scene(parse_yaml(text, "test.yaml")); }

/// A four-bar pulled straight, whose first joint between bars moves across at a speed [m/s].
std::string four_bar(const std::string& solver, double speed = 1) {
  return fmt::format(
      "bodies:\n"
      "  - {{name: b0, mass: 1, inertia: [0.01, 0.01, 0.01], position: [0.5, 0, 0], velocity: [0, 0, {}], "
      "angular_velocity: [0, {}, 0]}}\n"
      "  - {{name: b1, mass: 1, inertia: [0.01, 0.01, 0.01], position: [1.5, 0, 0], velocity: [0, 0, {}], "
      "angular_velocity: [0, {}, 0]}}\n"
      "  - {{name: b2, mass: 1, inertia: [0.01, 0.01, 0.01], position: [2.5, 0, 0]}}\n"
      "joints:\n"
      "  - {{name: j0, type: hinge, parent: world, child: b0, position: [0, 0, 0], axes: [{{name: q, axis: "
      "[0, 1, 0]}}]}}\n"
      "  - {{name: j1, type: hinge, parent: b0, child: b1, position: [1, 0, 0], axes: [{{name: q, axis: [0, "
      "1, 0]}}]}}\n"
      "  - {{name: j2, type: hinge, parent: b1, child: b2, position: [2, 0, 0], axes: [{{name: q, axis: [0, "
      "1, 0]}}]}}\n"
      "  - {{name: j3, type: hinge, parent: world, child: b2, position: [3, 0, 0], axes: [{{name: q, axis: "
      "[0, 1, 0]}}]}}\n"
      "effects: [gravity]\nsolver: {{{}}}\nduration: 0.1\n",
      0.5 * speed, -speed, 0.5 * speed, speed, solver);
}

/// What is wrong, or nothing where the scene runs through.
std::string refusal(const scene::Scene& scene) {
  try {
    Simulation simulation(scene);
    for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

// Oracle: bars of 1 m between ends 3 m apart cannot move at all.
TEST(SingularLoop, IsRefusedByAllThatCloseJoints) {
  for (const char* solver : {"engine: dae", "engine: dae, method: lagrange_penalty",
                             "engine: dae, method: euler_linearised", "engine: dae, method: euler_projected",
                             "engine: articulated", "engine: articulated, method: rk4", "projection: true"}) {
    for (const double speed : {0.0, 1.0}) {
      const std::string text = refusal(scene_of(four_bar(solver, speed)));
      EXPECT_NE(text.find("singular start"), std::string::npos) << solver << ": " << text;
      EXPECT_EQ(text.find("j"), 0U) << text;
    }
  }
}

// What does not close joints lets them gape. Oracle: in 0.1 s the free bars would have 1.4 J by their fall.
TEST(SingularLoop, MakesNoEnergyWhereJointsMayGape) {
  const scene::Scene scene = scene_of(four_bar("method: world_step", 0));
  Simulation simulation(scene);
  double most = 0;
  for (long i = 0; i < simulation.step_count(); ++i) {
    simulation.step();
    double energy = 0;
    for (std::size_t k = 1; k < 4; ++k) {
      const model::BodyState& body = simulation.state().bodies[k];
      energy += 0.5 * body.v.squaredNorm() + 0.005 * body.w.squaredNorm();
    }
    most = std::max(most, energy);
  }
  EXPECT_LT(most, 0.02);
}

// Dead centres are singular for the slider and not for the crank.
TEST(SingularLoop, ADeadCentreIsNone) {
  for (const char* name : {"crank_inner_dead_centre", "crank_outer_dead_centre"})
    for (const char* method : {"euler_projected", "stabilised_gear"}) {
      scene::Scene scene = scene::load_scene(
          test::in_source("config/stability/") + name + ".yaml",
          {std::string("solver={engine: dae, step: 1e-3, method: ") + method + "}", "duration=0.2"});
      EXPECT_EQ(refusal(scene), "") << name << method;
    }
}

std::string hinge(const char* range, const char* effects) {
  return fmt::format(
      "bodies: [{{name: a, mass: 1, inertia: [1e-3, 1e-3, 1e-3], position: [0.1, 0, 0]}}]\n"
      "joints:\n  - {{name: h, type: hinge, parent: world, child: a, position: [0, 0, 0], axes: [{{name: q, "
      "axis: [0, 0, 1], range: {}}}]}}\n"
      "effects: [{}]\nduration: 0.01\n",
      range, effects);
}

TEST(Stops, AStartOutsideThemIsRefusedWithPlaceAndRange) {
  for (const char* range : {"[1, 2]", "[-2, -1]"}) {
    try {
      scene_of(hinge(range, "joint_stops"));
      FAIL() << range;
    } catch (const Error& error) {
      ASSERT_EQ(error.problems().size(), 1U);
      EXPECT_EQ(error.problems()[0].key, "h.q");
      EXPECT_EQ(error.problems()[0].got, "a start at 0 rad");
      ASSERT_TRUE(error.problems()[0].place);
      EXPECT_EQ(error.problems()[0].place->line, 3);
    }
  }
  EXPECT_NO_THROW(scene_of(hinge("[0, 2]", "joint_stops")));
  EXPECT_NO_THROW(scene_of(hinge("[1, 2]", "gravity")));
}

TEST(Stops, AHandThatStartsOutsideThemIsRefused) {
  EXPECT_THROW(test::shipped_scene("dropped_hand", {"hands.0.pose={index_pip: -1.2}"}), Error);
}

#ifndef HANDSIM_ADDRESS_SANITIZED  // which takes more address space than there is
/// Boxes side by side on a free slab: one island of 12 rows a box.
scene::Scene many_boxes(int side, const std::string& solver, const std::string& more = "") {
  std::string text =
      "objects:\n  - {name: slab, shape: box, edges: [4, 4, 0.1], mass: 100, position: [0, 0, 0.05]}\n";
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      text += fmt::format(
          "  - {{name: b{}_{}, shape: box, edges: [0.05, 0.05, 0.05], mass: 0.1, position: [{}, {}, "
          "0.1249]}}\n",
          i, j, -1.5 + 0.1 * i, -1.5 + 0.1 * j);
  return scene_of(text + "effects: [gravity, object_contact, friction" + more + "]\nsolver: {" + solver +
                  "}\nduration: 2e-3\n");
}

/// No more address space than is free now, less what is given, while it lives.
class LittleMemory {
 public:
  explicit LittleMemory(std::size_t left) {
    getrlimit(RLIMIT_AS, &before_);
    rlimit now = before_;
    now.rlim_cur = used() + left;
    setrlimit(RLIMIT_AS, &now);
  }
  ~LittleMemory() { setrlimit(RLIMIT_AS, &before_); }

 private:
  static std::size_t used() {
    std::ifstream statm("/proc/self/statm");
    std::size_t pages = 0;
    statm >> pages;
    return pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  }
  rlimit before_{};
};

// Oracle: the direct solver's matrix and its factors, 2 x 8 x (12 x 144)^2 bytes = 48 MB; 30 are there.
TEST(Memory, AStepThatDoesNotFitIsAFaultThatNamesTheWayOut) {
  const scene::Scene scene = many_boxes(12, "method: world_step");
  Simulation simulation(scene);
  const LittleMemory little(std::size_t{30} << 20);
  const Vec3 before = simulation.state().bodies[1].p;
  try {
    simulation.step();
    FAIL() << "a step of 1728 rows in 30 MB";
  } catch (const Error& error) {
    ASSERT_TRUE(error.fault());
    EXPECT_EQ(error.fault()->quantity, "memory");
    EXPECT_NE(error.fault()->detail.find("quick_step"), std::string::npos) << error.what();
  }
  EXPECT_EQ(simulation.state().bodies[1].p, before);
  EXPECT_EQ(simulation.state().time, 0);
}

TEST(Memory, WhatIsFreeIsNoMoreThanTheLimitLeaves) {
  ASSERT_TRUE(free_memory());
  const LittleMemory little(std::size_t{60} << 20);
  EXPECT_LE(*free_memory(), std::size_t{60} << 20);
  EXPECT_GT(*free_memory(), std::size_t{40} << 20);
}

#endif

}  // namespace
}  // namespace handsim::simulation
