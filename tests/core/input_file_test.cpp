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
}

// Files of /proc report a size of 0.
TEST(InputFile, MayBeLargerThanItsReportedSizeButNotThanTheLimit) {
  EXPECT_FALSE(read_input_file("/proc/self/status", "a good file", 1U << 20U).empty());
  EXPECT_NE(refusal("/proc/self/status", 10).find("got a file that grows beyond 10 bytes"),
            std::string::npos);
}

}  // namespace
}  // namespace handsim
