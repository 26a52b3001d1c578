#include "handsim/simulation/run/run.h"

#include <gtest/gtest.h>

#include <cmath>

#include <nlohmann/json.hpp>

#include "handsim/model/kinematics.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"
#include "support/peak_memory.h"
#include "support/read_png.h"

namespace handsim::simulation {
namespace {

using test::peak_memory;
using test::shipped_scene;
using test::TemporaryFolder;
using test::text_of;

RunResult run_into(const scene::Scene& scene, const std::filesystem::path& out, int frames = 0) {
  RunOptions options;
  options.out = out;
  options.frames = frames;
  return run(scene, options);
}

TEST(MainScene, HoldsItsCriteria) {
  const TemporaryFolder folder;
  const RunResult result = run_into(shipped_scene("two_hands"), folder.path());
  for (const Verdict& verdict : result.verdicts) {
    EXPECT_TRUE(verdict.limit.has_value()) << verdict.name;
    EXPECT_TRUE(verdict.held()) << verdict.name << " " << verdict.measured.value_or(NAN) << " at "
                                << verdict.where;
  }
  EXPECT_TRUE(result.passed());
}

// The fingers do fall, and every finger's flexion ends on its extension stop: the scene would pass its
// criteria with hands that never move.
TEST(MainScene, FingersEndOnTheirStops) {
  const scene::Scene scene = shipped_scene("two_hands");
  Simulation simulation(scene);
  for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
  const std::vector<double> q = simulation.state().q;
  for (const model::Joint& joint : scene.model.joints) {
    if (joint.name.find("thumb") != std::string::npos) continue;
    EXPECT_NEAR(q[static_cast<std::size_t>(joint.first_dof)], joint.axes[0].stop->low, 1e-3) << joint.name;
    EXPECT_GT(joint.axes[0].initial, joint.axes[0].stop->low + 0.3) << joint.name;
  }
}

class BothMethods : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, BothMethods, ::testing::Values("world_step", "quick_step"));

// Oracle: bit equality. dropped_hand has contacts, so that rows come and go.
TEST_P(BothMethods, ResolvedSceneRepeatsTheTrajectoryToTheBit) {
  for (const char* name : {"two_hands", "dropped_hand"}) {
    const TemporaryFolder first, second;
    const std::string method = std::string("solver.method=") + GetParam();
    run_into(shipped_scene(name, {method, "duration=0.5"}), first.path());
    run_into(scene::load_scene(first.path() / "resolved.yaml"), second.path());
    const std::string trajectory = text_of(first.path() / "trajectory.csv");
    EXPECT_GT(trajectory.size(), 10'000U);
    EXPECT_EQ(trajectory, text_of(second.path() / "trajectory.csv")) << name;
    EXPECT_EQ(text_of(first.path() / "resolved.yaml"), text_of(second.path() / "resolved.yaml"));
  }
}

// Oracle: the mirror in the world's y-z plane, which maps the right hand's placement onto the left's.
TEST(MirroredScene, StaysMirroredTo1e9OverOneSecond) {
  const scene::Scene scene = shipped_scene("two_hands");
  Simulation simulation(scene);
  const model::HandIndex& right = scene.model.hands[0];
  const model::HandIndex& left = scene.model.hands[1];
  double worst = 0;
  for (int i = 0; i < 1000; ++i) {
    simulation.step();
    for (std::size_t b = 0; b < right.bodies.size(); ++b) {
      const model::BodyState& r = simulation.state().bodies[static_cast<std::size_t>(right.bodies[b])];
      const model::BodyState& l = simulation.state().bodies[static_cast<std::size_t>(left.bodies[b])];
      worst = std::max(worst, (mirrored(r.p) - l.p).norm());
      worst = std::max(worst, rotation_vector(mirrored(r.q) * l.q.conjugate()).norm());
    }
  }
  EXPECT_LE(worst, 1e-9);
}

TEST(Effects, AreBuiltOnlyWhereTheSceneListsThem) {
  const scene::Scene dry = shipped_scene("two_hands");
  Simulation without(dry);
  for (int i = 0; i < 100; ++i) without.step();
  EXPECT_FALSE(without.engine().tests_contacts());
  EXPECT_EQ(without.get<Ledger>().collide_calls(), 0);

  const scene::Scene wet = shipped_scene("dropped_hand");
  Simulation with(wet);
  for (int i = 0; i < 100; ++i) with.step();
  EXPECT_TRUE(with.engine().tests_contacts());
  EXPECT_GT(with.get<Ledger>().collide_calls(), 0);

  const scene::Scene floating = shipped_scene("two_hands", {"effects=[]", "criteria={}"});
  Simulation still(floating);
  for (int i = 0; i < 100; ++i) still.step();
  // Without gravity, stops and tissue nothing moves a hand that starts at rest.
  const std::vector<double> before = model::initial_state(floating.model).q;
  const std::vector<double> after = still.state().q;
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_NEAR(after[i], before[i], 1e-14);
}

TEST(Pictures, AreMadeOnRequestOnly) {
  const scene::Scene scene = shipped_scene("two_hands", {"duration=0.05", "pictures.size=[160, 120]"});
  const TemporaryFolder folder;
  run_into(scene, folder.path());
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "contact_sheet.png"));
  run_into(scene, folder.path(), 3);
  for (const char* name : {"frame_000.png", "frame_001.png", "frame_002.png", "contact_sheet.png"})
    EXPECT_TRUE(std::filesystem::exists(folder.path() / name)) << name;
}

TEST(Summary, HasVerdictsLedgerCountsAndVersions) {
  const TemporaryFolder folder;
  const scene::Scene scene = shipped_scene("dropped_hand", {"duration=0.3"});
  run_into(scene, folder.path());
  const auto summary = nlohmann::json::parse(text_of(folder.path() / "summary.json"));
  EXPECT_EQ(summary["counts"]["steps"], 300);
  EXPECT_GT(summary["counts"]["contacts"], 0);
  EXPECT_EQ(summary["ledger"]["effects"].size(), 7U);
  for (const auto& entry : summary["ledger"]["phases"]) EXPECT_GT(entry["ns_per_step"], 0) << entry["name"];
  EXPECT_EQ(summary["counts"]["notes"], summary["notes"].size());
  EXPECT_EQ(summary["solver"]["seed"], 1);
  EXPECT_NE(summary["versions"]["engine"].get<std::string>().find("ODE"), std::string::npos);
  // A scene with contacts has penetration and tunnelling among them.
  EXPECT_EQ(summary["criteria"].size(), 6U);
}

TEST(FailedRun, SaysWhereAndKeepsItsFiles) {
  const TemporaryFolder folder;
  const scene::Scene scene = shipped_scene("two_hands", {"criteria.joint_gap=1e-9"});
  const RunResult result = run_into(scene, folder.path());
  EXPECT_FALSE(result.passed());
  EXPECT_EQ(nlohmann::json::parse(text_of(folder.path() / "summary.json"))["verdict"], "failed");
}

// 60 pictures of 0.9 MB would be 55 MB; the first ten have warmed the renderer up.
TEST(Pictures, AreHandedOnAsTheyAreDrawnAndNotKept) {
  const scene::Scene scene = shipped_scene("two_hands", {"pictures.size=[640, 480]"});
  const std::vector<PictureState> moments(70, {model::initial_state(scene.model), {}});
  double before = 0;
  std::size_t drawn = 0;
  draw({scene.model, scene.spec.pictures}, moments, {}, {}, [&](std::size_t i, const Picture& picture) {
    EXPECT_EQ(i, drawn++);
    EXPECT_EQ(picture.image.width, 640);
    if (i == 10) before = peak_memory();
  });
  EXPECT_EQ(drawn, 70U);
  EXPECT_LT(peak_memory() - before, 10 << 20);
}

// Oracle: the file names, and a sheet of no more than 100 cells for any number of pictures.
TEST(Pictures, OfALongRunAreAllFilesAndThinnedOutOnTheSheet) {
  const TemporaryFolder folder;
  run_into(shipped_scene("two_hands", {"pictures.size=[32, 24]", "duration=0.5"}), folder.path(), 150);
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "frame_000.png"));
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "frame_149.png"));
  const output::Image sheet = test::read_png(folder.path() / "contact_sheet.png");
  EXPECT_LT(sheet.height, 100 / 4 * 100);
}

}  // namespace
}  // namespace handsim::simulation
