#include "handsim/simulation/run/snapshot_file.h"

#include <gtest/gtest.h>

#include <future>
#include <set>

#include <nlohmann/json.hpp>

#include "handsim/core/archive.h"
#include "handsim/simulation/run/run.h"
#include "scene_files.h"
#include "simulation/run/snapshot_cases.h"
#include "support/sanitized.h"

namespace handsim::simulation {
namespace {

using test::shipped_scene;
using test::TemporaryFolder;
using test::text_of;
using test_cases::Case;
using test_cases::cases;
using test_cases::steps;

class EveryEngine : public ::testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(, EveryEngine, ::testing::ValuesIn(cases()),
                         [](const auto& each) { return each.param.name; });

/// All that a run shows of itself but the times it took, bit for bit: a snapshot less the clock's readings.
void expect_same(const Simulation& a, const Simulation& b) {
  ArchiveWriter state_a, state_b;
  serialize(state_a, a.state());
  serialize(state_b, b.state());
  EXPECT_EQ(state_a.bytes(), state_b.bytes());
  EXPECT_EQ(a.state_hash(), b.state_hash());
  EXPECT_EQ(a.steps(), b.steps());
  if (a.find<ContactSums>()) {
    const auto pairs_a = a.get<ContactSums>().pairs(), pairs_b = b.get<ContactSums>().pairs();
    ASSERT_EQ(pairs_a.size(), pairs_b.size());
    for (std::size_t i = 0; i < pairs_a.size(); ++i) {
      EXPECT_EQ(pairs_a[i].first, pairs_b[i].first);
      EXPECT_EQ(pairs_a[i].second.normal_time, pairs_b[i].second.normal_time);
      EXPECT_EQ(pairs_a[i].second.largest_at, pairs_b[i].second.largest_at);
    }
    EXPECT_FALSE(pairs_a.empty());
  }
  EXPECT_EQ(a.get<Ledger>().contacts(), b.get<Ledger>().contacts());
  EXPECT_EQ(a.get<Convergence>().lcp_failures(), b.get<Convergence>().lcp_failures());
  EXPECT_EQ(a.get<Convergence>().iterative_steps(), b.get<Convergence>().iterative_steps());
  EXPECT_EQ(a.get<Monitor>().joint_gap().value, b.get<Monitor>().joint_gap().value);
  EXPECT_EQ(a.get<Monitor>().joint_gap().where, b.get<Monitor>().joint_gap().where);
  EXPECT_EQ(a.get<Monitor>().stop_overshoot().value, b.get<Monitor>().stop_overshoot().value);
  if (a.find<Tunnelling>()) {
    EXPECT_EQ(a.get<Tunnelling>().penetration().value, b.get<Tunnelling>().penetration().value);
    EXPECT_EQ(a.get<Tunnelling>().penetration().where, b.get<Tunnelling>().penetration().where);
  }
  const std::vector<ClimbFigures> climbs_a = a.figures<Climbs>(), climbs_b = b.figures<Climbs>();
  ASSERT_EQ(climbs_a.size(), climbs_b.size());
  for (std::size_t i = 0; i < climbs_a.size(); ++i) {
    EXPECT_EQ(climbs_a[i].carried, climbs_b[i].carried);
    EXPECT_EQ(climbs_a[i].travel, climbs_b[i].travel);
    EXPECT_EQ(climbs_a[i].half.parts.size(), climbs_b[i].half.parts.size());
  }
  const std::vector<AxisTracking> tracking_a = a.figures<Tracking>(), tracking_b = b.figures<Tracking>();
  ASSERT_EQ(tracking_a.size(), tracking_b.size());
  for (std::size_t i = 0; i < tracking_a.size(); ++i) {
    EXPECT_EQ(tracking_a[i].rms_error, tracking_b[i].rms_error);
    EXPECT_EQ(tracking_a[i].largest_error.value, tracking_b[i].largest_error.value);
    EXPECT_EQ(tracking_a[i].steady_error.value, tracking_b[i].steady_error.value);
    EXPECT_EQ(tracking_a[i].overshoot.value, tracking_b[i].overshoot.value);
    EXPECT_EQ(tracking_a[i].settling_time.value, tracking_b[i].settling_time.value);
    EXPECT_EQ(tracking_a[i].movements, tracking_b[i].movements);
    EXPECT_EQ(tracking_a[i].limit_share, tracking_b[i].limit_share);
  }
}

// Oracle: bit equality of states, hash and figures with the run that never stopped, in a fresh simulation
// from a file's bytes and in one that has meanwhile gone elsewhere.
TEST_P(EveryEngine, GoesOnFromASnapshotAsIfNeverStopped) {
  const Case& what = GetParam();
  const int after = test::kSanitized ? what.after / 10 : what.after;
  const scene::Scene scene = shipped_scene(what.scene, what.overrides);
  Simulation whole(scene);
  steps(whole, what.before);
  const RunSnapshot snapshot = whole.snapshot();
  steps(whole, after);
  const bool touching = what.name.starts_with("contact") || what.name == "articulated_contact";
  EXPECT_TRUE(!touching || whole.get<Ledger>().contacts() > after);

  Simulation fresh(scene);
  fresh.restore(parse_snapshot(snapshot_text(snapshot), "bytes"));
  steps(fresh, after);
  expect_same(fresh, whole);

  Simulation elsewhere(scene);
  steps(elsewhere, 37);
  elsewhere.restore(snapshot);
  steps(elsewhere, after);
  expect_same(elsewhere, whole);
}

std::uint64_t hash_of(const scene::Scene& scene, int count) {
  Simulation simulation(scene);
  steps(simulation, count);
  return simulation.state_hash();
}

// Oracle: bit equality with a run alone: repeated, in eight threads at once, with other scenes stepping
// beside, and after a reset.
TEST_P(EveryEngine, GivesTheSameBitsInThreadsAndAgain) {
  constexpr int kSteps = test::kSanitized ? 60 : 300;
  const Case& what = GetParam();
  const scene::Scene scene = shipped_scene(what.scene, what.overrides);
  const std::uint64_t alone = hash_of(scene, kSteps);
  EXPECT_EQ(hash_of(scene, kSteps), alone) << "repeated";

  std::vector<std::future<std::uint64_t>> threads;
  for (int i = 0; i < 8; ++i)
    threads.push_back(std::async(std::launch::async, [&] { return hash_of(scene, kSteps); }));
  for (auto& thread : threads) EXPECT_EQ(thread.get(), alone) << "in a thread";

  const scene::Scene other = shipped_scene("dropped_hand", {"solver.method=quick_step", "solver.seed=7"});
  Simulation simulation(scene), beside(other);
  const RunSnapshot start = simulation.snapshot();
  for (int i = 0; i < kSteps; ++i) simulation.step(), beside.step();
  EXPECT_EQ(simulation.state_hash(), alone) << "beside another";
  simulation.restore(start);
  steps(simulation, kSteps);
  EXPECT_EQ(simulation.state_hash(), alone) << "after a reset";
}

// Oracle: bit equality with the run that was never reset, in the same simulation and in one that shares its
// scene.
TEST_P(EveryEngine, GoesOnFromAMotionAsIfNeverReset) {
  const Case& what = GetParam();
  const int before = std::min(what.before, 400), after = test::kSanitized ? 30 : 300;
  const auto scene = std::make_shared<const scene::Scene>(shipped_scene(what.scene, what.overrides));
  Simulation whole(scene, no_watchers), other(scene, no_watchers);
  const auto bits = [](const Simulation& of) {
    ArchiveWriter out;
    serialize(out, of.state());
    return out.take();
  };
  steps(whole, before);
  const MotionSnapshot motion = whole.motion();
  EXPECT_EQ(motion.time(), whole.state().time);
  steps(whole, after);
  const std::string end = bits(whole);
  steps(other, 37);
  for (Simulation* each : {&whole, &other}) {
    each->reset(motion);
    EXPECT_EQ(each->steps(), before);
    steps(*each, after);
    EXPECT_EQ(bits(*each), end);
  }
}

// Oracle: bit equality of what threads read of one simulation at once; the thread sanitizer finds what they
// would change.
TEST_P(EveryEngine, IsReadByManyThreadsAtOnce) {
  const Case& what = GetParam();
  Simulation simulation(shipped_scene(what.scene, what.overrides));
  for (int round = 0; round < 5; ++round) {
    simulation.step();
    const Simulation& now = simulation;
    std::vector<std::future<std::string>> threads;
    for (int i = 0; i < 4; ++i)
      threads.push_back(std::async(std::launch::async, [&] {
        static_cast<void>(now.verdicts());
        static_cast<void>(now.warnings());
        return std::to_string(now.state_hash()) + now.snapshot().bytes + now.engine().version();
      }));
    const std::string first = threads.front().get();
    for (std::size_t i = 1; i < threads.size(); ++i) EXPECT_EQ(threads[i].get(), first);
  }
}

// Loading shares parsed files and hand models between threads, and editing a scene's text must not reach the
// others. Oracle: bit equality with scenes that are loaded one after the other; the thread sanitizer.
TEST(Scenes, LoadedInThreadsAreThoseLoadedAlone) {
  const auto hash = [](int i) {
    const std::string stature = "hands.0.person.stature=" + std::to_string(1.5 + 0.05 * (i % 5));
    scene::Scene scene = shipped_scene(i % 2 == 0 ? "two_hands" : "dropped_hand", {stature});
    return hash_of(scene, 2);
  };
  constexpr int kThreads = 4, kScenes = 10;
  std::vector<std::future<std::vector<std::uint64_t>>> threads;
  for (int thread = 0; thread < kThreads; ++thread)
    threads.push_back(std::async(std::launch::async, [&, thread] {
      std::vector<std::uint64_t> out(kScenes);
      for (int i = 0; i < kScenes; ++i) {
        const int which = (i + 3 * thread) % kScenes;
        out[static_cast<std::size_t>(which)] = hash(which);
      }
      return out;
    }));
  std::vector<std::uint64_t> alone;
  for (auto& thread : threads) {
    const std::vector<std::uint64_t> hashes = thread.get();
    for (int i = 0; alone.size() < kScenes; ++i) alone.push_back(hash(i));
    EXPECT_EQ(hashes, alone);
  }
  EXPECT_EQ(std::set<std::uint64_t>(alone.begin(), alone.end()).size(), alone.size());
}

// A world that has come to grief leaves no trace in others.
TEST(Divergence, LeavesOtherSimulationsAsTheyWere) {
  const scene::Scene scene = shipped_scene("dropped_hand");
  const scene::Scene wild = shipped_scene("slider_crank_torque",
                                          {"solver.step=0.05", "solver.erp=1", "joints.0.axes.0.torque=1e4"});
  Simulation simulation(scene);
  for (int i = 0; i < 300; ++i) {
    if (i % 50 == 7) {
      Simulation lost(wild);
      EXPECT_THROW(steps(lost, 1000), Error);
    }
    simulation.step();
  }
  EXPECT_EQ(simulation.state_hash(), hash_of(scene, 300));
}

TEST(Snapshot, OfAnotherSceneIsRefusedWithWhatDiffers) {
  const scene::Scene scene = shipped_scene("dropped_hand");
  Simulation simulation(scene);
  steps(simulation, 20);
  const RunSnapshot snapshot = simulation.snapshot();
  const auto refusal = [&](const scene::Scene& other) -> std::string {
    Simulation into(other);
    const std::uint64_t before = into.state_hash();
    try {
      into.restore(snapshot);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::input);
      EXPECT_EQ(into.state_hash(), before);
      return error.what();
    }
    return "taken";
  };
  EXPECT_EQ(refusal(shipped_scene("dropped_hand", {"title=other", "duration=9", "record.every=0.1",
                                                   "criteria.joint_gap=1", "pictures.floor=false"})),
            "taken");
  for (const auto& [change, part] :
       std::vector<std::pair<std::string, std::string>>{{"solver.step=\"2 ms\"", "solver.step"},
                                                        {"solver.seed=2", "solver.seed"},
                                                        {"hands.0.side=right", "hands.0"},
                                                        {"objects.1.density=601", "objects.1"},
                                                        {"gravity=[0, 0, -9.8]", "gravity.2"},
                                                        {"ground.height=-1e-9", "ground.height"}})
    EXPECT_NE(refusal(shipped_scene("dropped_hand", {change})).find("differs in " + part), std::string::npos)
        << change << refusal(shipped_scene("dropped_hand", {change}));
  EXPECT_NE(refusal(scene::without_effect(scene, model::Effect::friction)).find("effects.friction"),
            std::string::npos);
}

TEST(ContinuedRun, HasTheTablesOfTheRestAndTheSummaryOfAll) {
  const TemporaryFolder folder;
  const scene::Scene scene = shipped_scene("dropped_hand", {"duration=0.4"});
  RunOptions options;
  options.out = folder.path() / "whole";
  options.snapshot_at = 0.2;
  const RunResult whole = run(scene, options);
  options = {};
  options.out = folder.path() / "rest";
  options.from_snapshot = folder.path() / "whole" / "snapshot.bin";
  options.expected_hash = whole.state_hash;
  const RunResult rest = run(scene, options);
  EXPECT_TRUE(rest.hash_as_expected());
  EXPECT_EQ(rest.continued_from, 0.2);
  const std::string all = text_of(folder.path() / "whole" / "trajectory.csv");
  const std::string tail = text_of(folder.path() / "rest" / "trajectory.csv");
  const std::size_t header = all.find('\n') + 1;
  EXPECT_EQ(tail.substr(0, header), all.substr(0, header));
  EXPECT_TRUE(all.ends_with("\n" + tail.substr(header)));
  EXPECT_TRUE(tail.substr(header).starts_with("0.2,"));
  const auto json = [](const RunResult& result) { return nlohmann::json::parse(result.summary); };
  for (const char* key : {"criteria", "counts", "state_hash"}) EXPECT_EQ(json(whole)[key], json(rest)[key]);
}

// Oracle: the rows of the run that never stopped, in every table of text.
TEST(ContinuedRun, HasTheRowsOfMusclesFromTheSnapshotOn) {
  const TemporaryFolder folder;
  const scene::Scene scene = shipped_scene("muscle_poses", {"duration=0.1", "solver.engine=articulated"});
  RunOptions options;
  options.out = folder.path() / "whole";
  options.snapshot_at = 0.05;
  run(scene, options);
  options = {};
  options.out = folder.path() / "rest";
  options.from_snapshot = folder.path() / "whole" / "snapshot.bin";
  run(scene, options);
  for (const char* table : {"muscles.sto", "control.sto", "trajectory.mot", "trajectory.csv"}) {
    const std::string all = text_of(folder.path() / "whole" / table);
    std::string tail = text_of(folder.path() / "rest" / table);
    tail = tail.substr(tail.find("\n0.05") + 1);
    EXPECT_TRUE(tail.starts_with("0.05")) << table;
    EXPECT_TRUE(all.ends_with("\n" + tail)) << table;
  }
}

}  // namespace
}  // namespace handsim::simulation
