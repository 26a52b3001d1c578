#include "handsim/core/units.h"

#include <gtest/gtest.h>

#include <cmath>

namespace handsim {
namespace {

TEST(Units, BareNumbersAreSi) {
  EXPECT_EQ(parse_quantity("0.5", Dimension::length), 0.5);
  EXPECT_EQ(parse_quantity(" -2e-3 ", Dimension::time), -2e-3);
}

TEST(Units, NumbersWithUnitsBecomeSi) {
  EXPECT_DOUBLE_EQ(parse_quantity("35 mm", Dimension::length).value(), 0.035);
  EXPECT_DOUBLE_EQ(parse_quantity("90 deg", Dimension::angle).value(), M_PI / 2);
  EXPECT_DOUBLE_EQ(parse_quantity("1ms", Dimension::time).value(), 1e-3);
  EXPECT_DOUBLE_EQ(parse_quantity("0.04 N m/rad", Dimension::rotational_stiffness).value(), 0.04);
}

TEST(Units, OtherDimensionsAndRubbishAreRefused) {
  for (const char* text :
       {"35 mm", "1 furlong", "mm", "", "1 m m", "0x10", "1,5", "nan", "inf", "1e999", "++1", "1 deg"})
    EXPECT_FALSE(parse_quantity(text, Dimension::time)) << text;
}

TEST(Units, NumberTextReadsBackToTheSameBits) {
  for (const double value : {0.1, 1.0 / 3.0, 1e-300, -2.2250738585072014e-308, 123456789.123456789, M_PI})
    EXPECT_EQ(parse_number(number_text(value)), value);
}

TEST(Units, RangesHaveOpenAndClosedEnds) {
  const Quantity open = {Dimension::length, 0, 1, true};
  EXPECT_FALSE(open.allows(0));
  EXPECT_TRUE(open.allows(1));
  EXPECT_FALSE(open.allows(1.0001));
  EXPECT_FALSE(open.allows(std::nan("")));
  EXPECT_EQ(open.need(), "a length, above 0 to 1 m, such as 0.02 or \"20 mm\"");
}

// Oracle: the reader of numbers. Ranges of every dimension, about and beyond each example.
TEST(Units, WhatAMessageSuggestsIsAllowed) {
  for (int dimension = 0; dimension <= static_cast<int>(Dimension::force); ++dimension)
    for (double low = 1e-6; low < 1e6; low *= 3)
      for (const double high : {low * 2, low * 1e3}) {
        const Quantity range = {static_cast<Dimension>(dimension), low, high};
        for (const char* got : {"", "175", "fast", "0.5"}) {
          const std::string need = range.need(got);
          const std::size_t open = need.find('"');
          if (open == std::string::npos) continue;
          const auto value = parse_quantity(need.substr(open + 1, need.size() - open - 2), range.dimension);
          EXPECT_TRUE(value && range.allows(*value)) << need;
        }
      }
}

}  // namespace
}  // namespace handsim
