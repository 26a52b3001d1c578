// Mistakes on the command line and in files get a message that names the probable intention. Oracle: the form
// of messages, and the README.
#include <algorithm>

#include <gtest/gtest.h>

#include "app/program.h"

namespace handsim {
namespace {

using test::contains;
using test::Outcome;
using test::run_program;
using test::source;
using test::TemporaryFolder;
using test::write;
namespace fs = std::filesystem;

const std::string kScene = source("config/two_hands.yaml");

std::ptrdiff_t count(const std::string& text, const std::string& part) {
  std::ptrdiff_t n = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

TEST(MistypedOption, IsNamedWithTheNearest) {
  const TemporaryFolder folder;
  const std::string out = folder.path() / "out";
  struct Slip {
    std::vector<std::string> words;
    std::string part;
  };
  for (const Slip& slip : std::vector<Slip>{
           {{"run", kScene, "--out", out, "--frmes", "3"}, "--frmes: got an unknown option, need one of "},
           {{"run", kScene, "--out", out, "--frmes=3"}, "(nearest: --frames)"},
           {{"run", kScene, "--out", out, "--snapshotat", "1"}, "(nearest: --snapshot-at)"},
           {{"render", kScene, "--oot", out}, "(nearest: --out)"}}) {
    const Outcome outcome = run_program(slip.words);
    EXPECT_EQ(outcome.status, 2);
    ASSERT_EQ(outcome.problems().size(), 1U) << outcome.err;
    EXPECT_TRUE(contains(outcome.problems()[0], slip.part)) << outcome.err;
  }
  EXPECT_TRUE(test::empty_or_missing(out));
}

// An unquoted `--set duration=10 ms`.
TEST(Words, TooManyMentionQuotes) {
  const TemporaryFolder folder;
  const Outcome outcome =
      run_program({"run", kScene, "--out", (folder.path() / "out").string(), "--set", "duration=10", "ms"});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_EQ(outcome.problems(),
            std::vector<std::string>{"arguments: got one too many, ms, need no more; put a value "
                                     "that contains a blank in quotes"});
}

TEST(RenderCommand, WritesNoPictureUnderAnotherFormatsName) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "hands.jpg";
  const Outcome outcome = run_program({"render", kScene, "--out", out.string()});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(contains(outcome.err, "need a name that ends in .png")) << outcome.err;
  EXPECT_FALSE(fs::exists(out));
}

TEST(CheckCommand, ReadsMotions) {
  const TemporaryFolder folder;
  const fs::path good = write(folder.path() / "good.csv", "time,index_mcp.flexion[deg]\n0,10\n1,20\n");
  const fs::path bad = write(folder.path() / "bad.csv", "time,index_mcp.flexion[deg]\n0,10\n0,20\n");
  const Outcome taken = run_program({"check", good.string()});
  EXPECT_EQ(taken.status, 0) << taken.err;
  EXPECT_TRUE(contains(taken.out, "good.csv: a motion, good")) << taken.out;
  const Outcome refused = run_program({"check", bad.string()});
  EXPECT_EQ(refused.status, 2);
  EXPECT_TRUE(contains(refused.err, "bad.csv:3:1: time: got 0 s after 0 s, need increasing times"))
      << refused.err;
}

TEST(AFileOfAnObject, MustNotReferToAnother) {
  const TemporaryFolder folder;
  const std::string mug = source("config/objects/mug.yaml").string();
  write(folder.path() / "cup.yaml", "shape: sphere\nradius: 0.1\nmass: 1\nfile: " + mug + "\n");
  const fs::path scene =
      write(folder.path() / "s.yaml",
            "objects:\n  - {name: a, file: cup.yaml, position: [0, 0, 0]}\n"
            "  - {name: b, fil: cup.yaml, shape: sphere, radius: 1, mass: 1, position: [0, 0, 9]}\n"
            "duration: 1\n");
  const Outcome outcome = run_program({"check", scene.string()});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(contains(outcome.err, "cup.yaml:4:7: objects.0.file: got a file that refers to another"))
      << outcome.err;
  EXPECT_TRUE(contains(outcome.err, "objects.1.fil: got an unknown key") &&
              contains(outcome.err, "(nearest: file)"))
      << outcome.err;
}

TEST(Options, ThatExcludeEachOtherAreRefused) {
  const TemporaryFolder folder;
  const Outcome outcome = run_program({"run", source("config/every_pose.yaml"), "--out",
                                       (folder.path() / "out").string(), "--frames", "3", "--poses"});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(contains(outcome.err, "--frames") && contains(outcome.err, "--poses")) << outcome.err;
}

TEST(Overlaps, AreReportedOnceInAtMostElevenLines) {
  const TemporaryFolder folder;
  const std::string out = folder.path() / "out";
  const Outcome crossed = run_program({"run", kScene, "--out", out, "--set", "duration=1 ms", "--set",
                                       "hands.1.wrist.position=[0.1, 0, 0.25]"});
  EXPECT_EQ(crossed.status, 0) << crossed.err;
  EXPECT_EQ(count(crossed.err, "overlap by "), 10) << crossed.err;
  EXPECT_EQ(count(crossed.err, "more pairs overlap"), 1) << crossed.err;
  // An object in a hand is refused; there are no further warnings.
  const fs::path scene =
      write(folder.path() / "s.yaml",
            "hands: [{model: " + source("handmodels/anatomical.yaml").string() +
                ", person: " + source("config/persons/median_man.yaml").string() +
                ", side: right}]\nobjects: [{name: ball, shape: sphere, radius: 0.2, mass: 1, "
                "position: [0, 0.1, 0]}]\nduration: 1\n");
  const Outcome refused = run_program({"run", scene.string(), "--out", out});
  EXPECT_EQ(refused.status, 2);
  EXPECT_EQ(count(refused.err, "warning: "), 0) << refused.err;
  EXPECT_EQ(refused.problems().size(), 11U) << refused.err;
  EXPECT_TRUE(contains(refused.err, "ball inside hands at 5 more places") ||
              contains(refused.err, "more places"))
      << refused.err;
}

// Oracle: what is asked for and has no effect is said, what has one is not.
TEST(TendonStrain, WithoutMusclesIsAWarning) {
  const auto words = [](const char* scene) {
    const TemporaryFolder folder;
    return run_program({"run", source(scene), "--set", "hands.0.tendon_strain=0.049", "--set",
                        "duration=2 ms", "--out", folder.path() / "a"})
        .err;
  };
  const std::string given = "tendon_strain is given, but ";
  EXPECT_TRUE(contains(words("config/two_hands.yaml"), given + "the effect muscles is not on"));
  EXPECT_FALSE(contains(words("config/muscle_poses.yaml"), given));
}

TEST(EngineAuto, FindsTheShippedCostsFromAnyFolder) {
  const TemporaryFolder folder;
  const fs::path scene = write(folder.path() / "s.yaml",
                               "bodies: [{name: b, mass: 1, inertia: [1, 1, 1], position: [0, 0, 0]}]\n"
                               "solver: {engine: auto, accuracy: 0.01}\nduration: 0.1\n");
  const Outcome outcome = run_program({"run", scene.string(), "--out", (folder.path() / "out").string()});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(contains(outcome.out, "engine auto: ")) << outcome.out;
}

TEST(MotionColumns, ThatNoAxisUsesAreNamedWithTheNearest) {
  const TemporaryFolder folder;
  const fs::path motion =
      write(folder.path() / "m.csv",
            "time,index_mcp.flexion[deg],indx_pip.flexion[deg],right.pelvis_tx\n0,10,0,0\n");
  const std::vector<std::string> words = {"run",   source("config/every_pose.yaml"),
                                          "--out", (folder.path() / "out").string(),
                                          "--set", "control.program=" + motion.string(),
                                          "--set", "criteria={}",
                                          "--set", "duration=10 ms",
                                          "--set"};
  const auto with = [&](const char* joints) {
    std::vector<std::string> all = words;
    all.push_back(std::string("control.controller.gains=[{joints: ") + joints +
                  ", frequency: 8 Hz, damping_ratio: 1, torque_limit: 1}]");
    return run_program(all);
  };
  const Outcome warned = with("index_mcp.flexion");
  EXPECT_EQ(warned.status, 0) << warned.err;
  EXPECT_TRUE(contains(warned.err,
                       "m.csv:1:1: 2 columns that hand right does not use: indx_pip.flexion (nearest: "
                       "index_pip.flexion), right.pelvis_tx"))
      << warned.err;
  const Outcome held = with("[index_mcp.flexion, index_pip.flexion]");
  EXPECT_EQ(held.status, 0);
  EXPECT_TRUE(contains(held.err, "no column for index_pip.flexion of hand right: held at the start angle"))
      << held.err;
  EXPECT_TRUE(contains(held.err, "indx_pip.flexion (nearest: index_pip.flexion)")) << held.err;
}

TEST(ControlTable, SaysThatItsAnglesAreDegrees) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const Outcome outcome = run_program({"run", source("config/every_pose.yaml"), "--out", out.string(),
                                       "--set", "duration=10 ms", "--set", "criteria={}"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  for (const char* name : {"control.sto", "trajectory.mot"})
    EXPECT_TRUE(contains(test::text_of(out / name), "\ninDegrees=yes\n")) << name;
}

TEST(TheSceneItself, IsNotOverwritten) {
  if (std::string_view(HANDSIM_PYTHON_PROGRAM).empty()) GTEST_SKIP() << "built without the Python package";
  const TemporaryFolder folder;
  const fs::path scene = write(folder.path() / "s.xml", test::kBallScene);
  const Outcome outcome =
      run_program({"export", scene.string(), "--out", (folder.path() / "." / "s.xml").string()});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(contains(outcome.err, "which is also an input, need another file")) << outcome.err;
  EXPECT_EQ(test::text_of(scene), test::kBallScene);
}

TEST(GraspCutShort, IsNotMeasuredInTheTableAndExitsWithOne) {
  const TemporaryFolder folder;
  const Outcome outcome =
      run_program({"run", source("config/grasp_pinch.yaml"), "--out", (folder.path() / "out").string(),
                   "--set", "duration=0.05", "--set", "criteria={grasp_slip: 0}"});
  EXPECT_EQ(outcome.status, 1) << outcome.err;
  EXPECT_EQ(count(outcome.out, "NOT MEASURED"), 6) << outcome.out;
  const std::size_t at = outcome.out.find("grasp_slip");
  EXPECT_TRUE(contains(outcome.out.substr(at, outcome.out.find('\n', at) - at), " 0 m/s  NOT MEASURED"))
      << outcome.out;
}

}  // namespace
}  // namespace handsim
