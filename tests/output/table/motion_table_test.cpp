// OpenSim tables. Oracle: the text of the format.
#include "handsim/output/table/table_files.h"

#include <gtest/gtest.h>

#include "handsim/control/motion_file.h"
#include "scene_files.h"

namespace handsim::output {
namespace {

TEST(MotionTable, OfAllRowsHasTheirNumberWithoutBlanks) {
  const test::TemporaryFolder folder;
  MotionTableWriter writer(folder.path() / "a.sto", {"two", {"x", "y"}, 2});
  writer.add(0, std::vector<double>{1, 2});
  writer.add(0.5, std::vector<double>{0.1, -3});
  writer.finish();
  EXPECT_EQ(
      test::text_of(folder.path() / "a.sto"),
      "two\nversion=1\nnRows=2\nnColumns=3\ninDegrees=yes\nendheader\ntime\tx\ty\n0\t1\t2\n0.5\t0.1\t-3\n");
}

TEST(MotionTable, OfARunThatEndsEarlyHasTheNumberOfItsRowsAndReadsBack) {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.mot";
  {
    MotionTableWriter writer(path, {"early", {"x"}, 100'000});
    for (int i = 0; i < 20'000; ++i) writer.add(i, std::vector<double>{0.01});
    EXPECT_FALSE(std::filesystem::exists(path));
    writer.finish();
  }
  EXPECT_TRUE(test::text_of(path).starts_with("early\nversion=1\nnRows=20000 \nnColumns=2\n"));
  EXPECT_EQ(control::read_motion(path).times.size(), 20'000U);
}

}  // namespace
}  // namespace handsim::output
