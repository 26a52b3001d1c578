// Mistakes in files: misspelt optional keys, numbers with a comma, characters that YAML does not allow,
// quotes that are not closed. Oracle: the message or the tree.
#include <gtest/gtest.h>

#include "handsim/core/text.h"
#include "handsim/core/yaml_reader.h"

namespace handsim {
namespace {

/// The problems of reading, one per line.
template <class Read>
std::string problems(const std::string& text, const Read& read) {
  YamlNode root = parse_yaml(text, "f.yaml");
  Diagnostics diagnostics;
  MapReader reader(root, "", diagnostics);
  read(reader);
  reader.finish();
  std::string out;
  for (const Problem& problem : diagnostics.problems) out += problem.text() + "\n";
  return out;
}

TEST(Keys, ThatAreOptionalAreSuggested) {
  const auto read = [](MapReader& reader) {
    if (reader.has("camera")) reader.map("camera");
    reader.maybe_text("source");
  };
  EXPECT_EQ(problems("camra: {}\nsorce: x\n", read),
            "f.yaml:1:1: camra: got an unknown key, need one of camera, source (nearest: camera)\n"
            "f.yaml:2:1: sorce: got an unknown key, need one of camera, source (nearest: source)\n");
}

TEST(Keys, OfAnotherCaseAreNear) {
  EXPECT_EQ(nearest_word("ODE", {"ode", "dae"}), "ode");
  EXPECT_EQ(nearest_word("Right", {"left", "right"}), "right");
}

TEST(OptionalText, StaysAbsent) {
  const YamlNode root = parse_yaml("a: 1\n", "f.yaml");
  Diagnostics diagnostics;
  MapReader reader(root, "", diagnostics);
  EXPECT_FALSE(reader.maybe_text("source").has_value());
  EXPECT_EQ(emit_yaml(diagnostics.resolution.applied(root)), "a: 1\n");
}

TEST(DecimalComma, IsReportedOnceWithTheCorrectForm) {
  const Quantity length{Dimension::length, 0, 3};
  const auto read = [&](MapReader& reader) {
    reader.number("a", length);
    reader.maybe_number("b", length);
    reader.integer("c", 0, 9, 1);
  };
  EXPECT_EQ(problems("{a: 1,7, b: 1,75 m, c: 2}", read),
            "f.yaml:1:5: a: got 1,7, need a decimal point in place of a comma: 1.7\n"
            "f.yaml:1:13: b: got 1,75 m, need a decimal point in place of a comma: 1.75 m\n");
  EXPECT_EQ(problems("a: 1,000\n", read),
            "f.yaml:1:4: a: got 1,000, need a decimal point in place of a comma: 1.000\n");
  // Only what is accepted is suggested.
  const auto wide = [](MapReader& reader) { reader.number("a", {Dimension::none, 0, 2000}); };
  EXPECT_EQ(problems("a: 1,000\n", wide),
            "f.yaml:1:4: a: got 1,000, need a decimal point in place of a comma: 1.000 (or 1000)\n");
  const auto large = [](MapReader& reader) { reader.integer("a", 10, 2000, 10); };
  EXPECT_EQ(problems("a: 1,000\n", large), "f.yaml:1:4: a: got 1,000, need no comma: 1000\n");
  EXPECT_EQ(problems("a: 1,5\n", large), "f.yaml:1:4: a: got 1,5, need a whole number, 10 to 2000\n");
  EXPECT_EQ(problems("{a: 1, 7: }", read),
            "f.yaml:1:5: a: got 1,7, need a decimal point in place of a comma: 1.7\n");
  // A key that has a value is a key.
  EXPECT_EQ(problems("{a: 1, 7: 2}", read).substr(0, 37), "f.yaml:1:8: 7: got an unknown key, ne");
}

TEST(Vectors, OfTooManyNumbersMentionTheDecimalPoint) {
  const auto read = [](MapReader& reader) { reader.vector("v", {Dimension::none, -9, 9}); };
  EXPECT_NE(problems("v: [0, 0, -9,81]\n", read).find("use a decimal point"), std::string::npos);
}

TEST(Warnings, HaveThePlaceOfTheirKey) {
  YamlNode root = parse_yaml("a: 1\nrecord: {every: 2}\n", "f.yaml");
  Diagnostics diagnostics;
  MapReader reader(root, "", diagnostics);
  reader.warning("record.every", "odd");
  EXPECT_EQ(diagnostics.warnings.front(), "f.yaml:2:17: record.every: odd");
}

TEST(Characters, ThatYamlForbidsAreRefused) {
  for (const char* bad :
       {"\xef\xbf\xbe", "\xef\xbf\xbf", "\xef\xb7\x90", "\xf0\x9f\xbf\xbe", "\xf4\x8f\xbf\xbf"}) {
    EXPECT_TRUE(find_bad_byte(bad).has_value()) << bad;
    EXPECT_THROW(parse_yaml(std::string("a: ") + bad + "\n", "f.yaml"), Error) << bad;
  }
  for (const char* escape : {"\\uFFFE", "\\uFFFF", "\\uFDD0", "\\U0001FFFE"})
    EXPECT_THROW(parse_yaml(std::string("a: \"") + escape + "\"\n", "f.yaml"), Error) << escape;
  for (const char* good : {"\xef\xbf\xbd", "\xef\xb7\x8f", "\xf0\x9f\x99\x82", "\xc2\x85", "\xc3\xa9"})
    EXPECT_FALSE(find_bad_byte(good).has_value()) << good;
  EXPECT_TRUE(find_bad_byte("\xc2\x9b").has_value());
  EXPECT_EQ(printable("a\xc2\x9b"
                      "2J"),
            "a\\x9b2J");
}

// Oracle: the text written, for every accepted character.
TEST(Characters, ThatAreAcceptedSurviveWritingAndReading) {
  for (unsigned long code = 0x20; code <= 0x10ffff; code += code < 0x3000 ? 1 : 97) {
    std::string text;
    const auto put = [&](unsigned long bits) { text += static_cast<char>(static_cast<unsigned char>(bits)); };
    if (code < 0x80) {
      put(code);
    } else if (code < 0x800) {
      put(0xc0U | (code >> 6U)), put(0x80U | (code & 0x3fU));
    } else if (code < 0x10000) {
      put(0xe0U | (code >> 12U)), put(0x80U | ((code >> 6U) & 0x3fU)), put(0x80U | (code & 0x3fU));
    } else {
      put(0xf0U | (code >> 18U)), put(0x80U | ((code >> 12U) & 0x3fU)), put(0x80U | ((code >> 6U) & 0x3fU)),
          put(0x80U | (code & 0x3fU));
    }
    if (find_bad_byte(text)) continue;
    YamlNode map = yaml_map();
    yaml_put(map, "k", yaml_scalar("x" + text + "y", true));
    ASSERT_EQ(parse_yaml(emit_yaml(map), "f.yaml").find("k")->text, "x" + text + "y") << std::hex << code;
  }
}

TEST(Quotes, ThatAreNotClosedAreRefusedAtTheirPlace) {
  struct Case {
    const char* text;
    const char* part;
  };
  for (const Case& bad :
       {Case{"a: \"never", "f.yaml:1:4: got a quote that is not closed, need a closing \""},
        Case{"a: 1\nb: \"5 s\n", "f.yaml:2:4: got a quote that is not closed"},
        Case{"a: \"x\"\nb: \"it's \\\"\n\n", "f.yaml:2:4: got a quote that is not closed"},
        Case{"\xef\xbb\xbf"
             "a: \"x",
             "a quote that is not closed"},
        Case{"\xc3\xa9: \"\xc3\xa9", "got a quote that is not closed"}, Case{"a: 'x\n", "f.yaml:"},
        Case{"\"a: 1\n", "f.yaml:1:1"}, Case{"a: 'it''s", "f.yaml:"}}) {
    try {
      parse_yaml(bad.text, "f.yaml");
      FAIL() << bad.text;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(bad.part), std::string::npos) << error.what();
    }
  }
  for (const char* good :
       {"a: \"x\"", "a: \"x\\\"\"", "a: 'it''s'", "a: 'x\"'\nb: it's \"so", "a: \"x\" # \"y", "'a': ''"})
    EXPECT_NO_THROW(parse_yaml(good, "f.yaml")) << good;
}

}  // namespace
}  // namespace handsim
