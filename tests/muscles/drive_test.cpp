// Excitations: static optimisation, tables, and scenes that are driven by them.
#include <cmath>
#include <fstream>
#include <random>

#include <gtest/gtest.h>

#include "handsim/control/muscle_drive.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"
#include "support/sanitized.h"

namespace handsim::control {
namespace {

scene::Scene hand_scene(const std::vector<std::string>& more = {}) {
  std::vector<std::string> changes = {
      "effects=[gravity, joint_stops, passive_tissue, muscles]", "duration=0.5",
      "solver={engine: articulated, method: semi_implicit_euler, step: 0.001}"};
  changes.insert(changes.end(), more.begin(), more.end());
  return test::shipped_scene("resting_hand", changes);
}

std::vector<std::size_t> all_dofs(const model::Model& model) {
  std::vector<std::size_t> out;
  for (int i = 0; i < model.dof_count(); ++i) out.push_back(static_cast<std::size_t>(i));
  return out;
}

/// Torques of activations at rest, passive ones included.
std::vector<double> torques_of(const model::Model& model, const model::State& state,
                               std::span<const double> activations) {
  std::vector<double> out(state.q.size());
  for (std::size_t m = 0; m < model.muscles.size(); ++m) {
    const model::Muscle& muscle = model.muscles[m];
    const model::PathState path = model::path_state(muscle.path, state.q);
    const double force = model::tension(muscle, path.excursion, 0, activations[m]).force;
    for (std::size_t i = 0; i < muscle.path.arms.size(); ++i)
      out[static_cast<std::size_t>(muscle.path.arms[i].dof)] += path.arm[i] * force;
  }
  return out;
}

// Oracle: torques that some activations give can be given by the answer, with no larger sum of squares; and
// the answer is a minimum: the gradient points out of the box at each bound (Karush-Kuhn-Tucker, by
// differences).
TEST(StaticOptimisation, FindsTheLeastSquaresThatGiveTheTorques) {
  const scene::Scene scene = hand_scene({"hands.0.without=[spill]"});
  const model::State state = model::initial_state(scene.model);
  StaticOptimisation find(scene.model, all_dofs(scene.model));
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share(0, 0.8);
  for (int sample = 0; sample < 20; ++sample) {
    std::vector<double> given(scene.model.muscles.size());
    for (double& each : given) each = random() % 2 ? share(random) : 0;
    const std::vector<double> wanted = torques_of(scene.model, state, given);
    const std::span<const double> found = find.solve(state, wanted);
    const std::vector<double> got = torques_of(scene.model, state, found);
    double sum = 0, before = 0;
    for (std::size_t i = 0; i < given.size(); ++i) {
      EXPECT_GE(found[i], 0);
      EXPECT_LE(found[i], 1);
      sum += found[i] * found[i];
      before += given[i] * given[i];
    }
    EXPECT_LE(sum, before * (1 + 1e-6));
    // A missing torque of a thousandth of the joint's strength counts as an activation of 1.
    for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_NEAR(got[i], wanted[i], 0.02) << i;
  }
}

// Oracle: shares of handmodels/muscles.yaml: whoever bends the little finger bends the ring finger, too,
// whose extensors then hold it. The torques are those asked for; without the key each muscle is as lazy as
// before.
TEST(StaticOptimisation, LeavesNoNeighbourOut) {
  const scene::Scene scene = hand_scene(), apart = hand_scene({"hands.0.without=[spill]"});
  const scene::Scene half = hand_scene({"hands.0.without={spill: 0.5}"});
  const auto muscle = [&](const char* name) {
    return static_cast<std::size_t>(std::ranges::find(scene.model.muscles, name, &model::Muscle::name) -
                                    scene.model.muscles.begin());
  };
  const std::size_t little = muscle("right.FDP5"), ring = muscle("right.FDP4"),
                    opposes = muscle("right.EDC4");
  const auto share = [&](const model::Model& model) {
    for (const model::Spill& each : model.muscles[ring].spills)
      if (each.from == static_cast<int>(little)) return each.share;
    return 0.0;
  };
  EXPECT_EQ(share(scene.model), 0.5);
  EXPECT_EQ(share(half.model), 0.25);
  EXPECT_EQ(share(apart.model), 0);
  const model::State state = model::initial_state(scene.model);
  std::vector<double> given(scene.model.muscles.size());
  given[little] = 0.4;
  const std::vector<double> wanted = torques_of(scene.model, state, given);
  StaticOptimisation find(scene.model, all_dofs(scene.model)), find_apart(apart.model, all_dofs(apart.model));
  const std::span<const double> found = find.solve(state, wanted), lazy = find_apart.solve(state, wanted);
  const std::vector<double> got = torques_of(scene.model, state, found);
  for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_NEAR(got[i], wanted[i], 0.02) << i;
  for (std::size_t m = 0; m < found.size(); ++m)
    for (const model::Spill& each : scene.model.muscles[m].spills)
      EXPECT_GE(found[m], each.share * found[static_cast<std::size_t>(each.from)] - 1e-3)
          << scene.model.muscles[m].name;
  EXPECT_GT(found[ring], 0.1);
  EXPECT_LT(lazy[ring], 0.05);
  EXPECT_GT(found[opposes], lazy[opposes] + 0.05);
}

// Oracle: a torque beyond the muscles' leaves them at their bounds, and what is missing is said. The bound of
// a finger without feeling is 0.7 (handmodels/muscles.yaml).
TEST(StaticOptimisation, SaysWhatTheMusclesCannot) {
  double missing = 0;
  for (const auto& [without, most] :
       {std::pair("", 1.0), std::pair("hands.0.without=[index_feeling]", 0.7)}) {
    const scene::Scene scene =
        hand_scene(*without ? std::vector<std::string>{without} : std::vector<std::string>{});
    const model::State state = model::initial_state(scene.model);
    std::size_t dof = 0;
    for (const model::Joint& joint : scene.model.joints)
      if (joint.name == "right.index_pip") dof = static_cast<std::size_t>(joint.first_dof);
    StaticOptimisation find(scene.model, {dof});
    std::vector<double> torques(state.q.size());
    torques[dof] = 100;
    const std::span<const double> found = find.solve(state, torques);
    for (std::size_t m = 0; m < found.size(); ++m)
      if (scene.model.muscles[m].name == "right.FDP2" || scene.model.muscles[m].name == "right.FDS2") {
        EXPECT_EQ(found[m], most);
      }
    EXPECT_GT(find.missing()[0], 90);
    EXPECT_GT(find.missing()[0], missing);
    missing = find.missing()[0];
  }
}

// Oracle: excitations of a table are linear between its rows; muscles without a column have none.
void expect_table(const std::string& excitations) {
  const scene::Scene scene = hand_scene({"excitations=" + excitations});
  simulation::Simulation run(scene, simulation::no_watchers);
  for (int i = 0; i < 200; ++i) run.step();
  for (std::size_t m = 0; m < scene.model.muscles.size(); ++m) {
    const std::string& name = scene.model.muscles[m].name;
    const double expected = name == "right.FDP2" ? 0.4 : name == "right.FDS3" ? 0.5 : 0;
    EXPECT_NEAR(run.excitations()[m], expected, 1e-9) << name;
  }
  // Activation lags behind a rising excitation, and the tendon pulls.
  const auto& state = run.state();
  for (std::size_t m = 0; m < scene.model.muscles.size(); ++m)
    if (scene.model.muscles[m].name == "right.FDP2") {
      EXPECT_GT(state.activation[m], 0.3);
      EXPECT_LT(state.activation[m], 0.4);
      EXPECT_GT(state.tendon_force[m], 1);
    }
}

TEST(Excitations, FollowATable) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "pull.csv";
  // `[rad]` as in older files.
  for (const std::string unit : {"", "[]", "[rad]"}) {
    std::ofstream(file) << "time[s],FDP2" << unit << ",right.FDS3" << unit << "\n0,0,0.5\n0.4,0.8,0.5\n";
    expect_table(file.string());
  }
  for (const char* degrees : {"yes", "no"}) {
    std::ofstream(folder.path() / "pull.sto") << "pull\nnRows=2\nnColumns=3\ninDegrees=" << degrees
                                              << "\nendheader\ntime FDP2 right.FDS3\n0 0 0.5\n0.4 0.8 0.5\n";
    expect_table((folder.path() / "pull.sto").string());
  }
  expect_table("{times: [0, 400 ms], FDP2: [0, 0.8], right.FDS3: 0.5}");
}

TEST(Excitations, SayWhatIsWrongInAScene) {
  try {
    hand_scene({"excitations={times: [0, 1, 1], FDP2: [0, 1.5], FDS2: [1, 2]}"});
    FAIL() << "accepted";
  } catch (const Error& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("excitations.times: got 1 s after 1 s, need times that increase"), std::string::npos)
        << text;
    EXPECT_NE(text.find("got 1.5"), std::string::npos) << text;
  }
  try {
    hand_scene({"excitations={times: [0, 1], FDP2: [0, 1, 0]}"});
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("excitations.FDP2: got 3 numbers, need one, or 2 as times has"),
              std::string::npos)
        << error.what();
  }
}

// Oracle: each table lacks what it needs, or has what it must not have.
TEST(Excitations, SpoiltTablesAreRefusedWithTheirPlace) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "pull.csv";
  std::ofstream(file) << "time[s],FDP2[deg]\n0,0\n";
  const std::vector<std::pair<std::string, std::string>> spoilt = {
      {"{times: [], FDP2: []}", "excitations.times: got no time, need one time or more"},
      {"{times: [], FDP2: 0.5}", "excitations.times: got no time"},
      {"{times: []}", "excitations.times: got no time"},
      {"{times: [0]}", "got times alone, need a muscle"},
      {"{times: [0, 1], FDP2: []}", "excitations.FDP2: got 0 numbers"},
      {"{times: [0, .nan], FDP2: [0, 0]}", "got .nan"},
      {"{times: [0, 1], FDP2: [0, .inf]}", "got .inf"},
      {"{times: [-1, 1], FDP2: [0, 0]}", "got -1"},
      {"{times: [[0], 1], FDP2: [0, 0]}", "got a list"},
      {"{times: [1, 0], FDP2: [0, 0]}", "times that increase"},
      {file.string(), "pull.csv:1:9: FDP2[deg]: got the unit [deg], need no unit, or []"}};
  for (const auto& [table, problem] : spoilt) try {
      hand_scene({"excitations=" + table});
      ADD_FAILURE() << "accepted " << table;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(problem), std::string::npos) << table << ": " << error.what();
    }
}

TEST(Excitations, NameAColumnThatIsNoMuscle) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "pull.csv";
  std::ofstream(file) << "time[s],FPD2[rad]\n0,0\n1,1.5\n";
  try {
    hand_scene({"excitations=" + file.string()});
    FAIL() << "accepted";
  } catch (const Error& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("FPD2"), std::string::npos) << text;
    EXPECT_NE(text.find("FDP2"), std::string::npos) << text;
    EXPECT_NE(text.find("1.5"), std::string::npos) << text;
  }
}

// Oracle: the scene's criterion on the error at the end of a hold. Among the poses are counts and `point`, in
// which straight fingers are beside bent ones: a stiff quadriga bends an index that points by 75 deg.
TEST(MuscleDrive, HoldsEveryPose) {
  HANDSIM_SKIP_WITH_SANITIZER("shorter tests run the same code");
  const test::TemporaryFolder folder;
  simulation::RunOptions options;
  options.out = folder.path();
  const simulation::RunResult result = simulation::run(test::shipped_scene("muscle_poses"), options);
  EXPECT_TRUE(result.passed()) << result.summary;
}

std::vector<std::string> warnings_of_run(const std::vector<std::string>& changes) {
  const test::TemporaryFolder folder;
  simulation::RunOptions options;
  options.out = folder.path();
  std::vector<std::string> all = {"duration=4 s", "criteria={}"};
  all.insert(all.end(), changes.begin(), changes.end());
  return simulation::run(test::shipped_scene("muscle_poses", all), options).warnings;
}

// Oracle: the gains of the shipped files, 30 Hz for muscles and 8 Hz for motors.
TEST(MuscleDrive, AControlWithoutControllerGetsTheOneOfItsDrive) {
  const auto control = [](const std::string& drive, const std::string& controller) {
    return test::shipped_scene(
        "muscle_poses", {"criteria={}", "control={" + controller +
                                            "poses: " + test::source("controllers/poses.yaml").string() +
                                            ", program: every_pose, drive: " + drive + "}"});
  };
  for (const auto& [drive, file] : {std::pair("muscles", "muscles"), std::pair("motors", "implicit")}) {
    const scene::Scene own = control(drive, "");
    const scene::Scene named = control(
        drive, "controller: " + test::source("controllers/" + std::string(file) + ".yaml").string() + ", ");
    ASSERT_EQ(own.control->axes.size(), named.control->axes.size());
    for (std::size_t i = 0; i < own.control->axes.size(); ++i)
      EXPECT_EQ(own.control->axes[i].proportional, named.control->axes[i].proportional);
  }
}

// Oracle: a hand at 8 Hz creeps after its targets, since muscles damp it.
TEST(MuscleDrive, AHandThatDoesNotFollowIsAWarning) {
  HANDSIM_SKIP_WITH_SANITIZER("shorter tests run the same code");
  const std::string slow = test::source("controllers/implicit.yaml").string();
  const std::vector<std::string> warnings = warnings_of_run({"control.controller=" + slow});
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("the muscles do not follow their targets"), std::string::npos) << warnings[0];
  EXPECT_TRUE(warnings_of_run({}).empty());
}

// Oracle: the definition; a table that the run does not reach is a warning, one that it reaches is none.
TEST(Excitations, OfATableThatTheRunDoesNotReachAreAWarning) {
  for (const std::string times : {"[3, 4]", "[0, 4]"}) {
    const scene::Scene scene = hand_scene({"excitations={times: " + times + ", FDP2: [0, 0.8]}"});
    const bool warned = std::ranges::any_of(scene.warnings, [](const std::string& text) {
      return text.find("nothing changes during the run") != std::string::npos;
    });
    EXPECT_EQ(warned, times == "[3, 4]") << times;
  }
}

// Oracle: what a snapshot continues has the same bits as the run without it, activations included.
TEST(Excitations, ContinueFromASnapshotWithTheSameBits) {
  for (const std::string engine : {"articulated, method: semi_implicit_euler", "ode, method: world_step"}) {
    const scene::Scene scene = hand_scene({"solver={engine: " + engine + ", step: 0.001}"});
    std::vector<double> excitations(scene.model.muscles.size(), 0.2);
    engine::StepInput input;
    input.excitations = excitations;
    simulation::Simulation run(std::make_shared<const scene::Scene>(scene), simulation::no_watchers);
    for (int i = 0; i < 37; ++i) run.step(input);
    const simulation::MotionSnapshot half = run.motion();
    const simulation::RunSnapshot whole = run.snapshot();
    std::vector<double> others(excitations.size(), 0.9);
    run.step({.excitations = others});
    // The excitations that were acting are part of both.
    run.restore(whole);
    EXPECT_EQ(std::vector<double>(run.excitations().begin(), run.excitations().end()), excitations);
    for (int i = 0; i < 50; ++i) run.step(input);
    const model::State straight = run.state();
    run.step({.excitations = others});
    run.reset(half);
    EXPECT_EQ(std::vector<double>(run.excitations().begin(), run.excitations().end()), excitations);
    for (int i = 0; i < 50; ++i) run.step(input);
    EXPECT_EQ(run.state().activation, straight.activation);
    EXPECT_EQ(run.state().q, straight.q);
    EXPECT_EQ(run.state().tau, straight.tau);
  }
}

}  // namespace
}  // namespace handsim::control
