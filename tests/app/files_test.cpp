// Files on disk after any end of a run: only complete files under final names, and nothing outside --out.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/inotify.h>
#include <sys/resource.h>

#include <array>
#include <map>

#include "app/short_run.h"
#include "handsim/control/motion_file.h"
#include "handsim/simulation/run/snapshot_file.h"

namespace handsim::test {
namespace {

const std::vector<std::string> kRun = {"run",
                                       source("config/dropped_hand.yaml").string(),
                                       "--quiet",
                                       "--frames",
                                       "2",
                                       "--snapshot-at",
                                       "0.1",
                                       "--set",
                                       "duration=0.3",
                                       "--set",
                                       "record.every=1e-3",
                                       "--set",
                                       "pictures.size=[160, 120]",
                                       "--out"};

std::map<std::string, std::string> files(const fs::path& folder) {
  std::map<std::string, std::string> out;
  if (!fs::exists(folder)) return out;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) out[fs::relative(entry.path(), folder)] = text_of(entry.path());
  return out;
}

bool is_part(const std::string& name) { return name.starts_with(".") || name.ends_with(".partial"); }

/// Every file under a final name equals that of a complete run; files that contain wall-clock times are
/// compared by their content.
void expect_whole(const fs::path& folder, const std::map<std::string, std::string>& reference) {
  for (const auto& [name, text] : files(folder)) {
    if (is_part(name)) continue;
    ASSERT_TRUE(reference.contains(name)) << name;
    if (name == "summary.json") {
      const auto json = nlohmann::json::parse(text, nullptr, false);
      ASSERT_FALSE(json.is_discarded()) << name;
      EXPECT_EQ(json["state_hash"], nlohmann::json::parse(reference.at(name))["state_hash"]);
    } else if (name == "snapshot.bin") {
      EXPECT_NO_THROW(simulation::parse_snapshot(text, name));
    } else {
      EXPECT_TRUE(text == reference.at(name)) << name;
    }
  }
}

std::vector<std::string> recorded_run(const fs::path& out) {
  std::vector<std::string> arguments = kRun;
  arguments.push_back(out.string());
  return arguments;
}

const std::map<std::string, std::string>& reference() {
  static const std::map<std::string, std::string> files_of_reference = [] {
    const TemporaryFolder folder;
    EXPECT_EQ(status_with(recorded_run(folder.path() / "out"), folder.path(), [] {}), 0)
        << text_of(folder.path() / "stderr");
    return files(folder.path() / "out");
  }();
  return files_of_reference;
}

/// Kills a run at the n-th event in its folder: a file opened, written, closed, renamed or removed.
/// @return false if the run ended before.
bool killed_at(int n, const fs::path& out) {
  const int watch = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
  inotify_add_watch(watch, out.c_str(), IN_ALL_EVENTS);
  const pid_t child = start(recorded_run(out), out.parent_path(), [] {});
  int status = 0;
  for (bool ended = false; n > 0 && !ended;) {
    // Events from before the end are read after it.
    ended = waitpid(child, &status, WNOHANG) == child;
    pollfd ready{watch, POLLIN, 0};
    poll(&ready, 1, ended ? 0 : 5);
    alignas(inotify_event) std::array<char, 4096> buffer;
    const ssize_t size = read(watch, buffer.data(), buffer.size());
    for (ssize_t at = 0; at < size; --n)
      at += static_cast<ssize_t>(sizeof(inotify_event) +
                                 reinterpret_cast<const inotify_event*>(buffer.data() + at)->len);
    if (ended) {
      close(watch);
      return false;
    }
  }
  kill(child, SIGKILL);
  close(watch);
  return wait_for(child) == -SIGKILL;
}

// Oracle: byte equality with the files of an undisturbed run.
TEST(KilledRun, LeavesOnlyCompleteFilesUnderTheirNames) {
  ASSERT_EQ(reference().size(), 8U);
  const TemporaryFolder folder;
  int killed = 0, unfinished = 0;
  bool again = true;
  for (int n = 1; again; n += 1 + n / 8) {
    const fs::path out = folder.path() / std::to_string(n);
    fs::create_directory(out);
    again = killed_at(n, out);
    killed += again ? 1 : 0;
    expect_whole(out, reference());
    unfinished += fs::exists(out / "summary.json") ? 0 : 1;
    // The remains of an earlier run do not disturb the next.
    if (killed % 8 == 1) {
      EXPECT_EQ(status_with(recorded_run(out), folder.path(), [] {}), 0) << text_of(folder.path() / "stderr");
      EXPECT_TRUE(fs::exists(out / "summary.json"));
    }
  }
  EXPECT_GT(killed, 10);
  EXPECT_GT(unfinished, 5);
}

// A limit on the size of files. Most limits are detected before the run; a limit that is too small by a few
// bytes is not.
TEST(FullDisk, IsReportedAndLeavesOnlyCompleteFiles) {
  const std::size_t largest = reference().at("trajectory.csv").size();
  int foreseen = 0, late = 0;
  for (const std::size_t bytes : {std::size_t{0}, std::size_t{100}, std::size_t{1000}, std::size_t{5000},
                                  std::size_t{20'000}, largest / 2, largest - 1}) {
    const TemporaryFolder folder;
    const fs::path out = folder.path() / "out";
    const int status = status_with(recorded_run(out), folder.path(), [&] {
      const rlimit limit{bytes, bytes};
      setrlimit(RLIMIT_FSIZE, &limit);
    });
    const bool ran = fs::exists(out);
    EXPECT_EQ(status, ran ? 1 : 2) << bytes;
    ++(ran ? late : foreseen);
    expect_whole(out, reference());
    EXPECT_FALSE(fs::exists(out / "trajectory.csv")) << bytes;
    EXPECT_FALSE(fs::exists(out / "summary.json")) << bytes;
    for (const auto& [name, text] : files(out)) EXPECT_FALSE(is_part(name)) << name;
  }
  EXPECT_GE(foreseen, 5);
  EXPECT_GE(late, 1);
}

TEST(ReadOnlyFolder, IsReportedBeforeTheRun) {
  const TemporaryFolder folder;
  std::vector<fs::path> places = {"/proc/handsim_out", "/proc/self"};
  if (geteuid() != 0) {
    // The superuser may write anywhere.
    fs::create_directory(folder.path() / "closed");
    fs::permissions(folder.path() / "closed", fs::perms::owner_read | fs::perms::owner_exec);
    places.push_back(folder.path() / "closed");
  }
  for (const fs::path& place : places) {
    EXPECT_EQ(status_with(recorded_run(place), folder.path(), [] {}), 2) << place;
    const std::string message = text_of(folder.path() / "stderr");
    EXPECT_NE(message.find(place.string()), std::string::npos) << message;
  }
}

/// True if a name anywhere below a folder contains a word.
bool anything_named(const fs::path& folder, const std::string& word) {
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    if (entry.path().filename().string().find(word) != std::string::npos) return true;
  return false;
}

// Texts in a scene that would leave the folder if used as paths, or would act as commands of gnuplot or the
// shell.
TEST(WordsInAScene, WriteNothingOutsideTheRunsFolder) {
  const std::vector<std::string> titles = {"../escaped",
                                           "/tmp/handsim_escaped",
                                           "x\\n!touch escaped\\n",
                                           "x\\nsystem 'touch escaped'\\n",
                                           "`touch escaped`",
                                           "$(touch escaped)",
                                           "'; set output 'escaped'; plot x; '",
                                           "x\\nendheader\\ntime\\tescaped\\n0\\t1"};
  for (const std::string& title : titles) {
    const TemporaryFolder folder;
    const fs::path inside = folder.path() / "a" / "b";
    fs::create_directories(inside);
    std::string text = text_of(source("config/every_pose.yaml"));
    for (std::size_t at = 0; (at = text.find("../", at)) != std::string::npos; at += 1)
      text.replace(at, 3, source("").string());
    for (std::size_t at = 0; (at = text.find("person: persons", at)) != std::string::npos; at += 9)
      text.replace(at, 15, "person: " + source("config/persons").string());
    const std::size_t line = text.find("title:");
    text.replace(line, text.find('\n', line) - line, "title: \"" + title + "\"");
    std::ofstream(inside / "scene.yaml") << text;
    const int status =
        status_with({"run", "scene.yaml", "--out", "out", "--plots", "--set", "duration=0.05"}, inside, [&] {
          if (chdir(inside.c_str()) != 0) _exit(125);
        });
    const std::string message = text_of(inside / "stderr");
    EXPECT_NE(status, 2) << title << message;
    EXPECT_TRUE(fs::exists(inside / "out/plots/right_angles.png")) << title << message;
    EXPECT_FALSE(anything_named(folder.path(), "escaped")) << title;
    EXPECT_FALSE(fs::exists("/tmp/handsim_escaped"));
    // The title is not interpreted.
    const control::MotionTable table = control::read_motion(inside / "out/trajectory.mot");
    EXPECT_EQ(std::find(table.names.begin(), table.names.end(), "escaped"), table.names.end());
  }
}

TEST(ExpectedHash, DecidesTheExitStatusAndIsPrintedWithTheActualOne) {
  const TemporaryFolder folder;
  const std::string hash = nlohmann::json::parse(reference().at("summary.json"))["state_hash"];
  std::vector<std::string> arguments = recorded_run(folder.path() / "out");
  arguments.insert(arguments.end(), {"--expect-hash", hash});
  EXPECT_EQ(run_program(arguments).status, 0);
  arguments.back() = "0123456789abcdef";
  const Outcome other = run_program(arguments);
  EXPECT_EQ(other.status, 1);
  EXPECT_NE(other.err.find(hash), std::string::npos) << other.err;
  EXPECT_NE(other.err.find("0123456789abcdef"), std::string::npos);
  arguments.back() = "12";
  EXPECT_EQ(run_program(arguments).status, 2);
}

TEST(Snapshot, IsContinuedByTheCommandLineAndRefusedIfItDoesNotFit) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "snapshot.bin";
  std::ofstream(file, std::ios::binary) << reference().at("snapshot.bin");
  const auto continue_run = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"run",        source("config/dropped_hand.yaml").string(),
                                          "--out",      (folder.path() / "out").string(),
                                          "--set",      "duration=0.3",
                                          "--quiet",    "--from-snapshot",
                                          file.string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program(arguments);
  };
  const std::string hash = nlohmann::json::parse(reference().at("summary.json"))["state_hash"];
  EXPECT_EQ(continue_run({"--expect-hash", hash}).status, 0);
  fs::remove_all(folder.path() / "out");
  const Outcome other = continue_run({"--set", "solver.erp=0.3"});
  EXPECT_EQ(other.status, 2);
  EXPECT_NE(other.err.find("differs in solver.erp"), std::string::npos) << other.err;
  EXPECT_EQ(continue_run({"--set", "duration=0.05"}).status, 2);
  EXPECT_EQ(continue_run({"--snapshot-at", "0.05"}).status, 2);
  fs::resize_file(file, 100);
  const Outcome torn = continue_run({});
  EXPECT_EQ(torn.status, 2);
  EXPECT_NE(torn.err.find("torn"), std::string::npos) << torn.err;
  EXPECT_FALSE(fs::exists(folder.path() / "out"));
}

}  // namespace
}  // namespace handsim::test
