#include "handsim/core/schema.h"

#include <set>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "handsim/hand/grip_strength.h"
#include "handsim/hand/hand_file.h"

namespace handsim {
namespace {

using Json = nlohmann::json;

/// A file with a key of every form; `radius` exists for one shape only.
void read_thing(const YamlNode& root, Diagnostics& diagnostics) {
  MapReader reader(root, "", diagnostics);
  reader.name("name");
  reader.number("mass", {Dimension::mass, 0, 5, true}, 2.0);
  const bool round = reader.choice<bool>("shape", {{"cube", false}, {"ball", true}});
  if (round) reader.number("radius", {Dimension::length, 0, 1});
  if (reader.has("note")) reader.text("note");
  reader.each("parts", 1, 3, [](MapReader part) {
    part.flag("hollow", true);
    part.finish();
  });
  reader.named_texts("sources");
  reader.texts("joints", 1, 9, "names");
  reader.file_or_block("owner", "a person");
  if (reader.has("camera")) {
    MapReader camera = reader.map("camera");
    camera.integer("pixels", 16, 64, 32);
    camera.finish();
  } else {
    reader.choice<int>("view", {{"top", 0}, {"side", 1}}, 0);
  }
  reader.finish();
}

const std::vector<SchemaSource> kSources = {
    {"a thing", read_thing},
    {"a person", [](const YamlNode& root, Diagnostics& into) { hand::read_person(root, "", into); }},
};

Json schema() { return Json::parse(json_schema("a thing", kSources)); }

std::set<std::string> keys_of(const Json& object) {
  std::set<std::string> out;
  for (const auto& [key, value] : object.at("properties").items()) out.insert(key);
  return out;
}

// Oracle: the definition: a default that depends on another key is not in the schema.
TEST(Schema, HasNoDefaultThatDependsOnOtherKeys) {
  const std::vector<SchemaSource> sources = {
      {"a thing", [](const YamlNode& root, Diagnostics& diagnostics) {
         MapReader reader(root, "", diagnostics);
         const bool fast = reader.flag("fast", false);
         reader.number("speed", {Dimension::none, 0, 9}, fast ? 5.0 : 1.0);
         reader.number("mass", {Dimension::none, 0, 9}, 2.0);
         reader.finish();
       }}};
  const Json thing = Json::parse(json_schema("a thing", sources));
  const Json &speed = thing.at("properties").at("speed"), &mass = thing.at("properties").at("mass");
  EXPECT_EQ(mass.at("default"), 2.0);
  EXPECT_FALSE(speed.contains("default") || speed.contains("anyOf")) << speed;
  EXPECT_EQ(speed.at("maximum"), 9);
}

// Oracle: the keys by hand, including those that no single run of the reader asks for together.
TEST(Schema, HasEveryKeyThatSomeRunAsksFor) {
  const Json thing = schema();
  EXPECT_EQ(keys_of(thing), (std::set<std::string>{"name", "mass", "shape", "radius", "note", "parts",
                                                   "sources", "joints", "owner", "camera", "view"}));
  EXPECT_EQ(thing.at("additionalProperties"), false);
  EXPECT_EQ(thing.at("required"), Json({"joints", "name", "owner", "parts", "shape"}));
}

// Oracle: the arguments of the reader, by hand.
TEST(Schema, StatesTypesRangesWordsAndDefaults) {
  const Json of = schema().at("properties");
  EXPECT_EQ(of.at("mass").at("exclusiveMinimum"), 0);
  EXPECT_EQ(of.at("mass").at("maximum"), 5);
  EXPECT_EQ(of.at("mass").at("default"), 2);
  EXPECT_EQ(of.at("mass").at("type"), Json({"number", "string"}));
  EXPECT_EQ(of.at("shape").at("enum"), Json({"cube", "ball"}));
  EXPECT_EQ(of.at("view").at("default"), "top");
  EXPECT_EQ(of.at("parts").at("items").at("properties").at("hollow").at("default"), true);
  EXPECT_EQ(of.at("parts").at("maxItems"), 3);
  EXPECT_TRUE(of.at("sources").contains("additionalProperties"));
  EXPECT_EQ(of.at("camera").at("properties").at("pixels").at("minimum"), 16);
}

// Oracle: the reference, and the keys of a person file by hand.
TEST(Schema, DescribesTheFilesThatAFileNames) {
  const Json thing = schema();
  EXPECT_EQ(thing.at("properties").at("owner").at("anyOf")[0].at("$ref"), "#/$defs/person");
  EXPECT_TRUE(thing.at("$defs").at("person").at("properties").contains("stature"));
}

/// The keys of a schema are those that its reader lists in its message about an unknown key.
void expect_same_keys(const std::string& kind, const SchemaSource& source,
                      std::vector<SchemaSource> sources) {
  sources.push_back(source);
  const Json described = Json::parse(json_schema(kind, sources));
  YamlNode root = yaml_map();
  yaml_put(root, "no_such_key", yaml_scalar("1"));
  Diagnostics diagnostics;
  source.read(root, diagnostics);
  std::string offered;
  for (const Problem& problem : diagnostics.problems)
    if (problem.key == "no_such_key") offered = problem.need;
  ASSERT_TRUE(offered.starts_with("one of ")) << kind;
  std::set<std::string> words;
  for (std::size_t begin = 7; begin < offered.size();) {
    const std::size_t end = std::min(offered.find(", ", begin), offered.size());
    words.insert(offered.substr(begin, end - begin));
    begin = end + 2;
  }
  EXPECT_EQ(keys_of(described), words) << kind;
}

// Oracle: the reader's own message about an unknown key.
TEST(Schema, HasTheKeysThatTheReaderOffers) {
  expect_same_keys("a person", kSources[1], {});
  const SchemaSource anthropometry = {"an anthropometry file", [](const YamlNode& root, Diagnostics& into) {
                                        hand::read_anthropometry(root, "", into);
                                      }};
  expect_same_keys(
      "a hand model",
      {"a hand model", [](const YamlNode& root, Diagnostics& into) { hand::read_hand_spec(root, "", into); }},
      {anthropometry,
       {"muscles of a hand", [](const YamlNode& root,
                                Diagnostics& into) { hand::read_muscle_file(root, "", std::nullopt, into); }},
       {"a table of grip strength",
        [](const YamlNode& root, Diagnostics& into) { hand::read_grip_table(root, "", into); }}});
}

}  // namespace
}  // namespace handsim
