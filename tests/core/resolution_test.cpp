// The resolved text: what was read, with defaults and referenced content. Oracle: the text by hand.
#include "handsim/core/resolution.h"

#include <gtest/gtest.h>

#include "handsim/core/yaml_reader.h"

namespace handsim {
namespace {

/// A surface of a thing as a file says it.
struct Paint {
  double gloss = 0.5;
  std::optional<double> age;
  bool dry = true;

  template <class Visit>
  static void fields(Visit&& visit) {
    visit("gloss", &Paint::gloss, Quantity{Dimension::none, 0, 1});
    visit("age", &Paint::age, Quantity{Dimension::time, 0, 10});
    visit("dry", &Paint::dry);
  }
};

TEST(Resolution, HasTheDefaultsOfAListOfFieldsAndTheTreeStaysAsItIs) {
  const std::string text = "walls:\n  - dry: false\n  - gloss: \"0.25\"\n";
  const YamlNode root = parse_yaml(text, "f.yaml");
  Diagnostics diagnostics;
  MapReader reader(root, "", diagnostics);
  std::vector<Paint> walls;
  reader.each("walls", 1, 9, [&](MapReader wall) {
    wall.fields(walls.emplace_back());
    wall.finish();
  });
  diagnostics.throw_if_any();
  EXPECT_EQ(walls[0].gloss, 0.5);
  EXPECT_EQ(walls[1].gloss, 0.25);
  EXPECT_FALSE(walls[0].dry);
  EXPECT_FALSE(walls[0].age);
  EXPECT_EQ(emit_yaml(root), text);
  EXPECT_EQ(emit_yaml(diagnostics.resolution.applied(root)),
            "walls:\n  - dry: false\n    gloss: 0.5\n  - gloss: \"0.25\"\n    dry: true\n");
}

TEST(Resolution, ReplacesWhatStandsThereAndFillsOnlyWhatIsAbsent) {
  const YamlNode root = parse_yaml("a: 1\nb: {c: 2}\n", "f.yaml");
  Resolution resolution;
  resolution.fill("a", yaml_scalar("5"));
  resolution.fill("b.d", yaml_scalar("6"));
  resolution.replace("b.c", yaml_scalar("7"));
  resolution.replace("e", yaml_map());
  resolution.fill("e.f", yaml_scalar("8"));
  EXPECT_EQ(emit_yaml(resolution.applied(root)), "a: 1\nb:\n  c: 7\n  d: 6\ne:\n  f: 8\n");
  // Of a part: what was noted within it, from a given value on.
  EXPECT_EQ(emit_yaml(resolution.applied(*root.find("b"), "b", 2)), "c: 7\n");
}

TEST(Resolution, FindsKeysWithDotsAndLeavesOutWhatTheTreeDoesNotHave) {
  const YamlNode root = parse_yaml("m: {a: {x: 1}, a.b: {x: 2}}\nl: [{}]\n", "f.yaml");
  Resolution resolution;
  resolution.fill("m.a.b.y", yaml_scalar("3"));
  resolution.fill("l.1.y", yaml_scalar("4"));
  resolution.fill("n.y", yaml_scalar("5"));
  EXPECT_EQ(emit_yaml(resolution.applied(root)),
            "m:\n  a:\n    x: 1\n  a.b:\n    x: 2\n    y: 3\nl:\n  - {}\n");
}

}  // namespace
}  // namespace handsim
