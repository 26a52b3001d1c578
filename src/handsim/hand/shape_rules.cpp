#include "handsim/hand/shape_rules.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/units.h"

namespace handsim::hand {

namespace {

/// Largest term of a rule: twice a hand dimension, or half a metre.
constexpr double kMostShares = 2, kMostMetres = 0.5;
constexpr std::size_t kMostShapes = 20;
/// Sizes of the built parts [m].
constexpr double kThinnest = 1e-5, kLongest = 10;
/// Capsules lie along z.
const Vec3 kAlong = Vec3::UnitZ();

bool add_term(std::string_view text, double sign, LengthRule& rule) {
  const std::pair<std::string_view, double*> shares[] = {
      {" HL", &rule.lengths}, {" HB", &rule.breadths}, {" HT", &rule.thicknesses}};
  for (const auto& [suffix, sum] : shares) {
    if (!text.ends_with(suffix)) continue;
    const std::optional<double> factor = parse_number(text.substr(0, text.size() - suffix.size()));
    if (!factor || !(std::abs(*factor) <= kMostShares)) return false;
    *sum += sign * *factor;
    return true;
  }
  const std::optional<double> metres = parse_quantity(text, Dimension::length);
  if (!metres || !(std::abs(*metres) <= kMostMetres)) return false;
  rule.metres += sign * *metres;
  return true;
}

std::optional<LengthRule> parse_rule(std::string_view text) {
  LengthRule rule;
  double sign = 1;
  while (true) {
    std::size_t end = text.find(' ');
    while (end != std::string_view::npos && !text.substr(end).starts_with(" + ") &&
           !text.substr(end).starts_with(" - "))
      end = text.find(' ', end + 1);
    if (!add_term(text.substr(0, end), sign, rule)) return std::nullopt;
    if (end == std::string_view::npos) return rule;
    sign = text[end + 1] == '+' ? 1 : -1;
    text.remove_prefix(end + 3);
  }
}

constexpr std::string_view kRuleNeed =
    "a length such as \"0.245 HL\" (hand length), \"0.1 HB\" (breadth), "
    "\"1 HT\" (thickness), \"45 mm\" or a sum \"0.5 HB - 0.5 HT\", at most 2 of these or 0.5 m";

/// True unless no hand can make the length positive.
bool may_be_positive(const LengthRule& rule) {
  return rule.metres > 0 || rule.lengths > 0 || rule.breadths > 0 || rule.thicknesses > 0;
}

LengthRule read_rule(const YamlNode& node, const std::string& path, bool positive, Diagnostics& diagnostics) {
  const std::optional<LengthRule> rule =
      node.kind == YamlNode::Kind::scalar ? parse_rule(node.text) : std::nullopt;
  if (rule && (!positive || may_be_positive(*rule))) return *rule;
  diagnostics.problems.push_back(
      {node.place(), path, node.described(), std::string(kRuleNeed) + (positive ? ", above 0" : "")});
  LengthRule instead;
  instead.breadths = 1;
  return instead;
}

PlaceRule required_place(MapReader& reader, std::string_view key) {
  const std::optional<PlaceRule> out = read_place(reader, key);
  if (!out && reader.sound()) reader.problem(key, "nothing", "a list of three lengths");
  return out.value_or(PlaceRule{});
}

ShapeSpec read_shape(MapReader reader) {
  ShapeSpec out;
  out.place = reader.node().place();
  out.name = reader.name("name");
  if (reader.has("edges")) {
    out.edges = read_place(reader, "edges");
    out.at = required_place(reader, "at");
    out.rotation = reader.rotation("rotation");
  } else {
    out.from = required_place(reader, "from");
    out.to = required_place(reader, "to");
    out.radius = read_length(reader, "radius");
  }
  reader.finish();
  return out;
}

}  // namespace

double LengthRule::value(const HandSize& size) const {
  return metres + lengths * size.length + breadths * size.breadth + thicknesses * size.thickness;
}

Vec3 position(const PlaceRule& rules, const HandSize& size) {
  return {rules[0].value(size), rules[1].value(size), rules[2].value(size)};
}

void check_size(const Place& place, const std::string& key, double value, std::vector<Problem>& problems) {
  if (!(value > kThinnest && value <= kLongest))
    problems.push_back({place, "model." + key, fmt::format("{:.3g} m for this person", value),
                        "above 0.01 mm, at most 10 m"});
}

void throw_if_any(std::vector<Problem> problems) {
  if (!problems.empty()) throw Error(std::move(problems));
}

model::Shape shape_of(const ShapeSpec& spec, const HandSize& size) {
  std::vector<Problem> problems;
  const auto check = [&](const char* key, double value) {
    check_size(spec.place, fmt::format("shapes.{}.{}", spec.name, key), value, problems);
  };
  model::Shape out;
  out.name = spec.name;
  if (spec.edges) {
    out.kind = model::ShapeKind::box;
    out.edges = position(*spec.edges, size);
    for (int i = 0; i < 3; ++i) check("edges", out.edges[i]);
    throw_if_any(std::move(problems));
    out.pose = {position(spec.at, size), spec.rotation};
    return out;
  }
  const Vec3 from = position(spec.from, size), to = position(spec.to, size);
  out.kind = model::ShapeKind::capsule;
  out.radius = spec.radius.value(size);
  out.length = (to - from).norm();
  check("radius", out.radius);
  check("to", out.length);
  throw_if_any(std::move(problems));
  out.pose = {0.5 * (from + to), rotation_between(kAlong, to - from)};
  return out;
}

LengthRule read_length(MapReader& reader, std::string_view key) {
  if (const YamlNode* node = reader.value(key, {{YamlNode::Kind::scalar}, std::string(kRuleNeed)}))
    return read_rule(*node, reader.path_of(key), true, reader.diagnostics());
  LengthRule instead;
  instead.breadths = 1;
  return instead;
}

std::optional<PlaceRule> read_place(MapReader& reader, std::string_view key) {
  const YamlNode* node = reader.value(key, {{YamlNode::Kind::sequence}, "a list of three lengths", false});
  if (!node) return std::nullopt;
  if (node->items.size() != 3) {
    reader.problem(key, node->described(), "a list of three lengths");
    return std::nullopt;
  }
  PlaceRule out;
  for (std::size_t i = 0; i < 3; ++i)
    out[i] =
        read_rule(node->items[i], fmt::format("{}.{}", reader.path_of(key), i), false, reader.diagnostics());
  return out;
}

std::vector<ShapeSpec> read_shapes(MapReader& reader, std::string_view key, std::size_t least) {
  std::vector<ShapeSpec> out;
  reader.each(key, least, kMostShapes, [&](MapReader row) {
    const bool taken = std::ranges::any_of(out, [&](const ShapeSpec& other) {
      return row.has("name") && other.name == row.child("name")->text;
    });
    if (taken)
      row.problem("name", row.child("name")->text + " a second time", "a unique name for each shape");
    out.push_back(read_shape(std::move(row)));
  });
  return out;
}

}  // namespace handsim::hand
