// Atomic files, the locked output folder, and jobs in child processes.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <new>
#include <set>

#include "handsim/core/error.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/child.h"
#include "handsim/output/output_folder.h"
#include "scene_files.h"

namespace handsim::output {
namespace {

namespace fs = std::filesystem;
using test::TemporaryFolder;
using test::text_of;

std::size_t entries(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(AtomicFile, TwoWritersOfOneNameShareNothing) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.txt";
  AtomicFile first(path), second(path);
  first.write("first");
  second.write("second, longer");
  first.write(" goes on");
  EXPECT_FALSE(fs::exists(path));
  second.commit();
  EXPECT_EQ(text_of(path), "second, longer");
  first.commit();
  EXPECT_EQ(text_of(path), "first goes on");
  EXPECT_EQ(entries(folder.path()), 1U);
}

TEST(AtomicFile, ThatIsNotCommittedLeavesNothingAndTheOldFileStays) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.txt";
  write_file(path, "old");
  {
    AtomicFile file(path);
    file.write("new");
  }
  EXPECT_EQ(text_of(path), "old");
  EXPECT_EQ(entries(folder.path()), 1U);
}

TEST(AtomicFile, FollowsALinkAndKeepsTheUsersMask) {
  const TemporaryFolder folder;
  write_file(folder.path() / "real", "old");
  fs::create_symlink("real", folder.path() / "link");
  const mode_t before = umask(027);
  write_file(folder.path() / "link", "new");
  umask(before);
  EXPECT_TRUE(fs::is_symlink(folder.path() / "link"));
  EXPECT_EQ(text_of(folder.path() / "real"), "new");
  EXPECT_EQ(fs::status(folder.path() / "real").permissions(), fs::perms{0640});
}

// A name may have 255 bytes; a temporary name must fit, too.
TEST(AtomicFile, AcceptsTheLongestPossibleName) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / std::string(255, 'x');
  write_file(path, "whole");
  EXPECT_EQ(text_of(path), "whole");
  EXPECT_THROW(write_file(folder.path() / std::string(256, 'x'), ""), Error);
}

TEST(AtomicFile, ToAFullDiskIsAnErrorOfOutput) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.txt";
  // The limit of the file size applies to a child process only.
  const auto job = [&](const Progress&) {
    const rlimit limit{1000, 1000};
    setrlimit(RLIMIT_FSIZE, &limit);
    std::signal(SIGXFSZ, SIG_IGN);
    try {
      write_file(path, std::string(100'000, 'x'));
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::output) throw;
    }
  };
  EXPECT_EQ(run_in_child(job, {}), path.string() +
                                       ": got a file that cannot be written (File too large), need free "
                                       "space on the disk, and a folder that "
                                       "is not removed meanwhile");
  EXPECT_EQ(entries(folder.path()), 0U);
}

TEST(OutputFolder, IsLockedDuringItsLifetime) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  {
    const OutputFolder first(out, {"a.txt"});
    try {
      const OutputFolder second(out, {"b.txt"});
      FAIL() << "had twice";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("in use by another handsim"), std::string::npos);
      EXPECT_EQ(error.kind(), ErrorKind::input);
    }
  }
  const OutputFolder third(out, {"a.txt"});
  EXPECT_EQ(entries(out), 0U);
}

TEST(OutputFolder, ClearsItsOwnNamesAndNoOthers) {
  const TemporaryFolder folder;
  for (const char* name :
       {"a.txt", "frame_123.png", "frame_12.png", "frame_1234.png", "b.txt", ".handsim.9.1.part"})
    write_file(folder.path() / name, "x");
  make_folder(folder.path() / "plots");
  write_file(folder.path() / "plots/right.png", "x");
  make_folder(folder.path() / "sub");
  write_file(folder.path() / "sub/a.txt", "x");
  const OutputFolder held(folder.path(), {"a.txt", "frame_[0-9][0-9][0-9].png", "plots/*.png"});
  held.clear();
  std::set<std::string> left;
  for (const auto& entry : fs::recursive_directory_iterator(folder.path()))
    left.insert(fs::relative(entry.path(), folder.path()));
  EXPECT_EQ(left, (std::set<std::string>{"b.txt", "frame_12.png", "frame_1234.png", "sub", "sub/a.txt"}));
}

TEST(OutputFolder, RefusesToReplaceAnInputFile) {
  const TemporaryFolder folder;
  write_file(folder.path() / "a.txt", "input");
  int asked = 0;
  const auto inputs = [&] {
    ++asked;
    return std::vector<fs::path>{folder.path() / "." / "a.txt"};
  };
  EXPECT_THROW(OutputFolder(folder.path(), {"a.txt"}, inputs), Error);
  EXPECT_EQ(asked, 1);
  // If no file is replaced, the inputs are not listed.
  const OutputFolder other(folder.path(), {"b.txt"}, inputs);
  EXPECT_EQ(asked, 1);
}

TEST(Child, ReportsTheExceptionOfItsJob) {
  EXPECT_EQ(run_in_child([](const Progress&) {}, {}), std::nullopt);
  EXPECT_EQ(run_in_child([](const Progress&) { throw input_error("a", "b", "c"); }, {}), "a: got b, need c");
  EXPECT_EQ(run_in_child([](const Progress&) { throw std::bad_alloc(); }, {}), "out of memory");
}

TEST(Child, ThatCrashesHasItsLastMessageReported) {
  EXPECT_EQ(run_in_child([](const Progress&) { raise(SIGKILL); }, {}), "ended by signal 9 (Killed)");
  const auto last_message = [](const Progress&) {
    const std::string text = "first\nLLVM ERROR: out of memory\n";
    static_cast<void>(!::write(STDERR_FILENO, text.data(), text.size()));
    std::abort();
  };
  EXPECT_EQ(run_in_child(last_message, {}), "ended by signal 6 (Aborted): LLVM ERROR: out of memory");
}

TEST(Child, ReportsItsProgress) {
  std::vector<double> shares;
  const auto job = [](const Progress& progress) {
    for (const double share : {0.25, 0.5, 1.0}) progress(share);
  };
  EXPECT_EQ(run_in_child(job, [&](double share) { shares.push_back(share); }), std::nullopt);
  EXPECT_EQ(shares, (std::vector<double>{0.25, 0.5, 1.0}));
}

// Otherwise the folder of a killed run would stay locked until its child ends.
TEST(Child, HoldsNoLockOfItsParents) {
  const TemporaryFolder folder;
  const int inherited = open(folder.path().c_str(), O_RDONLY | O_DIRECTORY);
  const auto job = [&](const Progress&) {
    struct stat now {};
    if (fstat(inherited, &now) == 0 && S_ISDIR(now.st_mode)) throw input_error("file", "open", "closed");
  };
  EXPECT_EQ(run_in_child(job, {}), std::nullopt);
  EXPECT_NE(fcntl(inherited, F_GETFD), -1);
  close(inherited);
}

}  // namespace
}  // namespace handsim::output
