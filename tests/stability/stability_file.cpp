#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/pose.h"
#include "handsim/core/text.h"
#include "handsim/scene/read/blocks.h"
#include "handsim/study/spec_reader.h"
#include "stability/stability.h"

namespace handsim::study {

namespace {

constexpr int kMostDraws = 100000;
/// Combinations of alternatives of one case.
constexpr std::size_t kMostVariants = 1000;
const Quantity kMoment = {Dimension::time, 0, 1e6};

/// The items of a required list with their paths.
template <class Read>
void read_items(MapReader& reader, std::string_view key, Read read) {
  const YamlNode* list = reader.list(key, true);
  if (!list) return;
  if (list->items.empty()) reader.problem(key, "an empty list", "at least one item");
  for (std::size_t i = 0; i < list->items.size(); ++i)
    read(list->items[i], fmt::format("{}.{}", reader.path_of(key), i));
}

/// `vary: [{key: solver.erp, values: [0.2, 0.8]}, {of: [{name: box, set: {...}}]}]`.
std::vector<Alternative> read_dimension(MapReader reader) {
  std::vector<Alternative> out;
  if (reader.has("of")) {
    reader.each("of", 1, kMostItems, [&](MapReader item) {
      Alternative& alternative = out.emplace_back();
      alternative.name = item.text("name");
      alternative.set = read_set(item, "set");
      item.finish();
    });
  } else {
    const std::string key = reader.text("key");
    const std::string label = reader.text("label", key.substr(key.rfind('.') + 1));
    read_items(reader, "values", [&](const YamlNode& node, const std::string&) {
      const std::string value = flow_text(node);
      const std::string shown = node.quoted ? node.text : value;
      out.push_back({label + " " + shown, {key + "=" + value}});
    });
  }
  reader.finish();
  return out;
}

/// Reports missing keys that a measure requires.
void check_needs(MapReader& reader, const MeasureKind& kind) {
  using Need = std::pair<const char*, const char*>;
  for (const auto& [key, what] :
       {Need{"joint", "a joint"}, Need{"body", "a body"}, Need{"crank", "a length"}, Need{"rod", "a length"}})
    if (kind.needs.find(key) != std::string_view::npos && !reader.has(key))
      reader.problem(key, "nothing", fmt::format("{}, which {} requires", what, kind.name));
}

MeasureSpec read_measure(MapReader reader) {
  MeasureSpec out;
  std::vector<std::pair<std::string_view, const MeasureKind*>> kinds;
  for (const MeasureKind& kind : measure_kinds()) kinds.emplace_back(kind.name, &kind);
  const MeasureKind* kind = reader.choice<const MeasureKind*>("measure", kinds);
  const bool known = reader.sound();
  out.kind = kind->name;
  out.name = reader.text("name", std::string(kind->name));
  out.limit = reader.number("limit", {known ? kind->dimension : Dimension::none, -1e9, 1e9});
  if (reader.has("body")) out.body = reader.text("body");
  if (reader.has("joint")) out.joint = reader.text("joint");
  out.from = reader.number("from", kMoment, 0.0);
  if (const auto until = reader.maybe_number("until", kMoment)) out.until = *until;
  out.expected = reader.maybe_number("expected", {known ? kind->dimension : Dimension::none, -1e9, 1e9});
  out.crank = reader.number("crank", {Dimension::length, 0, 10}, 0.0);
  out.rod = reader.number("rod", {Dimension::length, 0, 10}, 0.0);
  out.crank_angle = reader.number("crank_angle", {Dimension::angle, -7, 7}, 0.0);
  if (known) check_needs(reader, *kind);
  if (!(out.from < out.until))
    reader.problem("until", fmt::format("{:g} s", out.until), fmt::format("a time after {:g} s", out.from));
  reader.finish();
  return out;
}

Way read_way(MapReader reader, const std::vector<double>& steps) {
  Way way;
  way.name = reader.text("name");
  way.set = read_set(reader, "set");
  way.steps = read_steps(reader, "steps", false);
  if (way.steps.empty()) way.steps = steps;
  if (way.steps.empty()) reader.problem("steps", "no step", "steps of the way or of the case");
  way.quick = reader.flag("quick", true);
  if (reader.has("refused")) way.refused = reader.text("refused");
  reader.finish();
  return way;
}

KnownShort read_known(MapReader reader, const StabilityCase& of) {
  std::vector<std::string> ways;
  std::string measures = of.measures.empty() ? "none" : "";
  for (const MeasureSpec& each : of.measures) measures += (measures.empty() ? "" : ", ") + each.name;
  for (const Way& way : of.ways) ways.push_back(way.name);
  KnownShort out;
  out.way = reader.text("way");
  if (reader.sound() && std::ranges::find(ways, out.way) == ways.end())
    reader.problem("way", out.way, fmt::format("one of {}", fmt::join(ways, ", ")));
  read_items(reader, "measures", [&](const YamlNode& node, const std::string& at) {
    if (std::ranges::find(of.measures, node.text, &MeasureSpec::name) == of.measures.end())
      reader.diagnostics().problems.push_back(
          {node.place(), at, node.described(), "one of the case's measures: " + measures});
    out.measures.push_back(node.text);
  });
  out.steps = read_steps(reader, "steps", false);
  out.why = reader.text("why");
  reader.finish();
  return out;
}

/// `[low, high]`, `{one_of: [left, right]}`, `person` or `rotation`.
DrawnKey read_drawn(const YamlEntry& entry, const std::string& path, Diagnostics& diagnostics) {
  using From = DrawnKey::From;
  DrawnKey out;
  out.key = entry.key;
  const YamlNode& value = entry.value;
  if (value.kind == YamlNode::Kind::scalar && (value.text == "person" || value.text == "rotation")) {
    out.from = value.text == "person" ? From::person : From::rotation;
    return out;
  }
  if (value.kind == YamlNode::Kind::map && value.entries.size() == 1 &&
      value.entries.front().key == "one_of") {
    out.from = From::choices;
    for (const YamlNode& item : value.entries.front().value.items) out.choices.push_back(flow_text(item));
    if (!out.choices.empty()) return out;
  }
  const Quantity any = {Dimension::none, -1e9, 1e9};
  if (value.kind == YamlNode::Kind::sequence && value.items.size() == 2) {
    const auto low = read_number(value.items.front(), path + ".0", any, diagnostics);
    const auto high = read_number(value.items.back(), path + ".1", any, diagnostics);
    if (low && high) out.low = *low, out.high = *high;
    if (!low || !high || *low <= *high) return out;
  }
  diagnostics.problems.push_back({value.place(), path, value.described(),
                                  "two numbers, the lower one first, {one_of: [...]}, person or rotation"});
  return out;
}

Draws read_draws(MapReader reader) {
  Draws out;
  out.count = reader.integer("count", 1, kMostDraws, 1000);
  out.seed = reader.integer("seed", 0, 2'147'483'647, 1);
  const YamlNode* set = reader.child("set");
  if (set && set->kind == YamlNode::Kind::map)
    for (const YamlEntry& entry : set->entries)
      out.keys.push_back(
          read_drawn(entry, fmt::format("{}.{}", reader.path_of("set"), entry.key), reader.diagnostics()));
  if (out.keys.empty())
    reader.problem("set", "no key", "a mapping of dotted keys to the sources of their values");
  reader.finish();
  return out;
}

void read_quick(MapReader& reader, StabilityCase& out) {
  const YamlNode* node = reader.child("quick");
  if (node && node->kind == YamlNode::Kind::scalar) out.in_quick = reader.flag("quick", true);
  if (!node || node->kind == YamlNode::Kind::scalar) return;
  MapReader quick = reader.map("quick");
  out.quick_set = read_set(quick, "set");
  out.quick_steps = read_steps(quick, "steps", false);
  if (quick.has("draws")) out.quick_draws = quick.integer("draws", 1, kMostDraws, 1);
  quick.finish();
}

/// A case needs a measure, and for each measure a way without a known shortfall.
void check_case(MapReader& reader, const StabilityCase& of) {
  std::set<std::string> names;
  for (const MeasureSpec& measure : of.measures) {
    if (!names.insert(measure.name).second)
      reader.problem("measures", measure.name + " a second time", "a unique name for each measure");
    const bool held = std::ranges::any_of(of.ways, [&](const Way& way) {
      return !way.refused && std::ranges::any_of(way.steps, [&](double step) {
        return std::ranges::none_of(
            of.known, [&](const KnownShort& known) { return known.covers(way.name, measure.name, step); });
      });
    });
    if (!held)
      reader.problem("ways", "no way without a known shortfall of " + measure.name,
                     "a way and step whose run must hold " + measure.name);
  }
  const bool refusals = std::ranges::any_of(of.ways, [](const Way& way) { return way.refused.has_value(); });
  if (of.measures.empty() && !refusals)
    reader.problem("measures", "no measure", "a measure, or ways with `refused`");
  std::size_t variants = of.scenes.size();
  for (const std::vector<Alternative>& dimension : of.varied) variants *= dimension.size();
  if (variants > kMostVariants)
    reader.problem("vary", fmt::format("{} combinations", variants),
                   fmt::format("at most {}", kMostVariants));
}

StabilityCase read_case(MapReader reader) {
  StabilityCase out;
  out.name = reader.name("name");
  out.title = reader.text("title");
  out.oracle = reader.text("oracle");
  if (reader.has("scenes"))
    read_items(reader, "scenes", [&](const YamlNode& node, const std::string& path) {
      if (auto scene = scene_path(node, path, reader.diagnostics())) out.scenes.push_back(*scene);
    });
  else if (auto scene = read_scene_path(reader, true))
    out.scenes.push_back(*scene);
  out.set = read_set(reader, "set");
  const auto each = [&](const char* key, std::size_t least, const auto& read) {
    reader.each(key, least, kMostItems, read);
  };
  each("vary", 0, [&](const MapReader& item) { out.varied.push_back(read_dimension(item)); });
  each("measures", 0, [&](const MapReader& item) { out.measures.push_back(read_measure(item)); });
  const std::vector<double> steps = read_steps(reader, "steps", false);
  each("ways", 1, [&](const MapReader& item) { out.ways.push_back(read_way(item, steps)); });
  each("known_short", 0, [&](const MapReader& item) { out.known.push_back(read_known(item, out)); });
  if (reader.has("draws")) out.draws = read_draws(reader.map("draws"));
  out.picture = reader.maybe_number("picture", kMoment);
  out.alone = reader.flag("alone", false);
  read_quick(reader, out);
  if (reader.sound()) check_case(reader, out);
  reader.finish();
  return out;
}

/// Description and YAML of a random person.
std::pair<std::string, std::string> drawn_person(std::mt19937& random) {
  std::uniform_real_distribution<double> stature(1.4, 2.1), mass(40, 150);
  double metres = 0, kilograms = 0, index = 0;
  do {
    metres = stature(random), kilograms = mass(random);
    index = kilograms / (metres * metres);
  } while (index < 14 || index > 50);
  const char* sex = random() % 2 == 0 ? "male" : "female";
  return {fmt::format("{:.2f} m, {:.0f} kg, {}", metres, kilograms, sex),
          fmt::format("{{stature: {:.4f}, mass: {:.3f}, sex: {}}}", metres, kilograms, sex)};
}

/// Uniform over all rotations: the direction of four normally distributed numbers (Marsaglia 1972).
std::string drawn_rotation(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const double w = normal(random), x = normal(random), y = normal(random), z = normal(random);
  const Vec3 turn = rotation_vector(Quat(w, x, y, z).normalized());
  const double angle = turn.norm();
  const Vec3 axis = angle > 0 ? Vec3(turn / angle) : Vec3(Vec3::UnitX());
  return fmt::format("{{axis: [{:.6f}, {:.6f}, {:.6f}], angle: {:.6f}}}", axis.x(), axis.y(), axis.z(),
                     angle);
}

}  // namespace

StabilitySpec load_stability(const std::filesystem::path& path) {
  YamlNode root = load_yaml(path);
  Diagnostics diagnostics;
  if (!scene::is_of_kind(root, "", scene::FileKind::stability, diagnostics))
    throw Error(diagnostics.problems);
  MapReader reader(root, "", diagnostics);
  StabilitySpec spec;
  spec.title = reader.text("title", "hard cases");
  // The place of YAML anchors that several cases use.
  reader.child("shared");
  std::set<std::string> names;
  reader.each("cases", 1, kMostItems, [&](MapReader item) {
    const std::string& name = spec.cases.emplace_back(read_case(item)).name;
    if (!name.empty() && !names.insert(name).second)
      item.problem("name", name + " a second time", "a unique name for each case");
  });
  reader.finish();
  diagnostics.throw_if_any();
  return spec;
}

std::vector<Alternative> drawn_variants(const Draws& draws, int most) {
  std::mt19937 random(static_cast<unsigned>(draws.seed));
  std::vector<Alternative> out;
  for (int i = 0; i < std::min(draws.count, most); ++i) {
    Alternative& variant = out.emplace_back();
    variant.name = fmt::format("draw {}", i + 1);
    std::string person;
    for (const DrawnKey& key : draws.keys) {
      std::string value;
      switch (key.from) {
        case DrawnKey::From::person:
          if (person.empty()) {
            std::string described;
            std::tie(described, person) = drawn_person(random);
            variant.name += ": " + described;
          }
          value = person;
          break;
        case DrawnKey::From::rotation:
          value = drawn_rotation(random);
          break;
        case DrawnKey::From::range:
          value = number_text(std::uniform_real_distribution<double>(key.low, key.high)(random));
          break;
        case DrawnKey::From::choices:
          value = key.choices[random() % key.choices.size()];
          break;
      }
      variant.set.push_back(key.key + "=" + value);
    }
  }
  return out;
}

std::vector<Variant> variants(const StabilityCase& of, bool quick) {
  std::vector<Variant> out;
  for (const std::filesystem::path& scene : of.scenes)
    out.push_back({scene, of.scenes.size() > 1 ? scene.stem().string() : "", {}});
  std::vector<std::vector<Alternative>> dimensions = of.varied;
  if (of.draws)
    dimensions.push_back(
        drawn_variants(*of.draws, quick ? of.quick_draws.value_or(of.draws->count) : of.draws->count));
  for (const std::vector<Alternative>& dimension : dimensions) {
    std::vector<Variant> more;
    for (const Variant& chosen : out)
      for (const Alternative& alternative : dimension) {
        Variant& both = more.emplace_back(chosen);
        both.name += (both.name.empty() ? "" : ", ") + alternative.name;
        both.set.insert(both.set.end(), alternative.set.begin(), alternative.set.end());
      }
    out = std::move(more);
  }
  return out;
}

}  // namespace handsim::study
