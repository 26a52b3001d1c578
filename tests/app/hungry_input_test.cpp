// Inputs that once took all memory, all of a disk, or all time. Oracle: exit status 2 with the limit in the
// message, in a program that has little memory and no more than 10 s.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "app/program.h"
#include "support/sanitized.h"

namespace handsim {
namespace {

namespace fs = std::filesystem;
using test::contains;
using test::Outcome;
using test::source;
using test::TemporaryFolder;
using test::write;

/// The program with at most 1 GB of memory and files of at most so many bytes.
Outcome run_hungry(const std::vector<std::string>& arguments, rlim_t file_bytes = RLIM_INFINITY) {
  rlimit memory{}, file{};
  getrlimit(RLIMIT_AS, &memory);
  getrlimit(RLIMIT_FSIZE, &file);
#ifndef HANDSIM_ADDRESS_SANITIZED
  const rlimit little{1U << 30U, memory.rlim_max};
  setrlimit(RLIMIT_AS, &little);
#endif
  const rlimit small{file_bytes, file.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  const Outcome outcome = test::run_program(arguments);
  setrlimit(RLIMIT_AS, &memory);
  setrlimit(RLIMIT_FSIZE, &file);
  return outcome;
}

void expect_refused(const std::vector<std::string>& arguments, const std::string& part) {
  const Outcome outcome = run_hungry(arguments);
  EXPECT_EQ(outcome.status, 2) << outcome.err.substr(0, 2000);
  EXPECT_TRUE(contains(outcome.err, part)) << outcome.err.substr(0, 2000);
  EXPECT_LT(outcome.err.size(), 1'000'000U);
}

std::string repeated(const std::string& text, int times) {
  std::string out;
  for (int i = 0; i < times; ++i) out += text;
  return out;
}

TEST(HungryYaml, OfAliasesToALongTextIsRefused) {
  const TemporaryFolder folder;
  expect_refused(
      {"check", write(folder.path() / "a.yaml", "a: &a \"" + std::string(1'000'000, 'x') + "\"\nb: [" +
                                                    repeated("*a,", 3000) + "]\n" + test::kBallScene)
                    .string()},
      "values that take more than 256 MB");
}

TEST(HungryYaml, OfAPathOfManyKeysIsRefused) {
  const TemporaryFolder folder;
  expect_refused({"run", source("config/two_hands.yaml").string(), "--out", (folder.path() / "out").string(),
                  "--set", repeated("a.", 59'999) + "a=1"},
                 "a path of 60000 keys, need at most 64 keys");
  EXPECT_FALSE(fs::exists(folder.path() / "out"));
}

TEST(HungryYaml, WithMoreProblemsThanAnybodyReadsSaysHowMany) {
  const TemporaryFolder folder;
  std::string text = test::kBallScene;
  for (int i = 0; i < 200'000; ++i) text += "k" + std::to_string(i) + ": 1\n";
  expect_refused({"check", write(folder.path() / "a.yaml", text).string()}, "got 199000 more problems");
}

TEST(HungryPoses, ThatGrowByLikeRepeatOrNumberAreRefused) {
  const TemporaryFolder folder;
  std::string joints, likes, keys;
  for (int i = 0; i < 20'000; ++i) joints += (i > 0 ? ", j" : "j") + std::to_string(i) + ": 1 deg";
  for (int i = 1; i < 900; ++i)
    likes += "  p" + std::to_string(i) + ": {like: p" + std::to_string(i - 1) + "}\n";
  expect_refused(
      {"check", write(folder.path() / "like.yaml", "poses:\n  p0: {" + joints + "}\n" + likes).string()},
      "got 20000 keys, need at most 1000");
  for (int i = 0; i < 9000; ++i) keys += "{time: " + std::to_string(i) + ", move: 0.1, pose: p},";
  expect_refused(
      {"check", write(folder.path() / "repeat.yaml",
                      "poses:\n  p: {index_pip: 1 deg}\nprograms:\n  a:\n    repeat: {times: 10000, every: "
                      "1e5}\n    keys: [" +
                          keys + "]\n")
                    .string()},
      "got 10000 times 9000 keys, need at most 200000 keys");
}

TEST(HungryStudy, OfTooManyMethodsAndStepsIsRefused) {
  const TemporaryFolder folder;
  expect_refused(
      {"check", write(folder.path() / "a.yaml", "scene: " + source("config/slider_crank.yaml").string() +
                                                    "\nmethods: [" + repeated("{engine: ode},", 20'000) +
                                                    "]\nsteps: [" + repeated("1e-3,", 20'000) + "]\n")
                    .string()},
      "steps: got a list of 20000, need at most 100");
}

TEST(HungryContacts, OfManyRulesOnManyNamedObjectsAreRefused) {
  const TemporaryFolder folder;
  std::string objects, rules;
  for (int i = 0; i < 1000; ++i) {
    const std::string name = "a" + std::to_string(i);
    objects += "  - {name: " + name + ", shape: sphere, radius: 0.1, mass: 1, position: [" +
               std::to_string(i) + ", 0, 0]}\n";
    rules += "{between: [" + name + ", objects]},";
  }
  expect_refused({"check", write(folder.path() / "a.yaml",
                                 "duration: 1\nobjects:\n" + objects + "contacts: {rules: [" + rules +
                                     repeated("{between: [objects, objects]},", 1000) + "]}\n")
                               .string()},
                 "got rules for more than 10000000 pairs");
}

TEST(HungryTitle, IsRefused) {
  const TemporaryFolder folder;
  expect_refused({"check", write(folder.path() / "a.yaml",
                                 "title: " + std::string(100'000, 't') + "\n" + test::kBallScene)
                               .string()},
                 "title: got a text of 100000 bytes, need at most 1000 bytes");
}

class HungryProgram : public testing::Test {
 protected:
  void refuse(const std::string& name, const std::string& part) const {
    expect_refused(
        {"run", source("config/pose_tracking.yaml").string(), "--out", (folder_.path() / "out").string(),
         "--set", "control.program=" + (folder_.path() / name).string()},
        part);
    EXPECT_FALSE(fs::exists(folder_.path() / "out"));
  }
  TemporaryFolder folder_;
};

TEST_F(HungryProgram, ThatIsAPipeIsRefusedAndNotWaitedFor) {
  for (const char* name : {"a.mot", "a.sto", "a.csv"}) {
    ASSERT_EQ(mkfifo((folder_.path() / name).c_str(), 0600), 0);
    refuse(name, std::string(name) + ":1:1: got a pipe, socket or device");
  }
}

TEST_F(HungryProgram, OfManyColumnsIsReadInTime) {
  std::string labels, zeros;
  for (int i = 0; i < 300'000; ++i) {
    labels += "\tc" + std::to_string(i);
    zeros += "\t0";
  }
  write(folder_.path() / "a.mot", "a\nversion=1\nnRows=1\nnColumns=300001\ninDegrees=yes\nendheader\ntime" +
                                      labels + "\n0" + zeros + "\n");
  refuse("a.mot", "c4 and 299995 more");
}

TEST_F(HungryProgram, OfManyRowsIsRefused) {
  std::string rows = "time[s],index_pip.flexion[deg]\n";
  for (int i = 0; i < 1'000'001; ++i) rows += std::to_string(i) + ",1\n";
  write(folder_.path() / "a.csv", rows);
  refuse("a.csv", ":1000002:1: got more than 1000000 rows");
}

TEST(HungryMesh, WhoseMaterialsAreAPipeOrManyIsReadWithoutThem) {
  const TemporaryFolder folder;
  ASSERT_EQ(mkfifo((folder.path() / "pipe.mtl").c_str(), 0600), 0);
  write(folder.path() / "many.mtl", repeated("newmtl m\nmap_Kd x\n", 100'000));
  for (const char* materials : {"pipe.mtl", "many.mtl", "/dev/zero"}) {
    write(folder.path() / "x.obj",
          std::string("mtllib ") + materials +
              "\nv 1 1 1\nv -1 -1 1\nv -1 1 -1\nv 1 -1 -1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n");
    const Outcome outcome =
        run_hungry({"check", write(folder.path() / "s.yaml",
                                   "objects: [{name: a, shape: convex_mesh, mesh: x.obj, mass: 1, "
                                   "position: [0, 0, 1]}]\nduration: 0.01\n")
                                 .string()});
    EXPECT_EQ(outcome.status, 0) << materials << outcome.err;
  }
}

TEST(HungrySnapshot, ThatIsAPipeIsRefused) {
  const TemporaryFolder folder;
  const fs::path pipe = folder.path() / "snapshot.bin";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  expect_refused({"run", source("config/two_hands.yaml").string(), "--out", (folder.path() / "out").string(),
                  "--from-snapshot", pipe.string()},
                 "got a pipe, socket or device");
}

// 1000 s at every microsecond: 5.8 TB of trajectory.csv, by the rows and the 5.8 kB of one.
TEST(HungryRecord, ThatNoDiskOrFileHasRoomForIsRefusedBeforeTheRun) {
  const TemporaryFolder folder;
  std::vector<std::string> arguments = {"run", source("config/two_hands.yaml").string(), "--out",
                                        (folder.path() / "out").string()};
  for (const char* set : {"duration=1000", "solver.step=1e-6", "record.every=1e-6"})
    arguments.insert(arguments.end(), {"--set", set});
  const Outcome outcome = run_hungry(arguments, 10'000'000);
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(contains(outcome.err, "record.every: got a table of about ")) << outcome.err;
  EXPECT_TRUE(contains(outcome.err, "TB, where the system allows files of 10 MB, need ")) << outcome.err;
  EXPECT_FALSE(fs::exists(folder.path() / "out"));
}

}  // namespace
}  // namespace handsim
