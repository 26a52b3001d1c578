// Reading of input files. Oracle: the bytes written; what must not be read is refused without waiting.
#include "handsim/core/input_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "scene_files.h"

namespace handsim {
namespace {

namespace fs = std::filesystem;

std::string refusal(const fs::path& path, std::size_t most = 100) {
  try {
    read_input_file(path, "a good file", most);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(InputFile, IsReadWholeUpToItsLimit) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "f";
  for (const std::size_t size : {0UL, 1UL, 4096UL, 4097UL, 100'000UL}) {
    const std::string text(size, 'x');
    std::ofstream(path, std::ios::binary) << text;
    EXPECT_EQ(read_input_file(path, "a good file", size), text);
    if (size == 0) continue;
    EXPECT_EQ(refusal(path, size - 1), path.string() + ":1:1: got a file of " + std::to_string(size) +
                                           " bytes, need at most " + bytes_text(size - 1));
  }
}

TEST(InputFile, OfTextHasNoByteOrderMarkAndIsNotUtf16) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "f";
  for (const std::string mark : {"", "\xef\xbb\xbf"}) {
    std::ofstream(path, std::ios::binary) << mark << "a\xef\xbb\xbf\n";
    EXPECT_EQ(read_text_file(path, "a good file", 100), "a\xef\xbb\xbf\n");
  }
  for (const std::string& text : {std::string("\xff\xfe" "a\0", 4), std::string("\xfe\xff\0a", 4)}) {
    std::ofstream(path, std::ios::binary) << text;
    try {
      read_text_file(path, "a good file", 100);
      FAIL() << "read";
    } catch (const Error& error) {
      EXPECT_EQ(error.what(), path.string() + ":1:1: got text in UTF-16, need text in UTF-8");
    }
  }
}

TEST(InputFile, MustNotBeAPipeADeviceOrAFolder) {
  const test::TemporaryFolder folder;
  const fs::path pipe = folder.path() / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  fs::create_symlink(pipe, folder.path() / "link");
  EXPECT_NE(refusal(pipe).find("got a pipe, socket or device, need a good file"), std::string::npos);
  EXPECT_NE(refusal(folder.path() / "link").find("got a pipe, socket or device"), std::string::npos);
  EXPECT_NE(refusal("/dev/zero").find("got a pipe, socket or device"), std::string::npos);
  EXPECT_NE(refusal(folder.path()).find("got a directory"), std::string::npos);
  EXPECT_NE(refusal(folder.path() / "none").find("got no such file"), std::string::npos);
  EXPECT_NE(refusal(folder.path() / std::string(5000, 'x')).find("got no such file"), std::string::npos);
  fs::create_symlink("loop", folder.path() / "loop");
  EXPECT_NE(refusal(folder.path() / "loop").find("got a file that cannot be opened"), std::string::npos);
  EXPECT_TRUE(has_entry(folder.path() / "loop"));
  EXPECT_FALSE(has_entry(folder.path() / "none"));
}

TEST(InputFile, HasTheLinesThatWereWritten) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "f";
  const std::vector<std::string> lines = {"a", "", std::string(200'000, 'x'), "last"};
  for (const bool cut : {false, true}) {
    std::ofstream(path) << lines[0] << '\n'
                        << lines[1] << '\n'
                        << lines[2] << '\n'
                        << lines[3] << (cut ? "" : "\n");
    InputFile file(path, "a good file", 1U << 20U);
    std::string text;
    for (const std::string& line : lines) {
      ASSERT_TRUE(file.line(text));
      EXPECT_EQ(text, line);
    }
    EXPECT_EQ(file.cut(), cut);
    EXPECT_FALSE(file.line(text));
  }
}

// A sparse file takes no room on the disk, but its line would take all memory.
TEST(InputFile, RefusesALineWithoutEnd) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "f";
  std::ofstream(path) << "a\n";
  fs::resize_file(path, 4UL << 30U);
  InputFile file(path, "a good file", 4UL << 30U);
  std::string text;
  ASSERT_TRUE(file.line(text));
  try {
    file.line(text);
    ADD_FAILURE() << "read";
  } catch (const Error& error) {
    EXPECT_EQ(error.what(), path.string() + ":2:1: got a line of more than 16 MB, need a good file");
  }
}

// Files of /proc report a size of 0.
TEST(InputFile, MayBeLargerThanItsReportedSizeButNotThanTheLimit) {
  EXPECT_FALSE(read_input_file("/proc/self/status", "a good file", 1U << 20U).empty());
  EXPECT_NE(refusal("/proc/self/status", 10).find("got a file that grows beyond 10 bytes"),
            std::string::npos);
}

}  // namespace
}  // namespace handsim
