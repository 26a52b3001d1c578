// Memory of YAML trees. Oracle: the stated budget, kYamlMaxMemory; bytes and values both count.
#include <gtest/gtest.h>

#include "handsim/core/yaml_files.h"
#include "handsim/core/yaml_reader.h"
#include "scene_files.h"

namespace handsim {
namespace {

template <class Read>
std::string refusal(Read read) {
  try {
    read();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

const std::string kTooMuch = "got values that take more than 256 MB";

TEST(YamlBudget, CountsTheBytesOfAliasesNotOnlyTheirNumber) {
  std::string text = "a: &a \"" + std::string(1'000'000, 'x') + "\"\nb: [*a";
  for (int i = 1; i < 100; ++i) text += ", *a";
  // 102 MB fit, 3000 MB do not.
  EXPECT_EQ(parse_yaml(text + "]\n", "f").find("b")->items.size(), 100U);
  for (int i = 100; i < 3000; ++i) text += ", *a";
  EXPECT_NE(refusal([&] { parse_yaml(text + "]\n", "f"); }).find(kTooMuch), std::string::npos);
}

TEST(YamlBudget, IsSharedByAllTreesThatAreReadWithIt) {
  const std::string text = "\"" + std::string(117'000, 'x') + "\"\n";
  YamlBudget budget{1'000'000};
  for (int i = 0; i < 8; ++i) parse_yaml(text, "f", budget);
  EXPECT_NE(refusal([&] { parse_yaml(text, "f", budget); }).find(kTooMuch), std::string::npos);
  YamlNode root = parse_yaml("a: 1\n", "f");
  EXPECT_NE(refusal([&] { apply_override(root, "a=" + text, budget); }).find(kTooMuch), std::string::npos);
}

// Resolved scenes contain defaults and files; the largest plausible ones must be readable again.
TEST(YamlBudget, HasRoomForAMillionValues) {
  std::string text = "a: [";
  for (int i = 0; i < 1'000'000; ++i) text += "1.5,";
  EXPECT_EQ(parse_yaml(text + "]\n", "f").find("a")->items.size(), 1'000'000U);
}

TEST(Override, HasAPathOfAtMost64Keys) {
  const auto path_of = [](int keys) {
    std::string path = "a";
    for (int i = 1; i < keys; ++i) path += ".a";
    return path;
  };
  YamlNode root = parse_yaml("b: 1\n", "f");
  apply_override(root, path_of(64) + "=1");
  EXPECT_EQ(refusal([&] { apply_override(root, path_of(65) + "=1"); }),
            "--set: got a path of 65 keys, need at most 64 keys");
  EXPECT_EQ(refusal([&] { apply_override(root, path_of(60'000) + "=1"); }),
            "--set: got a path of 60000 keys, need at most 64 keys");
}

// The first thousand problems, and the number of the others.
TEST(Problems, AreReportedUpToAThousand) {
  std::string text = "x: 1\n";
  for (int i = 0; i < 5000; ++i) text += "k" + std::to_string(i) + ": 1\n";
  YamlNode root = parse_yaml(text, "f");
  Diagnostics diagnostics;
  MapReader reader(root, "", diagnostics);
  reader.child("x");
  reader.finish();
  try {
    diagnostics.throw_if_any();
    FAIL();
  } catch (const Error& error) {
    ASSERT_EQ(error.problems().size(), kMostProblems + 1);
    EXPECT_EQ(error.problems().front().key, "k0");
    EXPECT_EQ(error.problems().back().got, "4000 more problems");
  }
}

}  // namespace
}  // namespace handsim
