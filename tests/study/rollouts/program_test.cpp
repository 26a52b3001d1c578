// `handsim rollouts` as a user starts it: killed and resumed, in shards, as ranks of a job, one of them
// again.
#include <sys/wait.h>

#include <chrono>
#include <csignal>
#include <regex>
#include <thread>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "app/program.h"
#include "places.h"
#include "study/rollouts/studies.h"

namespace handsim {
namespace {

using test::contains;
using test::Outcome;
using test::run_program;
using test::TemporaryFolder;
using test::text_of;
using test::write_study;
namespace fs = std::filesystem;
using Words = std::vector<std::string>;

Words rollouts(const fs::path& study, const fs::path& out, const Words& more = {}) {
  Words words = {"rollouts", study.string(), "--out", out.string()};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// Starts a program without waiting for it; what it prints is thrown away.
pid_t start(const Words& words) {
  const pid_t child = fork();
  if (child != 0) return child;
  if (!std::freopen("/dev/null", "wb", stdout) || !std::freopen("/dev/null", "wb", stderr)) _exit(126);
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  execvp(argv[0], argv.data());
  _exit(127);
}

/// Waits until the journal has rows beside its head, at most a minute.
bool journal_grows(const fs::path& file) {
  std::uintmax_t first = 0;
  for (int i = 0; i < 6000; ++i) {
    std::error_code missing;
    const auto size = fs::file_size(file, missing);
    if (!missing && first == 0) first = size;
    if (!missing && size > first) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

void expect_same_files(const fs::path& a, const fs::path& b) {
  for (const char* file : {"rollouts.csv", "rollouts.h5", "summary.json"}) {
    EXPECT_TRUE(text_of(a / file) == text_of(b / file)) << file;
    EXPECT_FALSE(text_of(a / file).empty()) << file;
  }
}

/// Long enough to be killed in the middle.
const Words kLonger = {"--count", "40", "--chunk", "2"};

Words with(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

// Oracle: the unbroken study.
TEST(RolloutsProgram, KilledAndResumedGivesTheSameBytes) {
  const TemporaryFolder folder;
  const fs::path study = write_study(folder.path()), whole = folder.path() / "whole",
                 out = folder.path() / "out";
  ASSERT_EQ(run_program(rollouts(study, whole, kLonger)).status, 0);
  const pid_t child = start(with({test::kProgramFile}, rollouts(study, out, with(kLonger, {"--jobs", "1"}))));
  ASSERT_TRUE(journal_grows(out / study::kJournalName));
  kill(child, SIGKILL);
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status)) << "it was done before it was killed";
  EXPECT_FALSE(fs::exists(out / "rollouts.csv"));
  const Outcome refused = run_program(rollouts(study, out, kLonger));
  EXPECT_EQ(refused.status, 2);
  EXPECT_TRUE(contains(refused.err, "need --resume")) << refused.err;
  const Outcome resumed = run_program(rollouts(study, out, with(kLonger, {"--resume"})));
  EXPECT_EQ(resumed.status, 0) << resumed.err;
  expect_same_files(whole, out);
  // A job that a cluster starts once more finds it done.
  EXPECT_TRUE(
      contains(run_program(rollouts(study, out, with(kLonger, {"--resume"}))).out, "complete already"));
}

// Oracle: Ctrl-C ends it with a message, and nothing that was done is lost.
TEST(RolloutsProgram, InterruptedKeepsWhatIsDone) {
  const TemporaryFolder folder;
  const fs::path study = write_study(folder.path()), out = folder.path() / "out";
  const pid_t child = start(with({test::kProgramFile}, rollouts(study, out, with(kLonger, {"--jobs", "1"}))));
  ASSERT_TRUE(journal_grows(out / study::kJournalName));
  kill(child, SIGINT);
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 1);
  EXPECT_FALSE(study::read_journal(out / study::kJournalName).rows.empty());
  EXPECT_EQ(run_program(rollouts(study, out, with(kLonger, {"--resume"}))).status, 0);
}

// Oracle: the whole study's bytes.
TEST(RolloutsProgram, ShardsMerge) {
  const TemporaryFolder folder;
  const fs::path study = write_study(folder.path()), whole = folder.path() / "whole",
                 out = folder.path() / "out";
  ASSERT_EQ(run_program(rollouts(study, whole)).status, 0);
  for (const char* shard : {"1/2", "2/2"}) {
    const Outcome missing = run_program({"rollouts", "merge", out.string()});
    EXPECT_EQ(missing.status, 2);
    ASSERT_EQ(run_program(rollouts(study, out, {"--shard", shard})).status, 0);
  }
  const Outcome merged = run_program({"rollouts", "merge", out.string()});
  EXPECT_EQ(merged.status, 0) << merged.err;
  expect_same_files(whole, out);
  EXPECT_EQ(run_program(rollouts(study, out, {"--shard", "3/2"})).status, 2);
}

// Oracle: the row's state_hash, and a run's files.
TEST(RolloutsProgram, OneIsRunAgainWithItsFiles) {
  const TemporaryFolder folder;
  const fs::path study = write_study(folder.path()), out = folder.path() / "out",
                 again = folder.path() / "again";
  ASSERT_EQ(run_program(rollouts(study, out)).status, 0);
  std::istringstream csv(text_of(out / "rollouts.csv"));
  std::string row;
  for (int i = 0; i < 9; ++i) std::getline(csv, row);
  const std::string hash = row.substr(row.rfind(',') + 1);
  const Outcome outcome = run_program({"run", study.string(), "--rollout", "7", "--out", again.string(),
                                       "--expect-hash", hash, "--frames", "1"});
  EXPECT_FALSE(contains(outcome.err, "state hash")) << outcome.err;
  EXPECT_TRUE(contains(text_of(again / "summary.json"), hash));
  for (const char* file : {"trajectory.csv", "resolved.yaml", "frame_000.png"})
    EXPECT_TRUE(fs::exists(again / file)) << file;
  const Outcome beyond = run_program({"run", study.string(), "--rollout", "12", "--out", again.string()});
  EXPECT_EQ(beyond.status, 2);
  EXPECT_TRUE(contains(beyond.err, "--rollout: got 12, need 0 to 11")) << beyond.err;
}

// Oracle: the finished study's bytes, which another seed must not replace.
TEST(RolloutsProgram, ResumeLeavesAnotherFinishedStudyAlone) {
  const TemporaryFolder folder;
  const fs::path study = write_study(folder.path()), out = folder.path() / "out";
  ASSERT_EQ(run_program(rollouts(study, out)).status, 0);
  const std::string before = text_of(out / "rollouts.csv");
  const Outcome other = run_program(rollouts(study, out, {"--resume", "--seed", "77"}));
  EXPECT_EQ(other.status, 2);
  EXPECT_TRUE(contains(other.err, "(seed 3, study ")) << other.err;
  EXPECT_TRUE(contains(other.err, "(seed 77, study ")) << other.err;
  EXPECT_EQ(text_of(out / "rollouts.csv"), before);
  EXPECT_FALSE(fs::exists(out / study::kJournalName));
}

// Oracle: 50 GB of zeros after a journal are refused; they are not read.
TEST(RolloutsProgram, ASparseJournalIsRefused) {
  const TemporaryFolder folder;
  const fs::path study = write_study(folder.path()), out = folder.path() / "out",
                 journal = out / "shard_01_of_02" / study::kJournalName;
  ASSERT_EQ(run_program(rollouts(study, out, {"--shard", "1/2"})).status, 0);
  const auto size = fs::file_size(journal);
  fs::resize_file(journal, std::uintmax_t{50} << 30U);
  const Outcome outcome = run_program(rollouts(study, out, {"--shard", "1/2", "--resume"}));
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(contains(outcome.err, "bytes after the last whole record")) << outcome.err;
  // What a crash may leave: no more than one record.
  fs::resize_file(journal, size + 4096);
  EXPECT_EQ(run_program(rollouts(study, out, {"--shard", "1/2", "--resume"})).status, 0);
  EXPECT_EQ(fs::file_size(journal), size);
}

// Oracle: a table that cannot be written costs no row: a folder is in its place, and the exit status is that
// of lost output.
TEST(RolloutsProgram, ATableThatCannotBeWrittenLeavesItsRows) {
  const TemporaryFolder folder;
  const fs::path study = write_study(folder.path()), out = folder.path() / "out";
  const pid_t child = start(with({test::kProgramFile}, rollouts(study, out, with(kLonger, {"--jobs", "1"}))));
  ASSERT_TRUE(journal_grows(out / study::kJournalName));
  fs::create_directories(out / "rollouts.h5" / "in_the_way");
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 1) << "status " << status;
  fs::remove_all(out / "rollouts.h5");
  EXPECT_EQ(study::read_journal(out / study::kJournalName).rows.size(), 80U);
  const Outcome resumed = run_program(rollouts(study, out, with(kLonger, {"--resume"})));
  EXPECT_EQ(resumed.status, 0) << resumed.err;
  EXPECT_TRUE(contains(resumed.out, "  0 rollouts in ")) << resumed.out;
}

// Oracle: one process. Processes of one job, as mpirun and MPICH's or Slurm's starters tell them by their
// environment, are its shards; a rank that was killed goes on with --resume, and `merge` writes the bytes of
// one process.
TEST(RolloutsProgram, RanksOfAJobAreItsShards) {
  const TemporaryFolder folder;
  const fs::path study = write_study(folder.path()), whole = folder.path() / "whole";
  ASSERT_EQ(run_program(rollouts(study, whole, kLonger)).status, 0);
  for (const auto& [rank, size] :
       {std::pair("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"), {"PMI_RANK", "PMI_SIZE"}}) {
    const fs::path out = folder.path() / rank;
    const auto of_rank = [&, rank = rank, size = size](int k, const Words& more) {
      const Words job = {"env", fmt::format("{}={}", rank, k), fmt::format("{}=3", size), test::kProgramFile};
      return start(with(job, rollouts(study, out, with(kLonger, more))));
    };
    std::vector<pid_t> job;
    for (int k = 0; k < 3; ++k) job.push_back(of_rank(k, {}));
    ASSERT_TRUE(journal_grows(out / "shard_03_of_03" / study::kJournalName));
    kill(job[2], SIGKILL);
    int status = 0;
    for (const pid_t process : job) waitpid(process, &status, 0);
    waitpid(of_rank(2, {"--resume"}), &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
    EXPECT_FALSE(fs::exists(out / "rollouts.csv"));
    EXPECT_EQ(run_program({"rollouts", "merge", out.string()}).status, 0);
    expect_same_files(whole, out);
  }
}

}  // namespace
}  // namespace handsim
