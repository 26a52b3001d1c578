// `handsim rollouts` as a user starts it: killed and resumed, in shards, under mpirun, one of them again.
#include <sys/wait.h>

#include <chrono>
#include <csignal>
#include <regex>
#include <thread>

#include <gtest/gtest.h>

#include "app/program.h"
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
  const pid_t child = start(with({HANDSIM_PROGRAM}, rollouts(study, out, with(kLonger, {"--jobs", "1"}))));
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
  const pid_t child = start(with({HANDSIM_PROGRAM}, rollouts(study, out, with(kLonger, {"--jobs", "1"}))));
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
  const pid_t child = start(with({HANDSIM_PROGRAM}, rollouts(study, out, with(kLonger, {"--jobs", "1"}))));
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

#ifdef HANDSIM_MPIRUN

/// Without the leak sanitizer, which reports what OpenMPI's components leave when they are unloaded.
Words mpirun(const Words& options, const Words& rest) {
  Words words = {HANDSIM_MPIRUN, "--allow-run-as-root", "--oversubscribe", "-x",
                 "ASAN_OPTIONS=detect_leaks=0"};
  words.insert(words.end(), options.begin(), options.end());
  words.push_back(HANDSIM_PROGRAM);
  return with(words, rest);
}

int finish(pid_t child) {
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// Oracle: one process.
TEST(RolloutsProgram, FourRanksGiveTheSameBytes) {
  const TemporaryFolder folder;
  const fs::path study = write_study(folder.path()), whole = folder.path() / "whole",
                 out = folder.path() / "out";
  ASSERT_EQ(run_program(rollouts(study, whole)).status, 0);
  ASSERT_EQ(finish(start(mpirun({"-n", "4"}, rollouts(study, out, {"--chunk", "1"})))), 0);
  expect_same_files(whole, out);
}

/// The processes of this program that work on an output folder, by their ranks' order of start.
std::vector<pid_t> ranks_of(const fs::path& out) {
  std::vector<pid_t> found;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    const std::string words = text_of(entry.path() / "cmdline");
    if (words.starts_with(HANDSIM_PROGRAM) && contains(words, out.string())) found.push_back(std::stoi(name));
  }
  std::sort(found.begin(), found.end());
  return found;
}

// Oracle: the unbroken study. A rank that dies ends the job; --resume completes it.
TEST(RolloutsProgram, ADeadRankCostsItsChunk) {
  const TemporaryFolder folder;
  const fs::path study = write_study(folder.path()), whole = folder.path() / "whole",
                 out = folder.path() / "out";
  ASSERT_EQ(run_program(rollouts(study, whole, kLonger)).status, 0);
  const pid_t job = start(mpirun({"-n", "3"}, rollouts(study, out, kLonger)));
  ASSERT_TRUE(journal_grows(out / study::kJournalName));
  const std::vector<pid_t> ranks = ranks_of(out);
  ASSERT_EQ(ranks.size(), 3U);
  kill(ranks.back(), SIGKILL);
  EXPECT_NE(finish(job), 0);
  EXPECT_FALSE(fs::exists(out / "rollouts.csv"));
  ASSERT_EQ(finish(start(mpirun({"-n", "3"}, rollouts(study, out, with(kLonger, {"--resume"}))))), 0);
  expect_same_files(whole, out);
}

/// Runs a line in a shell; false where it fails.
bool shell(const std::string& line) { return std::system((line + " >/dev/null 2>&1").c_str()) == 0; }

/// A network namespace with one end of a cable whose other end is here: a second host.
class SecondHost {
 public:
  SecondHost() {
    up_ = shell("ip netns add " + name_) && shell("ip link add hsveth0 type veth peer name hsveth1") &&
          shell("ip link set hsveth1 netns " + name_) && shell("ip addr add 10.83.0.1/24 dev hsveth0") &&
          shell("ip link set hsveth0 up") &&
          shell("ip netns exec " + name_ + " ip addr add 10.83.0.2/24 dev hsveth1") &&
          shell("ip netns exec " + name_ + " ip link set hsveth1 up") &&
          shell("ip netns exec " + name_ + " ip link set lo up");
  }
  ~SecondHost() {
    shell("ip link del hsveth0");
    shell("ip netns del " + name_);
  }
  bool up() const { return up_; }
  const std::string& name() const { return name_; }

 private:
  std::string name_ = "handsim_host";
  bool up_ = false;
};

// Oracle: one process. Two hosts that share nothing but a network (and the disk, as in a cluster).
TEST(RolloutsProgram, TwoHostsGiveTheSameBytes) {
  const SecondHost host;
  if (!host.up()) GTEST_SKIP() << "network namespaces are not permitted here (ip netns add needs root)";
  const TemporaryFolder folder;
  const fs::path study = write_study(folder.path()), whole = folder.path() / "whole",
                 out = folder.path() / "out";
  ASSERT_EQ(run_program(rollouts(study, whole)).status, 0);
  // mpirun reaches a host by `AGENT HOST COMMAND...`.
  const fs::path agent = folder.path() / "agent";
  test::write(agent, "#!/bin/sh\ntouch " + (folder.path() / "reached").string() +
                         "\nshift\nexec ip netns exec " + host.name() + " sh -c \"$*\"\n");
  fs::permissions(agent, fs::perms::owner_all);
  const Words two = {"-n",
                     "4",
                     "--host",
                     "10.83.0.1:2,10.83.0.2:2",
                     "--mca",
                     "plm_rsh_agent",
                     agent.string(),
                     "--mca",
                     "btl",
                     "tcp,self",
                     "--mca",
                     "btl_tcp_if_include",
                     "10.83.0.0/24",
                     "--mca",
                     "oob_tcp_if_include",
                     "10.83.0.0/24"};
  EXPECT_EQ(finish(start(mpirun(two, rollouts(study, out, {"--chunk", "1"})))), 0);
  EXPECT_TRUE(fs::exists(folder.path() / "reached"));
  expect_same_files(whole, out);
}

#endif

}  // namespace
}  // namespace handsim
