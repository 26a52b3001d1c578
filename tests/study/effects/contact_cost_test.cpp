// Results and files of `handsim contacts`.
#include "handsim/study/effects/contact_cost.h"

#include <filesystem>
#include <fstream>
#include <map>

#include <gtest/gtest.h>

#include "scene_files.h"
#include "support/sanitized.h"

namespace handsim::study {
namespace {

std::vector<ContactCostRow> of(const std::vector<ContactCostRow>& rows, const std::string& method) {
  std::vector<ContactCostRow> out;
  for (const ContactCostRow& row : rows)
    if (row.method == method) out.push_back(row);
  return out;
}

// Oracle: the definition of the methods; auto is iterative at the highest stack.
void expect_solvers(const std::vector<ContactCostRow>& rows) {
  for (const ContactCostRow& row : of(rows, "world_step")) EXPECT_EQ(row.iterative, 0);
  for (const ContactCostRow& row : of(rows, "quick_step 20")) EXPECT_EQ(row.iterative, 1);
  EXPECT_EQ(of(rows, "auto 50").back().iterative, 1);
  EXPECT_GT(of(rows, "world_step").back().contacts, 50);
}

// Oracle: the files contain every row.
void expect_files(const std::vector<ContactCostRow>& rows) {
  const test::TemporaryFolder folder;
  write_contact_cost(rows, folder.path());
  std::ifstream csv(folder.path() / "contacts_cost.csv");
  std::map<std::string, int> lines;
  for (std::string line; std::getline(csv, line);) ++lines[line.substr(0, line.find(','))];
  EXPECT_EQ(lines["method"], 1);
  for (const char* method : {"world_step", "quick_step 20", "quick_step 50", "auto 50"})
    EXPECT_EQ(lines[method], static_cast<int>(of(rows, method).size()));
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "contacts_cost.gp"));
}

// One test for all, because the study takes long.
TEST(ContactCost, TakesEachSolverAndIsWritten) {
  HANDSIM_SKIP_WITH_SANITIZER("high stacks");
  const std::vector<ContactCostRow> rows = run_contact_cost(HANDSIM_SOURCE_DIR, [](double) {});
  expect_solvers(rows);
  expect_files(rows);
}

}  // namespace
}  // namespace handsim::study
