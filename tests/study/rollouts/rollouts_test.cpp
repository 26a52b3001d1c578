// Rollout studies: rows are a pure function of study, seed and range, and say what happened.
#include <regex>
#include <set>
#include <thread>

#include <gtest/gtest.h>

#include "handsim/core/input_file.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"
#include "study/rollouts/studies.h"
#include "support/sanitized.h"

namespace handsim::study {
namespace {

namespace fs = std::filesystem;
using test::table_of;
using test::TemporaryFolder;
using test::write_study;

std::vector<std::vector<std::string>> cells_of(const std::string& csv) {
  std::vector<std::vector<std::string>> out;
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line);) {
    std::vector<std::string>& row = out.emplace_back();
    row.emplace_back();
    bool quoted = false;
    for (const char c : line) {
      if (c == '"') quoted = !quoted;
      if (c == ',' && !quoted)
        row.emplace_back();
      else
        row.back() += c;
    }
  }
  return out;
}

/// A column of rollouts.csv without its head.
std::vector<std::string> column(const std::string& csv, const std::string& name) {
  const auto rows = cells_of(csv);
  const auto at = std::find(rows[0].begin(), rows[0].end(), name) - rows[0].begin();
  std::vector<std::string> out;
  for (std::size_t i = 1; i < rows.size(); ++i) out.push_back(rows[i].at(static_cast<std::size_t>(at)));
  return out;
}

// Oracle: all rows at once. Two threads share the study, and ranges come in any order.
TEST(Rollouts, RowsAreTheSameForAnyRangesAndThreads) {
  const TemporaryFolder folder;
  const RolloutStudy study(load_rollouts(write_study(folder.path())));
  const std::atomic<bool> stop = false;
  const RolloutRows whole = rollout_rows(study, 0, 12, stop);
  EXPECT_EQ(whole.to, 12);
  EXPECT_EQ(whole.trajectories.size(), 2U);
  std::vector<std::string> rows(12);
  const auto compute = [&](std::vector<long> of) {
    for (const long i : of) rows[static_cast<std::size_t>(i)] = rollout_rows(study, i, i + 1, stop).csv;
  };
  std::thread other(compute, std::vector<long>{11, 3, 5, 0, 8, 7});
  compute({2, 1, 10, 4, 9, 6});
  other.join();
  std::string all;
  for (const std::string& row : rows) all += row;
  EXPECT_EQ(all, whole.csv);
  EXPECT_EQ(rollout_rows(study, 0, 1, stop).trajectories[0].second.values,
            whole.trajectories[0].second.values);
}

// Oracle: the study of the files on the disk. What it has read is all that another machine needs, which has
// none of the files and another folder.
TEST(Rollouts, AreTheSameFromCarriedFiles) {
  CarriedFiles files;
  std::string table;
  std::vector<std::string> origin;
  {
    const TemporaryFolder folder;
    files.folder = folder.path();
    const fs::path before = fs::current_path();
    fs::current_path(folder.path());
    fs::create_directories(folder.path() / "shapes");
    std::ofstream(folder.path() / "shapes/wedge.stl")
        << "solid wedge\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0.1 0\nvertex 0.1 0 "
           "0\nendloop\nendfacet\n"
           "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0.1 0 0\nvertex 0 0 0.1\nendloop\nendfacet\n"
           "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 0.1\nvertex 0 0.1 0\nendloop\nendfacet\n"
           "facet normal 0 0 0\nouter loop\nvertex 0.1 0 0\nvertex 0 0.1 0\nvertex 0 0 "
           "0.1\nendloop\nendfacet\nendsolid\n";
    std::ofstream(folder.path() / "scene.yaml")
        << "objects: [{name: wedge, shape: convex_mesh, mesh: shapes/wedge.stl, mass: 1, position: [0, 0, "
           "0]}]\nduration: 0.02\n"
           "effects: [gravity]\n";
    std::ofstream(folder.path() / "study.yaml")
        << "scene: scene.yaml\ncount: 8\nvary: {objects.0.mass: {normal: {sd: 20}}}\n";
    const CarriedScope scope(files, true);
    const RolloutStudy study(load_rollouts("study.yaml"));
    table = table_of(study);
    origin = study.head().origin;
    fs::current_path(before);
  }
  EXPECT_EQ(files.files.size(), 3U);
  EXPECT_NE(table.find("refused"), std::string::npos) << table;
  const CarriedScope scope(files, false);
  const RolloutStudy study(load_rollouts("study.yaml"));
  EXPECT_EQ(table_of(study), table);
  EXPECT_EQ(study.head().origin, origin);
}

// Oracle: nothing is computed once the work is stopped.
TEST(Rollouts, AreStoppedAtOnce) {
  const TemporaryFolder folder;
  const RolloutStudy study(load_rollouts(write_study(folder.path())));
  const RolloutRows rows = rollout_rows(study, 3, 12, true);
  EXPECT_EQ(rows.to, 3);
  EXPECT_EQ(rows.csv, "");
}

// Oracle: what was drawn is that of the rollout that ran; a line ends where it ends.
TEST(Rollouts, ACrashedOneIsARowWithWhatWasDrawn) {
  const TemporaryFolder folder;
  const RolloutStudy study(load_rollouts(write_study(folder.path())));
  const auto ran = cells_of(rollout_rows(study, 4, 5, false).csv),
             crashed = cells_of(crashed_row(study, 4, "two\nlines"));
  ASSERT_EQ(crashed.size(), 1U);
  ASSERT_EQ(crashed[0].size(), ran[0].size());
  EXPECT_EQ(std::vector(crashed[0].begin(), crashed[0].begin() + 5),
            std::vector(ran[0].begin(), ran[0].begin() + 5));
  const auto columns = cells_of(csv_head(study.head()))[0];
  const auto cell = [&](const char* name) {
    return crashed[0][static_cast<std::size_t>(std::find(columns.begin(), columns.end(), name) -
                                               columns.begin())];
  };
  EXPECT_EQ(cell("ended"), "crashed");
  EXPECT_EQ(cell("error"), "two; lines");
  EXPECT_EQ(cell("state_hash"), "");
}

// Oracle: `handsim run` of the same scene, whose hash is that of all states.
TEST(Rollouts, HaveTheHashOfARunOfTheSameScene) {
  const TemporaryFolder folder;
  const fs::path file = write_study(folder.path());
  const std::vector<std::string> hashes = column(table_of(file), "state_hash");
  EXPECT_EQ(std::set<std::string>(hashes.begin(), hashes.end()).size(), hashes.size());
  const RolloutStudy study(load_rollouts(file));
  for (const long i : {0L, 5L}) {
    simulation::RunOptions options;
    options.out = folder.path() / "run";
    EXPECT_EQ(simulation::hash_text(simulation::run(study.scene(i), options).state_hash),
              hashes[static_cast<std::size_t>(i)]);
    // By the scene's own file and overrides alone.
    std::vector<std::string> overrides = study.spec().set;
    for (const std::string& each : study.overrides(i)) overrides.push_back(each);
    simulation::Simulation plain(scene::load_scene(study.spec().scene, overrides));
    for (long k = 0; k < plain.step_count(); ++k) plain.step();
    EXPECT_EQ(simulation::hash_text(plain.state_hash()), hashes[static_cast<std::size_t>(i)]);
  }
}

// Oracle: rollouts of one draw differ by the level alone; both hands are one person's; another key more
// leaves the draws of the others as they were.
TEST(Rollouts, DrawEachKeyForItself) {
  const TemporaryFolder folder;
  const RolloutStudy study(load_rollouts(write_study(folder.path())));
  const auto set = [&](long i) {
    const auto list = study.overrides(i);
    return std::set<std::string>(list.begin(), list.end());
  };
  const auto first = study.overrides(0), second = study.overrides(1);
  ASSERT_EQ(first.size(), 5U);
  EXPECT_EQ(std::vector(first.begin(), first.end() - 1), std::vector(second.begin(), second.end() - 1));
  EXPECT_EQ(first.back(), "solver.engine=ode");
  EXPECT_EQ(second.back(), "solver.engine=articulated");
  EXPECT_EQ(first[0].substr(first[0].find('=')), first[1].substr(first[1].find('=')));
  EXPECT_NE(set(0), set(2));
  RolloutsSpec more = study.spec();
  VariedKey stiffness = more.vary[1];
  stiffness.key = "hands.1.tissue.damping";
  more.vary.insert(more.vary.begin(), stiffness);
  const RolloutStudy wider(more);
  for (const std::string& each : first) {
    const auto list = wider.overrides(0);
    EXPECT_NE(std::find(list.begin(), list.end(), each), list.end()) << each;
  }
}

struct BadStudy {
  const char* name;
  std::string vary;
  std::string message;  ///< `study.yaml:LINE:COLUMN: ...`
};

void PrintTo(const BadStudy& bad, std::ostream* out) { *out << bad.name; }

class BadStudies : public testing::TestWithParam<BadStudy> {};

const std::string kBall =
    "objects: [{name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 0]}]\nduration: 0.02\n";

// Oracle: the place of the mistake, and what the scene's own reader says of it, before anything runs.
TEST_P(BadStudies, AreRefusedAtTheirPlace) {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "ball.yaml") << kBall;
  std::ofstream(folder.path() / "study.yaml") << "scene: ball.yaml\nvary:\n  " + GetParam().vary + "\n";
  try {
    const RolloutStudy study(load_rollouts(folder.path() / "study.yaml"));
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(GetParam().message), std::string::npos) << error.what();
  }
}

INSTANTIATE_TEST_SUITE_P(
    , BadStudies,
    testing::Values(
        BadStudy{"MisspeltKey", "objects.0.mas: {uniform: [1, 2]}", "nearest: mass"},
        BadStudy{"MisspeltKeyAtItsPlace", "objects.0.mas: {uniform: [1, 2]}", "study.yaml:3:"},
        BadStudy{"AnotherUnit", "objects.0.mass: {uniform: [\"1 mm\", \"2 mm\"]}",
                 "vary.objects.0.mass: got \"1 mm\", need a mass"},
        BadStudy{"DeviationOfAnotherUnit", "objects.0.mass: {normal: {sd: \"1 mm\"}}", "study.yaml:3:"},
        BadStudy{
            "HighFirst", "objects.0.mass: {uniform: [2, 1]}",
            "study.yaml:3:29: vary.objects.0.mass.uniform: got 2 to 1, need two values, the lower first"},
        BadStudy{"NoWay", "objects.0.mass: {}", "got nothing to draw from, need one of uniform"},
        BadStudy{"TwoWays", "objects.0.mass: {uniform: [1, 2], each: [1, 2]}", "got 2 ways to draw"},
        BadStudy{"UnknownWay", "objects.0.mass: {unifrom: [1, 2]}", "nearest: uniform"},
        BadStudy{"NoMean", "title: {normal: {sd: 1}}", "need a mean, or a number of the scene"},
        BadStudy{"NoList", "objects.0.*.mass: {uniform: [1, 2]}", "need a list of the scene before it"},
        BadStudy{"LevelOutOfRange", "objects.0.mass: {each: [1, -1]}", "vary.objects.0.mass: got -1"},
        BadStudy{
            "KeyAndItsComponent",
            "objects.0.position: {uniform: [[0, 0, 1], [0, 0, 2]]}\n  objects.0.position.2: {uniform: [5, "
            "6]}",
            "study.yaml:4:25: vary.objects.0.position.2: got a part or the whole of what "
            "vary.objects.0.position draws"},
        BadStudy{"KeyOfAllAndOfOne", "objects.*.mass: {uniform: [1, 2]}\n  objects.0.mass: {uniform: [1, 2]}",
                 "what vary.objects.*.mass draws"},
        BadStudy{"SetAndVaried", "objects.0.mass: {uniform: [1, 2]}\nset: {objects.0.mass: 1}",
                 "study.yaml:4:7: set.objects.0.mass: got a value that vary.objects.0.mass replaces"},
        BadStudy{"EmptyKey", "\"\": {uniform: [1, 2]}", "study.yaml:3:3: vary: got an empty key"},
        BadStudy{"DotsAlone", "\"..\": {uniform: [1, 2]}", "study.yaml:3:9: vary...: got \"..\""},
        BadStudy{"NoSuchObject", "objects.7.mass: {uniform: [1, 2]}",
                 "study.yaml:3:19: vary.objects.7.mass: got \"7\" for a list of 1"},
        BadStudy{"TwoSpellingsOfAnIndex", "objects.00.mass: {uniform: [1, 2]}", "got \"00\" for a list of 1"},
        BadStudy{"SetOfNoSuchObject", "objects.0.mass: {uniform: [1, 2]}\nset: {objects.7.mass: 1}",
                 "study.yaml:4:7: set.objects.7.mass: got \"7\" for a list of 1"},
        BadStudy{"UnknownKeyInSet", "objects.0.mass: {uniform: [1, 2]}\nset: {solver.stp: 1}",
                 "study.yaml:4:7: set.solver.stp: got an unknown key"},
        BadStudy{"UnknownFigure", "objects.0.mass: {uniform: [1, 2]}\nrecord: {figures: [nope]}",
                 "study.yaml:4:20: record.figures: got nope"},
        BadStudy{"UnknownOutcome", "objects.0.mass: {uniform: [1, 2]}\noutcome: [held, jointgap]",
                 "study.yaml:4:10: outcome: got jointgap, need one of joint_gap[m]"},
        BadStudy{"OutcomeOfNoSuchPath", "objects.0.mass: {uniform: [1, 2]}\noutcome: counts.contcts",
                 "the path of a number in summary.json (nearest: counts.contacts)"},
        BadStudy{"StopWithoutGrasp", "objects.0.mass: {uniform: [1, 2]}\nstop: {lost: true}",
                 "study.yaml:4:14: stop.lost: got true in a scene without a grasp"},
        BadStudy{
            "NoEffect", "solver.seed: {each: [1, 2]}",
            "study.yaml:3:16: vary.solver.seed: got values without effect (method world_step does not use "
            "it)"},
        BadStudy{"SetWithoutEffect", "objects.0.mass: {uniform: [1, 2]}\nset: {objects.0.friction: 0.1}",
                 "study.yaml:4:7: set.objects.0.friction: got a value without effect"},
        BadStudy{"NoPopulation", "objects.0.mass: {population: ansur3}", "got ansur3, need ansur2"}),
    [](const auto& bad) { return bad.param.name; });

// Oracle: a negative mass is refused when it is drawn, and a ball in a gravity of 1000 m/s2 passes the
// engines' limit of 1000 m/s at 1.001 s; both are rows.
TEST(Rollouts, RefusedAndDivergedOnesAreRows) {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "ball.yaml") << kBall << "effects: [gravity]\n";
  std::ofstream(folder.path() / "study.yaml")
      << "scene: ball.yaml\nset: {duration: 1.1}\ncount: 20\nvary:\n"
         "  objects.0.mass: {normal: {sd: 1}}\n  gravity: {each: [[0, 0, -10], [0, 0, -1000]]}\n";
  const std::string csv = table_of(folder.path() / "study.yaml");
  const auto ended = column(csv, "ended"), masses = column(csv, "objects.0.mass");
  ASSERT_EQ(ended.size(), 40U);
  int refused = 0;
  for (std::size_t i = 0; i < ended.size(); ++i) {
    const bool bad = std::stod(masses[i]) <= 0;
    EXPECT_EQ(ended[i], bad ? "refused" : i % 2 == 0 ? "end" : "diverged");
    refused += bad;
  }
  EXPECT_GT(refused, 0);
  EXPECT_TRUE(std::regex_search(csv, std::regex("refused,.*mass: got -"))) << csv;
  EXPECT_TRUE(std::regex_search(csv, std::regex(",0,diverged,1.*at t = 1.001 s: ball: speed"))) << csv;
}

// Oracle: a ball of radius 0.1 m falls 0.78 m in 0.4 s, and touches the ground from a height of 0.3 m alone.
// The path of a figure of summary.json is its column.
TEST(Rollouts, OutcomesAreFiguresOrPathsOfTheSummary) {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "ball.yaml")
      << kBall << "effects: [gravity, object_contact, ground_contact]\n"
      << "ground: {height: 0}\n";
  std::ofstream(folder.path() / "study.yaml")
      << "scene: ball.yaml\nset: {duration: 0.4}\ncount: 8\nvary:\n"
         "  objects.0.position.2: {each: [0.3, 1.5, 5]}\n  objects.0.mass: {uniform: [1, 2]}\n"
         "outcome: [penetration, counts.contacts]\n";
  const std::string csv = table_of(folder.path() / "study.yaml");
  const auto heights = column(csv, "objects.0.position.2"), contacts = column(csv, "counts.contacts");
  ASSERT_EQ(contacts.size(), 24U);
  for (std::size_t i = 0; i < contacts.size(); ++i)
    EXPECT_EQ(std::stod(contacts[i]) > 0, std::stod(heights[i]) < 1) << csv;
  EXPECT_EQ(column(csv, "penetration[m]").size(), 24U);
}

// Oracle: what the files give a spread: dimensions and the hand model's, muscles only where they act,
// materials; what is measured is not drawn. The second row alone is the same motion.
TEST(Rollouts, UncertainStudiesDrawWhatHasASpread) {
  const TemporaryFolder folder;
  const auto write = [&](const char* scene, const std::string& set) {
    std::ofstream(folder.path() / "study.yaml")
        << "scene: " << test::source(scene).string() << "\nset: {" << set << "}\ncount: 3\nuncertain: true\n";
    return load_rollouts(folder.path() / "study.yaml");
  };
  const auto drawn = [](const RolloutStudy& study) {
    std::set<std::string> out;
    for (const Column& column : study.head().columns)
      if (column.role == ColumnRole::drawn) out.insert(column.name);
    return out;
  };
  const auto hands = drawn(
      RolloutStudy(write("config/two_hands.yaml", "duration: 0.02, hands.0.person.hand_length: 190 mm")));
  EXPECT_TRUE(hands.contains("hands.1.person.deviations.hand_length"));
  EXPECT_TRUE(hands.contains("hands.0.person.deviations.hand_length")) << "by the spread of measuring";
  EXPECT_TRUE(hands.contains("hands.0.person.deviations.ranges"));
  EXPECT_FALSE(hands.contains("hands.0.person.deviations.extrinsic_arms"));
  EXPECT_TRUE(
      drawn(RolloutStudy(write("config/grasp_pinch.yaml", ""))).contains("contacts.materials.0.friction"));
  EXPECT_TRUE(drawn(RolloutStudy(write("config/muscle_poses.yaml", "duration: 0.01")))
                  .contains("hands.0.person.deviations.extrinsic_arms"));
  EXPECT_THROW(RolloutStudy(write("config/slider_crank_iftomm.yaml", "")), Error) << "nothing is uncertain";
  write("config/two_hands.yaml", "duration: 0.02, solver.engine: articulated");
  const RolloutStudy study(load_rollouts(folder.path() / "study.yaml"));
  simulation::Simulation again(study.scene(1));
  while (again.steps() < again.step_count()) again.step();
  EXPECT_EQ(column(table_of(study), "state_hash")[1], simulation::hash_text(again.state_hash()));
}

class ShippedStudy : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, ShippedStudy,
                         testing::Values("rollouts_power_can", "rollouts_pinch", "rollouts_free_fall",
                                         "rollouts_handle"),
                         [](const auto& of) { return std::string(of.param); });

// Oracle: the study's own count. Some of its draws the grip refuses; that is no reason not to begin.
TEST_P(ShippedStudy, Begins) {
  if (GetParam() != std::string("rollouts_pinch"))
    HANDSIM_SKIP_WITH_SANITIZER("another study begins by the same code");
  const RolloutStudy study(load_rollouts(test::source(std::string("config/") + GetParam() + ".yaml")));
  EXPECT_EQ(study.head().size, GetParam() == std::string("rollouts_handle") ? 60 * 7 : 10000);
}

// Oracle: what the scene's own reader says of a card of 5 kg: of a study of nothing else it is the problem,
// of a study with a light card too it is a row.
TEST(Rollouts, RefuseWhatNoneOfThemCanHave) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "study.yaml";
  const auto write = [&](const std::string& masses) {
    std::ofstream(file) << "scene: " << test::source("config/grasp_pinch.yaml").string()
                        << "\nvary: {objects.0.mass: {each: [" << masses << "]}}\n";
  };
  write("20 g, 5 kg");
  EXPECT_EQ(RolloutStudy(load_rollouts(file)).head().size, 2);
  write("5 kg");
  try {
    const RolloutStudy study(load_rollouts(file));
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_TRUE(
        std::regex_search(error.what(), std::regex("^[^ ]*grasp_pinch.yaml:10:5: grasps.0: got a hand "
                                                   "of .*, need a larger hand, or a smaller or "
                                                   "lighter object$")))
        << error.what();
  }
}

// Oracle: levels in geometric and arithmetic order, with ends as written.
TEST(Rollouts, GridsAreEverything) {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "ball.yaml") << kBall;
  std::ofstream(folder.path() / "study.yaml")
      << "scene: ball.yaml\nvary:\n  objects.0.mass: {logspace: [\"10 g\", \"1 kg\", 3]}\n"
         "  duration: {linspace: [0.01, 0.03, 2]}\n";
  const std::string csv = table_of(folder.path() / "study.yaml");
  EXPECT_EQ(column(csv, "objects.0.mass"),
            (std::vector<std::string>{"0.01", "0.1", "1", "0.01", "0.1", "1"}));
  EXPECT_EQ(column(csv, "duration"),
            (std::vector<std::string>{"0.01", "0.01", "0.01", "0.03", "0.03", "0.03"}));
}

// Oracle: an object that is not held has fallen from the hand, and its run ends then; with the rest of the
// run it is not held either.
TEST(Rollouts, EndOnceTheObjectIsLost) {
  const TemporaryFolder folder;
  const auto study = [&](const char* lost) {
    std::ofstream(folder.path() / "study.yaml")
        << "scene: " << test::source("config/grasp_pinch.yaml").string()
        << "\nset: {solver.engine: articulated, grasps.0.hold: 0.3 s, "
           "grasps.0.shake.levels: [{acceleration: 4.9 m/s2, frequency: 5 Hz}]}\n"
           "vary: {contacts.materials.0.friction: {each: [0.01]}}\nstop: {lost: "
        << lost << "}\n";
    return folder.path() / "study.yaml";
  };
  const std::string stopped = table_of(study("true")), whole = table_of(study("false"));
  EXPECT_EQ(column(stopped, "held"), column(whole, "held"));
  EXPECT_EQ(column(stopped, "held").front(), "0");
  EXPECT_EQ(column(stopped, "ended").front(), "decided");
  EXPECT_EQ(column(whole, "ended").front(), "end");
  EXPECT_EQ(column(stopped, "outcome").front(), "LOST");
  const double lost = std::stod(column(stopped, "lost_at[s]").front()),
               end = std::stod(column(stopped, "ended_at[s]").front());
  EXPECT_NEAR(end - lost, simulation::kLostSpan, 2e-3);
  EXPECT_LT(end, std::stod(column(whole, "ended_at[s]").front()));
}

}  // namespace
}  // namespace handsim::study
