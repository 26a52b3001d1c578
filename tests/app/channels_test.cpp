// Commands whose standard streams fail (closed, full disk, closed terminal or reader), and commands whose
// pictures cannot be drawn. Oracle: the README's exit statuses, and the bytes of an undisturbed run.
#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>

#include "app/short_run.h"
#include "support/sanitized.h"

namespace handsim::test {
namespace {

void to_full_disk(int stream) { dup2(open("/dev/full", O_WRONLY), stream); }

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

TEST(StandardOutput, ThatIsLostIsReportedAndGivesStatusOne) {
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
    // Without output nothing is lost; bad input keeps its status.
    EXPECT_EQ(status_with(run_into(out, {"--quiet"}), folder.path(), prepare), 0);
    EXPECT_EQ(status_with({"check", kScene, "/none.yaml"}, folder.path(), prepare), 2);
  }
}

// A file that is opened later must not get the number of a closed stream, and its messages.
TEST(ClosedStreams, SendNoMessageToAFile) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const auto close_all = [] {
    for (const int stream : {0, 1, 2}) close(stream);
    unsetenv("PYTHONUNBUFFERED");  // with it Python has nothing left to write at its end
  };
  EXPECT_EQ(status_with(run_into(out), folder.path(), close_all), 1);
  expect_whole(out);
  if (std::string_view(HANDSIM_PYTHON_PROGRAM).empty()) GTEST_SKIP() << "built without the Python package";
  EXPECT_EQ(
      status_with({"export", kScene, "--out", (folder.path() / "x.xml").string()}, folder.path(), close_all),
      1);
  EXPECT_TRUE(text_of(folder.path() / "x.xml").ends_with("</mujoco>\n"));
}

TEST(Terminal, ThatIsClosedEndsNoRunAndLosesNoFile) {
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
    EXPECT_TRUE(wait_for_lock(child));
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

#ifndef HANDSIM_SANITIZED  // sanitizers need more address space than the limits
// With too little memory Mesa or LLVM end the drawing process, in ways that differ from limit to limit.
TEST(LittleMemory, PreventsOnlyPictures) {
  const TemporaryFolder folder;
  const fs::path plenty = folder.path() / "plenty", out = folder.path() / "out",
                 picture = folder.path() / "x.png";
  const std::string small = "pictures.size=[320, 240]";
  const Words frames = {"--frames", "2", "--quiet", "--set", small};
  ASSERT_EQ(run_program(run_into(plenty, frames)).status, 0);
  int missing = 0, drawn = 0;
  for (rlim_t megabytes = 250; megabytes <= 1000; megabytes += 75) {
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
    // Pictures are complete or missing.
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

// gnuplot does not report a picture that it could not write completely.
TEST(FullDiskUnderGnuplot, LeavesNoIncompletePicture) {
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

}  // namespace
}  // namespace handsim::test
