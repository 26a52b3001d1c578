#include "handsim/core/yaml_files.h"

#include <gtest/gtest.h>

#include <fstream>

#include "handsim/core/yaml_reader.h"

namespace handsim {
namespace {

std::string failure(const std::string& text) {
  try {
    parse_yaml(text, "f.yaml");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Yaml, NodesKnowTheirPlace) {
  const YamlNode root = parse_yaml("a: 1\nb:\n  - x\n  - {c: 2}\n", "f.yaml");
  const YamlNode* c = root.find("b")->items[1].find("c");
  EXPECT_EQ(c->line, 4);
  EXPECT_EQ(c->column, 9);
  EXPECT_EQ(*c->file, "f.yaml");
}

TEST(Yaml, DuplicateKeysAreAllNamed) {
  const std::string text = failure("a: 1\nb: 2\na: 3\nc: {d: 1, d: 2}\n");
  EXPECT_NE(text.find("f.yaml:3:1: got a second \"a\" (the first is in line 1), need each key once"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("f.yaml:4:11: got a second \"d\""), std::string::npos) << text;
}

TEST(Yaml, AliasesExpandAndMayNotRecur) {
  const YamlNode root = parse_yaml("a: &x {k: [1, 2]}\nb: *x\n", "f.yaml");
  EXPECT_EQ(root.find("b")->find("k")->items[1].text, "2");
  EXPECT_NE(failure("a: &x [1, *x]\n").find("an alias to a value that contains it"), std::string::npos);
  EXPECT_NE(failure("a: *nobody\n").find("invalid YAML"), std::string::npos);
}

// Oracle: a second parse of the same text.
TEST(Yaml, ACopyAndItsOriginalChangeWithoutEachOther) {
  const std::string text = "a: {b: [1, 2, {c: 3}], d: x}\ne: 5\n";
  YamlNode tree = parse_yaml(text, "f.yaml");
  const YamlNode as_read = parse_yaml(text, "f.yaml");
  YamlNode copy = tree;
  EXPECT_TRUE(copy.entries.is(tree.entries));
  copy.find("a")->find("b")->items[2].find("c")->text = "4";
  copy.entries.remove_if([](const YamlEntry& entry) { return entry.key == "e"; });
  yaml_put(*copy.find("a"), "f", yaml_scalar("y"));
  EXPECT_TRUE(tree.same_as(as_read));
  EXPECT_FALSE(copy.same_as(as_read));
  EXPECT_EQ(emit_yaml(copy), "a:\n  b:\n    - 1\n    - 2\n    - c: 4\n  d: x\n  f: y\n");
  // The original, too, when the copy is the one that stays.
  copy = tree;
  tree.find("a")->find("b")->items.clear();
  EXPECT_TRUE(copy.same_as(as_read));
  EXPECT_FALSE(tree.same_as(as_read));
}

TEST(Yaml, AFileThatChangesIsParsedAgain) {
  const auto path = std::filesystem::temp_directory_path() / "handsim_yaml_files_test.yaml";
  std::ofstream(path) << "a: 1\n";
  YamlBudget first, second, third;
  YamlNode tree = load_yaml(path, first);
  tree.find("a")->text = "2";
  const YamlNode again = load_yaml(path, second);
  EXPECT_EQ(again.find("a")->text, "1");
  EXPECT_EQ(first.left, second.left);
  EXPECT_LT(second.left, kYamlMaxMemory);
  std::ofstream(path) << "a: 3\n";
  EXPECT_EQ(load_yaml(path).find("a")->text, "3");
  third.left = 10;
  EXPECT_THROW(load_yaml(path, third), Error);
  std::filesystem::remove(path);
}

TEST(Yaml, TreesAreTheSameOnlyWithTheSamePlacesAndQuotes) {
  const YamlNode tree = parse_yaml("a: [1, x]\n", "f.yaml");
  EXPECT_TRUE(tree.same_as(parse_yaml("a: [1, x]\n", "f.yaml")));
  EXPECT_FALSE(tree.same_as(parse_yaml("a: [1, x]\n", "g.yaml")));
  EXPECT_FALSE(tree.same_as(parse_yaml("a: [1,  x]\n", "f.yaml")));
  EXPECT_FALSE(tree.same_as(parse_yaml("a: [1, \"x\"]\n", "f.yaml")));
  EXPECT_FALSE(tree.same_as(parse_yaml("a: [1, x]\nb: 1\n", "f.yaml")));
}

TEST(Yaml, AliasesThatGrowWithoutBoundAreRefused) {
  std::string bomb = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n";
  for (int i = 1; i < 12; ++i) {
    bomb += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [";
    for (int k = 0; k < 10; ++k) bomb += (k ? ", *a" : "*a") + std::to_string(i - 1);
    bomb += "]\n";
  }
  EXPECT_NE(failure(bomb).find("values that take more than 256 MB"), std::string::npos);
}

TEST(Yaml, DeepNestingAndHugeFilesAreRefused) {
  EXPECT_NE(failure(std::string(100'000, '[')).find("levels of nesting"), std::string::npos);
  std::string blocks;
  for (int i = 0; i < 200; ++i) blocks += std::string(static_cast<std::size_t>(i), ' ') + "a:\n";
  EXPECT_NE(failure(blocks).find("levels of nesting"), std::string::npos);
  EXPECT_NE(failure(std::string(40'000'000, '[')).find("a file of 40000000 bytes"), std::string::npos);
}

TEST(Yaml, EmittedTextParsesToTheSameTree) {
  const std::string text =
      "a: 0.1\nb: \"quoted: yes\"\nc: [1, -2e-3, \"90 deg\"]\nd:\n  - {e: ~, f: {}}\n  - []\n";
  const std::string once = emit_yaml(parse_yaml(text, "f"));
  EXPECT_EQ(once, emit_yaml(parse_yaml(once, "g")));
  const YamlNode again = parse_yaml(once, "g");
  EXPECT_TRUE(again.find("b")->quoted);
  EXPECT_EQ(again.find("c")->items[2].text, "90 deg");
}

TEST(Yaml, OverridesReplaceAndAdd) {
  YamlNode root = parse_yaml("solver: {step: 1 ms}\nhands: [{side: right}]\n", "f");
  apply_override(root, "solver.step=5 ms");
  apply_override(root, "solver.erp=0.8");
  apply_override(root, "hands.0.side=left");
  apply_override(root, "record.every=0.1");
  EXPECT_EQ(root.find("solver")->find("step")->text, "5 ms");
  EXPECT_EQ(root.find("solver")->find("erp")->text, "0.8");
  EXPECT_EQ(root.find("hands")->items[0].find("side")->text, "left");
  EXPECT_EQ(root.find("record")->find("every")->text, "0.1");
  for (const char* bad :
       {"solver", "=1", "hands.1.side=left", "hands.x.side=left", "solver.step.deep=1", "hands.-1.side=left"})
    EXPECT_THROW(apply_override(root, bad), Error) << bad;
}

struct Reading {
  YamlNode root;
  Diagnostics diagnostics;
  explicit Reading(const std::string& text) : root(parse_yaml(text, "f.yaml")) {}
  MapReader reader() { return {root, "", diagnostics}; }
};

TEST(MapReader, CollectsEveryProblemWithItsPlace) {
  Reading reading("step: fast\nerp: 2\nmethd: x\n");
  MapReader reader = reading.reader();
  reader.number("step", {Dimension::time, 0, 1});
  reader.number("erp", {Dimension::none, 0, 1});
  reader.number("duration", {Dimension::time, 0, 1});
  reader.text("method", "a");
  reader.finish();
  std::string all;
  for (const Problem& problem : reading.diagnostics.problems) all += problem.text() + "\n";
  EXPECT_EQ(
      all,
      "f.yaml:1:7: step: got fast, need a time, 0 to 1 s, such as 0.001 or \"1 ms\"\n"
      "f.yaml:2:6: erp: got 2, need a number, 0 to 1\n"
      "f.yaml:1:1: duration: got nothing, need a time, 0 to 1 s, such as 0.001 or \"1 ms\"\n"
      "f.yaml:3:1: methd: got an unknown key, need one of duration, erp, method, step (nearest: method)\n");
}

TEST(MapReader, NotesTheDefaultsItUsesForTheResolvedText) {
  Reading reading("a: {}\n");
  MapReader reader = reading.reader();
  EXPECT_EQ(reader.number("x", {}, 0.1), 0.1);
  EXPECT_TRUE(reader.flag("y", true));
  EXPECT_EQ(reader.map("a").integer("n", 0, 9, 4), 4);
  EXPECT_EQ(emit_yaml(reading.diagnostics.resolution.applied(reading.root)), "a:\n  n: 4\nx: 0.1\ny: true\n");
  EXPECT_EQ(emit_yaml(reading.root), "a:\n  {}\n");
}

TEST(MapReader, RangesMustIncrease) {
  Reading reading("r: [\"90 deg\", 0]\n");
  MapReader reader = reading.reader();
  EXPECT_FALSE(reader.maybe_range("r", {Dimension::angle}));
  EXPECT_EQ(reading.diagnostics.problems.at(0).need, "the lower value first");
}

TEST(NearestWord, FindsSlipsAndNothingElse) {
  const std::vector<std::string> known = {"step", "method", "iterations"};
  EXPECT_EQ(nearest_word("stpe", known), "step");
  EXPECT_EQ(nearest_word("iteratons", known), "iterations");
  EXPECT_FALSE(nearest_word("colour", known));
}

}  // namespace
}  // namespace handsim
