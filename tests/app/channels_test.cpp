// What becomes of a command whose channels fail (closed, full, a terminal or reader that goes away), whose
// pictures cannot be drawn, and whose --out is taken or in the way. Oracle: the README's exit statuses, and
// the bytes of a run that was left alone.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <thread>

#include <nlohmann/json.hpp>

#include "app/program.h"

namespace handsim::test {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;
using namespace std::chrono_literals;

const std::string kScene = source("config/two_hands.yaml").string();

/// A run of a fraction of a second.
Words run_into(const fs::path& out, const Words& more = {}) {
  Words words = {"run", kScene, "--out", out.string(), "--set", "duration=0.1"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// Starts the program; `prepare` runs in the child, after standard error and output have gone to files.
pid_t start(Words words, const fs::path& folder, const std::function<void()>& prepare) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child != 0) return child;
  const std::string out = folder / "stdout", err = folder / "stderr";
  if (!std::freopen(out.c_str(), "wb", stdout) || !std::freopen(err.c_str(), "wb", stderr)) _exit(126);
  std::vector<char*> argv = {const_cast<char*>(HANDSIM_PROGRAM)};
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  alarm(60);
  prepare();
  execv(HANDSIM_PROGRAM, argv.data());
  _exit(127);
}

/// Exit status; minus the signal that ended the program.
int wait_for(pid_t child) {
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

int status_with(const Words& words, const fs::path& folder, const std::function<void()>& prepare) {
  return wait_for(start(words, folder, prepare));
}

void to_full_disk(int stream) { dup2(open("/dev/full", O_WRONLY), stream); }

/// The tables of the run that is left alone.
const std::string& trajectory() {
  static const std::string text = [] {
    const TemporaryFolder folder;
    EXPECT_EQ(run_program(run_into(folder.path() / "out")).status, 0);
    return text_of(folder.path() / "out/trajectory.csv");
  }();
  return text;
}

void expect_whole(const fs::path& out) {
  EXPECT_TRUE(text_of(out / "trajectory.csv") == trajectory());
  EXPECT_FALSE(nlohmann::json::parse(text_of(out / "summary.json"), nullptr, false).is_discarded());
  EXPECT_TRUE(fs::exists(out / "resolved.yaml"));
}

TEST(StandardError, ThatCannotBeWrittenChangesNoExitStatus) {
  const TemporaryFolder folder;
  const fs::path bad = write(folder.path() / "bad.yaml", "title: [\n"), out = folder.path() / "out";
  for (const auto& prepare : std::vector<std::function<void()>>{[] { to_full_disk(2); }, [] { close(2); },
                                                                [] {
                                                                  close(0);
                                                                  close(2);
                                                                }}) {
    EXPECT_EQ(status_with({"check", bad}, folder.path(), prepare), 2);
    EXPECT_EQ(status_with({"rum"}, folder.path(), prepare), 2);
    EXPECT_EQ(status_with(run_into(out, {"--quiet"}), folder.path(), prepare), 0);
    expect_whole(out);
    EXPECT_EQ(
        status_with(run_into(out, {"--quiet", "--set", "criteria.joint_gap=0"}), folder.path(), prepare), 1);
    expect_whole(out);
  }
}

TEST(StandardOutput, ThatIsLostIsSaidAndGivesStatusOne) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const auto to_nobody = [] {
    int ends[2];
    if (pipe(ends) != 0) _exit(125);
    close(ends[0]);
    dup2(ends[1], 1);
  };
  for (const auto& prepare :
       std::vector<std::function<void()>>{[] { to_full_disk(1); }, [] { close(1); }, to_nobody}) {
    for (const Words& words : {Words{"check", kScene}, Words{"--help"}, Words{"--version"}, run_into(out),
                               run_into(out, {"--json"})}) {
      EXPECT_EQ(status_with(words, folder.path(), prepare), 1) << words[0];
      EXPECT_TRUE(contains(text_of(folder.path() / "stderr"), "standard output was lost"));
    }
    expect_whole(out);
    // Nothing to print, nothing lost; what is bad stays bad.
    EXPECT_EQ(status_with(run_into(out, {"--quiet"}), folder.path(), prepare), 0);
    EXPECT_EQ(status_with({"check", kScene, "/none.yaml"}, folder.path(), prepare), 2);
  }
}

// A file that is opened later must not get the number of a closed stream, and messages with it.
TEST(ClosedStreams, LetNoMessageIntoAFile) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const auto close_all = [] {
    for (const int stream : {0, 1, 2}) close(stream);
  };
  EXPECT_EQ(status_with(run_into(out), folder.path(), close_all), 1);
  expect_whole(out);
  EXPECT_EQ(
      status_with({"export", kScene, "--out", (folder.path() / "x.xml").string()}, folder.path(), close_all),
      1);
  EXPECT_TRUE(text_of(folder.path() / "x.xml").ends_with("</mujoco>\n"));
}

TEST(Terminal, ThatGoesAwayEndsNoRunAndLosesNoFile) {
  for (const bool controlling : {false, true}) {
    const TemporaryFolder folder;
    const fs::path out = folder.path() / "out";
    const int master = posix_openpt(O_RDWR | O_NOCTTY);
    ASSERT_GE(master, 0);
    ASSERT_EQ(grantpt(master) + unlockpt(master), 0);
    const std::string name = ptsname(master);
    const int terminal = open(name.c_str(), O_RDWR | O_NOCTTY);
    ASSERT_GE(terminal, 0);
    Words words = run_into(out, {"--set", "duration=12", "--set", "record.every=0.1"});
    const pid_t child = start(words, folder.path(), [&] {
      close(master);
      setsid();
      if (controlling) ioctl(terminal, TIOCSCTTY, 0);
      for (const int stream : {0, 1, 2}) dup2(terminal, stream);
      close(terminal);
    });
    close(terminal);
    // The run has begun as soon as its folder is there.
    while (!fs::exists(out) && kill(child, 0) == 0) std::this_thread::sleep_for(5ms);
    std::this_thread::sleep_for(50ms);
    close(master);
    // The table went to the terminal, too.
    EXPECT_EQ(wait_for(child), 1) << controlling;
    EXPECT_TRUE(fs::exists(out / "trajectory.csv"));
    EXPECT_TRUE(fs::exists(out / "summary.json"));
  }
}

TEST(QuietRun, NamesTheCriterionThatFails) {
  const TemporaryFolder folder;
  const Outcome outcome =
      run_program(run_into(folder.path() / "out", {"--quiet", "--set", "criteria.joint_gap=0"}));
  EXPECT_EQ(outcome.status, 1);
  EXPECT_EQ(outcome.out, "");
  ASSERT_EQ(outcome.problems().size(), 1U) << outcome.err;
  EXPECT_TRUE(outcome.problems()[0].starts_with("criterion joint_gap: got ")) << outcome.err;
  EXPECT_TRUE(contains(outcome.err, "need at most 0 m")) << outcome.err;
}

TEST(OneFolder, IsForOneRunAtATime) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out", link = folder.path() / "link";
  const pid_t first = start(run_into(out, {"--set", "duration=200"}), folder.path(), [] {});
  while (!fs::exists(out)) std::this_thread::sleep_for(5ms);
  std::this_thread::sleep_for(50ms);
  fs::create_directory_symlink(out, link);
  for (const fs::path& name : {out, link, folder.path() / "." / "out"}) {
    const Outcome second = run_program(run_into(name));
    EXPECT_EQ(second.status, 2);
    EXPECT_TRUE(second.err.starts_with("--out: got " + name.string() + ", in use by another handsim"))
        << second.err;
  }
  EXPECT_EQ(run_program({"hand", "--stature", "1.7", "--mass", "60", "--sex", "male", "--out", out}).status,
            2);
  // The kernel's lock goes with the process.
  kill(first, SIGKILL);
  EXPECT_EQ(wait_for(first), -SIGKILL);
  EXPECT_EQ(run_program(run_into(out)).status, 0);
  expect_whole(out);
}

TEST(OneFolder, OfTenRunsAtOnceHoldsOneWholeRun) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  std::vector<pid_t> children;
  for (int i = 0; i < 10; ++i) {
    fs::create_directory(folder.path() / std::to_string(i));
    children.push_back(start(run_into(out), folder.path() / std::to_string(i), [] {}));
  }
  int good = 0;
  for (const pid_t child : children) {
    const int status = wait_for(child);
    EXPECT_TRUE(status == 0 || status == 2) << status;
    good += status == 0 ? 1 : 0;
  }
  EXPECT_GE(good, 1);
  expect_whole(out);
  for (const auto& entry : fs::directory_iterator(out))
    EXPECT_FALSE(entry.path().filename().string().starts_with(".")) << entry.path();
}

TEST(EarlierRun, IsGoneFromItsFolderAndForeignFilesStay) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const std::string scene = source("config/dropped_hand.yaml");
  const Words rich = {"run",           scene,
                      "--out",         out.string(),
                      "--frames",      "4",
                      "--snapshot-at", "0.01",
                      "--set",         "duration=0.02",
                      "--set",         "pictures.size=[64, 48]",
                      "--set",         "record.contacts=true",
                      "--quiet"};
  EXPECT_EQ(run_program(rich).status, 0);
  EXPECT_TRUE(fs::exists(out / "frame_003.png") && fs::exists(out / "snapshot.bin") &&
              fs::exists(out / "contacts.csv"));
  const Words foreign = {"notes.txt",         "frame_final.png", "frame_1.png",
                         "frame_000.png.bak", "my_summary.json", ".hidden"};
  for (const std::string& name : foreign) write(out / name, "mine");
  write(out / ".handsim.1.abc.part", "left by a killed run");
  EXPECT_EQ(run_program(run_into(out, {"--frames", "2", "--set", "pictures.size=[64, 48]"})).status, 0);
  expect_whole(out);
  Words names, due = {"contact_sheet.png", "frame_000.png",  "frame_001.png", "resolved.yaml",
                      "summary.json",      "trajectory.csv", "trajectory.mot"};
  due.insert(due.end(), foreign.begin(), foreign.end());
  for (const auto& entry : fs::directory_iterator(out)) names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  std::sort(due.begin(), due.end());
  EXPECT_EQ(names, due);
  // Bad input starts no run: all stays.
  EXPECT_EQ(run_program(run_into(out, {"--set", "solver.stepp=1"})).status, 2);
  EXPECT_EQ(run_program(run_into(out, {"--snapshot-at", "5"})).status, 2);
  EXPECT_EQ(static_cast<std::size_t>(std::distance(fs::directory_iterator(out), fs::directory_iterator())),
            due.size());
}

TEST(EarlierRun, LeavesNoSummaryBesideTheTablesOfARunThatFails) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  ASSERT_EQ(run_program(run_into(out)).status, 0);
  const std::size_t table = text_of(out / "trajectory.csv").size(),
                    summary = text_of(out / "summary.json").size();
  ASSERT_GT(table, summary);
  // A disk that takes the summary but not the table, and the other way round.
  for (const char* every : {"1e-3", "0.1"}) {
    ASSERT_EQ(run_program(run_into(out)).status, 0);
    const rlim_t most = every[0] == '1' ? summary + 1000 : summary - 10;
    EXPECT_EQ(status_with(run_into(out, {"--set", std::string("record.every=") + every}), folder.path(),
                          [&] {
                            const rlimit limit{most, most};
                            setrlimit(RLIMIT_FSIZE, &limit);
                          }),
              1);
    EXPECT_FALSE(fs::exists(out / "summary.json")) << every;
    EXPECT_TRUE(contains(text_of(folder.path() / "stderr"), out.string() + "/"))
        << text_of(folder.path() / "stderr");
    EXPECT_TRUE(contains(text_of(folder.path() / "stderr"), "File too large"));
  }
}

TEST(InputFiles, AreNeverReplaced) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  ASSERT_EQ(run_program(run_into(out, {"--snapshot-at", "0.05"})).status, 0);
  const std::string resolved = text_of(out / "resolved.yaml"), snapshot = text_of(out / "snapshot.bin");
  fs::create_directory(folder.path() / "d");
  const fs::path xml = write(folder.path() / "d/scene.xml", kBallScene),
                 png = write(folder.path() / "d/scene.png", kBallScene);
  fs::create_symlink("scene.xml", folder.path() / "d/link.xml");
  fs::create_hard_link(png, folder.path() / "d/hard.png");
  const std::vector<Words> all = {{"run", out / "resolved.yaml", "--out", out},
                                  run_into(out, {"--from-snapshot", out / "snapshot.bin"}),
                                  {"export", xml, "--out", xml},
                                  {"export", xml, "--out", folder.path() / "d/../d/scene.xml"},
                                  {"export", xml, "--out", folder.path() / "d/link.xml"},
                                  {"render", png, "--out", png},
                                  {"render", png, "--out", folder.path() / "d/hard.png"}};
  for (const Words& words : all) {
    const Outcome outcome = run_program(words);
    EXPECT_EQ(outcome.status, 2) << words[0];
    EXPECT_TRUE(outcome.err.starts_with("--out: got ") && contains(outcome.err, "is read")) << outcome.err;
  }
  EXPECT_EQ(text_of(out / "resolved.yaml"), resolved);
  EXPECT_EQ(text_of(out / "snapshot.bin"), snapshot);
  EXPECT_EQ(text_of(xml), kBallScene);
  EXPECT_EQ(text_of(png), kBallScene);
}

/// Puts one of the things that are no files under a name.
void put_odd(const fs::path& at, const std::string& kind) {
  if (kind == "a folder") fs::create_directory(at);
  if (kind == "a pipe") mkfifo(at.c_str(), 0600);
  if (kind == "a device") fs::create_symlink("/dev/null", at);
  if (kind == "a link that leads to no file") fs::create_symlink("nothing", at);
  if (kind != "a socket") return;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  ASSERT_LT(at.string().size(), sizeof address.sun_path);
  at.string().copy(address.sun_path, sizeof address.sun_path - 1);
  const int socket_file = socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(bind(socket_file, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  close(socket_file);
}

TEST(InTheWay, WhatIsNoFileIsRefusedBeforeTheRunAndStays) {
  for (const std::string kind :
       {"a folder", "a pipe", "a device", "a socket", "a link that leads to no file"}) {
    const TemporaryFolder folder;
    for (const char* name : {"x.png", "x.xml", "x.urdf"}) {
      const fs::path at = folder.path() / name;
      put_odd(at, kind);
      const fs::file_type type = fs::symlink_status(at).type();
      const Outcome outcome = run_program({name[2] == 'p' ? "render" : "export", kScene, "--out", at});
      EXPECT_EQ(outcome.status, 2);
      EXPECT_TRUE(contains(outcome.err, at.string() + ": got " + kind)) << outcome.err;
      EXPECT_EQ(fs::symlink_status(at).type(), type) << kind;
    }
    for (const char* name :
         {"trajectory.csv", "summary.json", "frame_000.png", "contact_sheet.png", "plots/right_angles.png"}) {
      const fs::path out = folder.path() / "out";
      fs::create_directories((out / name).parent_path());
      put_odd(out / name, kind);
      const Outcome outcome = run_program(run_into(out, {"--set", "duration=100"}));
      EXPECT_EQ(outcome.status, 2) << kind << name;
      EXPECT_TRUE(contains(outcome.err, (out / name).string() + ": got a ")) << outcome.err;
      EXPECT_EQ(std::distance(fs::directory_iterator(out), fs::directory_iterator()), 1);
      fs::remove_all(out);
    }
  }
  const TemporaryFolder folder;
  write(folder.path() / "plots", "mine");
  EXPECT_EQ(run_program(run_into(folder.path())).status, 2);
  EXPECT_EQ(text_of(folder.path() / "plots"), "mine");
}

TEST(LongNames, AreRefusedBeforeTheRun) {
  const TemporaryFolder folder;
  for (const char* command : {"render", "export"}) {
    const fs::path at = folder.path() / std::string(300, 'x');
    const Outcome outcome = run_program({command, kScene, "--out", at});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_TRUE(contains(outcome.err, "got a file that cannot be created (File name too long)"))
        << outcome.err;
  }
  fs::create_symlink("loop", folder.path() / "loop");
  EXPECT_EQ(run_program({"render", kScene, "--out", folder.path() / "loop"}).status, 2);
}

TEST(Export, WritesTheFormatThatTheEndingSays) {
  const TemporaryFolder folder;
  struct Case {
    const char* name;
    Words more;
    const char* holds;  ///< null: refused
  };
  const std::vector<Case> cases = {{"a.urdf", {}, "<robot"},
                                   {"a.xml", {}, "<mujoco"},
                                   {"a.XML", {}, "<mujoco"},
                                   {"a", {}, "<mujoco"},
                                   {"b", {"--format", "urdf"}, "<robot"},
                                   {"b.urdf", {"--format", "urdf"}, "<robot"},
                                   {"c.urdf", {"--format", "mjcf"}, nullptr},
                                   {"c.xml", {"--format", "urdf"}, nullptr},
                                   {"c.sdf", {}, nullptr},
                                   {"c.v2", {"--format", "mjcf"}, nullptr}};
  for (const Case& each : cases) {
    const fs::path out = folder.path() / each.name;
    Words words = {"export", kScene, "--out", out};
    words.insert(words.end(), each.more.begin(), each.more.end());
    const Outcome outcome = run_program(words);
    EXPECT_EQ(outcome.status, each.holds ? 0 : 2) << each.name << outcome.err;
    EXPECT_EQ(fs::exists(out), each.holds != nullptr) << each.name;
    if (each.holds) {
      EXPECT_TRUE(contains(text_of(out), each.holds)) << each.name;
    } else {
      EXPECT_TRUE(contains(outcome.err, "--out: got " + out.string() + ", need a name that ends in ."))
          << outcome.err;
    }
  }
  for (const char* name : {"a.jpg", "a.png.txt", "a.pngx"})
    EXPECT_EQ(run_program({"render", kScene, "--out", folder.path() / name}).status, 2) << name;
}

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define HANDSIM_SANITIZED  // sanitizers take more address space than there is
#endif
#endif
#if !defined(HANDSIM_SANITIZED) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
// Below some limit Mesa or LLVM end the process that draws, in ways that differ from limit to limit.
TEST(LittleMemory, CostsPicturesAndNothingElse) {
  const TemporaryFolder folder;
  const fs::path plenty = folder.path() / "plenty", out = folder.path() / "out",
                 picture = folder.path() / "x.png";
  const std::string small = "pictures.size=[320, 240]";
  const Words frames = {"--frames", "2", "--quiet", "--set", small};
  ASSERT_EQ(run_program(run_into(plenty, frames)).status, 0);
  int missing = 0, drawn = 0;
  for (rlim_t megabytes = 250; megabytes <= 1000; megabytes += 50) {
    const auto limited = [&] {
      const rlimit limit{megabytes << 20U, megabytes << 20U};
      setrlimit(RLIMIT_AS, &limit);
    };
    SCOPED_TRACE(megabytes);
    const int status = status_with(run_into(out, frames), folder.path(), limited);
    ASSERT_TRUE(status == 0 || status == 1) << status;
    expect_whole(out);
    const auto summary = nlohmann::json::parse(text_of(out / "summary.json"));
    EXPECT_EQ(summary["verdict"], "held");
    EXPECT_EQ(summary.contains("missing"), status == 1);
    EXPECT_EQ(contains(text_of(folder.path() / "stderr"), "missing: pictures: "), status == 1);
    (status == 1 ? missing : drawn) += 1;
    // No picture is drawn by halves.
    for (const char* name : {"frame_000.png", "frame_001.png", "contact_sheet.png"})
      EXPECT_TRUE(status == 1 || text_of(out / name) == text_of(plenty / name)) << name;
    const int rendered =
        status_with({"render", kScene, "--out", picture, "--set", small}, folder.path(), limited);
    ASSERT_TRUE(rendered == 0 || rendered == 1) << rendered;
    EXPECT_EQ(fs::exists(picture), rendered == 0);
    fs::remove(picture);
  }
  EXPECT_GE(missing, 1);
  EXPECT_GE(drawn, 1);
}
#endif

// gnuplot says nothing of a picture that it could not write to its end.
TEST(FullDiskUnderGnuplot, GivesNoTornPictureAName) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const Words words = {"run",     source("config/every_pose.yaml"),
                       "--out",   out,
                       "--plots", "--quiet",
                       "--set",   "duration=0.1",
                       "--set",   "criteria={}",
                       "--set",   "record.every=0.05"};
  ASSERT_EQ(status_with(words, folder.path(), [] {}), 0) << text_of(folder.path() / "stderr");
  rlim_t tables = 0, plots = 1U << 30U;
  for (const auto& entry : fs::directory_iterator(out))
    if (entry.is_regular_file()) tables = std::max<rlim_t>(tables, entry.file_size());
  for (const auto& entry : fs::directory_iterator(out / "plots"))
    if (entry.path().extension() == ".png") plots = std::min<rlim_t>(plots, entry.file_size());
  ASSERT_LT(tables + 1000, plots);
  EXPECT_EQ(status_with(words, folder.path(),
                        [&] {
                          const rlimit limit{tables + 1000, tables + 1000};
                          setrlimit(RLIMIT_FSIZE, &limit);
                        }),
            1);
  EXPECT_TRUE(contains(text_of(folder.path() / "stderr"), "missing: plots: "))
      << text_of(folder.path() / "stderr");
  EXPECT_TRUE(contains(text_of(out / "summary.json"), "\"missing\""));
  EXPECT_TRUE(fs::exists(out / "trajectory.csv"));
  for (const auto& entry : fs::directory_iterator(out / "plots"))
    EXPECT_EQ(entry.path().extension(), ".gp") << entry.path();
}

TEST(GraspStudy, RefusesTwoScenesThatWouldShareAFolder) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const std::string scene = source("config/grasp_pinch.yaml");
  const Outcome outcome =
      run_program({"grasp", scene, source("config/../config/grasp_pinch.yaml"), "--out", out});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(contains(outcome.err, "whose name another has")) << outcome.err;
  EXPECT_FALSE(fs::exists(out));
}

}  // namespace
}  // namespace handsim::test
