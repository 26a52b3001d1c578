// One list of fields becomes CSV and JSON. Oracle: the texts written here by hand.
#include "handsim/study/report.h"

#include <gtest/gtest.h>

namespace handsim::study {
namespace {

TEST(StudyTable, HasAnEmptyCellWhereARowHasNoFieldOrNoValue) {
  const std::vector<Fields> rows = {{{"name", "name", "a"}, {"force", "force_N", Json()}},
                                    {{"force", "force_N", 2.5}, {"name", "name", "b"}},
                                    {{"name", "name", "c"}}};
  EXPECT_EQ(csv_table("name,force[N]", rows), "name,force[N]\n\"a\",\n\"b\",2.5\n\"c\",\n");
  // JSON has the order of the fields, and null for what was not measured.
  EXPECT_EQ(json_table(rows).dump(),
            R"([{"name":"a","force_N":null},{"force_N":2.5,"name":"b"},{"name":"c"}])");
}

TEST(StudyTable, ScalesAndFormatsTheNumbersOfColumnsAlone) {
  const std::vector<Fields> rows = {
      {{"shift", "shift_m", 0.00123456789, 1e3}, {"wall", "wall_s", 1.23456, 1, "{:.2g}"}}};
  EXPECT_EQ(csv_table("shift[mm],wall[s]", rows, "{:.4g}"), "shift[mm],wall[s]\n1.235,1.2\n");
  EXPECT_EQ(json_table(rows).dump(), R"([{"shift_m":0.00123456789,"wall_s":1.23456}])");
}

TEST(StudyTable, WritesTruthAsANumberAndTextInQuotesUnlessItHasAFormat) {
  const std::vector<Fields> rows = {{{"held", "held", true},
                                     {"why", "", "it \"slips\", and\nturns"},
                                     {"scene", "", "pinch", 1, "{}"},
                                     {"", "hidden", false}}};
  EXPECT_EQ(csv_table("held,why,scene", rows), "held,why,scene\n1,\"it \"\"slips\"\", and turns\",pinch\n");
  EXPECT_EQ(json_table(rows).dump(), R"([{"held":true,"hidden":false}])");
}

}  // namespace
}  // namespace handsim::study
