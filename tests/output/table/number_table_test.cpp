// Tables of numbers, read back.
#include <gtest/gtest.h>

#include <fstream>

#include "handsim/output/table/table_files.h"
#include "scene_files.h"

namespace handsim::output {
namespace {

TEST(Tables, ReportTheLineOfAFieldThatIsNoNumber) {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.csv";
  std::ofstream(path) << "a,b\n1,2\n3,x\n";
  try {
    read_numbers(path);
    ADD_FAILURE() << "read";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(":3:"), std::string::npos) << error.what();
  }
}

// Oracle: RFC 4180: commas stand in quotes, quotes are doubled.
TEST(Tables, HaveQuotedFields) {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.csv";
  std::ofstream(path) << "a,b,c\n\"x, y\",,\"say \"\"no\"\"\"\n";
  std::vector<std::string> found;
  read_rows(path, [&](std::size_t, std::span<const std::string_view> fields) {
    found.assign(fields.begin(), fields.end());
  });
  EXPECT_EQ(found, (std::vector<std::string>{"x, y", "", "say \"no\""}));
}

}  // namespace
}  // namespace handsim::output
