#include "handsim/core/text.h"

#include <gtest/gtest.h>

namespace handsim {
namespace {

// Oracle: the table of well-formed byte sequences (Unicode 15, table 3-7), without control characters and
// noncharacters.
TEST(Text, WellFormedUtf8IsText) {
  for (const char* good : {"", "plain\ttext\r\n", "\x7e", "\xc2\xa0", "\xdf\xbf", "\xe0\xa0\x80",
                           "\xed\x9f\xbf", "\xee\x80\x80", "\xf0\x90\x80\x80", "\xf4\x8f\xbf\xbd"})
    EXPECT_FALSE(find_bad_byte(good)) << good;
}

TEST(Text, IllFormedUtf8IsFoundAtItsFirstByte) {
  for (const char* bad :
       {"\x80", "\xc0\xaf", "\xc1\xbf", "\xe0\x9f\xbf", "\xed\xa0\x80", "\xf0\x8f\xbf\xbf",
        "\xf4\x90\x80\x80", "\xf8\x88\x80\x80\x80", "\xff", "\xc3", "\xe2\x82", "\xe2\x28\xa1"}) {
    const auto found = find_bad_byte(std::string("ab") + bad);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->at, 2U);
  }
}

TEST(Text, ControlCharactersAreNoText) {
  using namespace std::string_view_literals;
  for (const std::string_view bad : {"\0"sv, "\x1b"sv, "\x7f"sv, "\b"sv}) EXPECT_TRUE(find_bad_byte(bad));
  EXPECT_EQ(find_bad_byte("x\x1b")->what, "the control character 0x1b");
}

TEST(Text, PrintableStaysOnOneLineAndCutsBetweenCharacters) {
  EXPECT_EQ(printable("a\nb\tc\x1b[0m"), "a\\nb\\tc\\x1b[0m");
  EXPECT_EQ(printable("\xc3\xa9\xc3\xa9\xc3\xa9", 3), "\xc3\xa9...");
  EXPECT_EQ(printable("abc", 3), "abc");
}

}  // namespace
}  // namespace handsim
