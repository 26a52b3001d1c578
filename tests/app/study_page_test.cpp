// Studies leave the commands that repeat their rows, and pages.
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "app/program.h"

namespace handsim {
namespace {

namespace fs = std::filesystem;
using test::contains, test::run_program, test::text_of;

std::vector<std::vector<std::string>> table_of(const fs::path& path) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream lines(text_of(path));
  for (std::string line; std::getline(lines, line);) {
    std::vector<std::string>& row = rows.emplace_back(1);
    bool quoted = false;
    for (const char c : line) {
      if (c == '"') quoted = !quoted;
      if (c == ',' && !quoted)
        row.emplace_back();
      else if (c != '"')
        row.back() += c;
    }
  }
  return rows;
}

std::string cell(const std::vector<std::vector<std::string>>& table, std::size_t row,
                 const std::string& column) {
  const auto& head = table.at(0);
  const auto found = std::find(head.begin(), head.end(), column);
  if (found == head.end()) throw std::out_of_range(column);
  return table.at(row).at(static_cast<std::size_t>(found - head.begin()));
}

/// Words of a command as a shell reads them, without the program.
std::vector<std::string> words_of(const std::string& command) {
  std::vector<std::string> words(1);
  bool quoted = false;
  for (const char c : command) {
    if (c == '\'') quoted = !quoted;
    if (c == ' ' && !quoted)
      words.emplace_back();
    else if (c != '\'')
      words.back() += c;
  }
  words.erase(words.begin());
  return words;
}

// Oracle: the study's own row: a run of its command has the same figure, to the last bit.
TEST(StudyPage, CommandOfARowOfStabilityRepeatsIt) {
  const test::TemporaryFolder folder;
  const fs::path out = folder.path() / "stability";
  ASSERT_EQ(run_program({"stability", test::source("config/stability.yaml").string(), "--case", "pendulum",
                         "--quick", "--no-pictures", "--out", out.string(), "--report"})
                .status,
            0);
  const auto table = table_of(out / "stability.csv");
  const auto study = nlohmann::json::parse(text_of(out / "study.json"));
  EXPECT_TRUE(contains(study["command"], "handsim stability "));
  EXPECT_TRUE(contains(text_of(out / "report.html"), "stability.csv"));
  ASSERT_EQ(study["rows"]["stability.csv"].size(), table.size() - 1);
  ASSERT_EQ(cell(table, 1, "measure"), "joint_gap");
  std::vector<std::string> words = words_of(study["rows"]["stability.csv"][0]);
  words.back() = (folder.path() / "again").string();
  ASSERT_EQ(run_program(words).status, 0);
  const auto again = nlohmann::json::parse(text_of(folder.path() / "again/summary.json"));
  ASSERT_EQ(again["criteria"][0]["name"], "joint_gap");
  const double gap = std::stod(cell(table, 1, "measured"));
  EXPECT_GT(gap, 1e-6);
  EXPECT_EQ(again["criteria"][0]["measured"], gap);
}

}  // namespace
}  // namespace handsim
