#include "handsim/hand/hand_spec.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/units.h"
#include "handsim/hand/material.h"

namespace handsim::hand {

namespace {

using model::JointKind;
using model::Part;

const std::vector<std::pair<std::string_view, Part>> kFingers = {{"thumb", Part::thumb},
                                                                 {"index", Part::index},
                                                                 {"middle", Part::middle},
                                                                 {"ring", Part::ring},
                                                                 {"little", Part::little}};
const std::vector<std::pair<std::string_view, JointKind>> kKinds = {{"hinge", JointKind::hinge},
                                                                    {"universal", JointKind::universal}};
/// Largest length of a rule: twice a hand dimension, or half a metre.
constexpr double kMostShares = 2, kMostMetres = 0.5;
constexpr std::size_t kMostSegments = 100;
const Quantity kAngle = {Dimension::angle, -M_PI, M_PI};
const Quantity kShare = {Dimension::none, 0, 1};

std::optional<LengthRule> parse_rule(std::string_view text) {
  using Base = LengthRule::Base;
  for (const auto& [suffix, base] : {std::pair<std::string_view, Base>{" HL", Base::hand_length},
                                     {" HB", Base::hand_breadth},
                                     {" HT", Base::hand_thickness}}) {
    if (!text.ends_with(suffix)) continue;
    const std::optional<double> factor = parse_number(text.substr(0, text.size() - suffix.size()));
    if (factor && std::abs(*factor) <= kMostShares) return LengthRule{*factor, base};
    return std::nullopt;
  }
  const std::optional<double> metres = parse_quantity(text, Dimension::length);
  if (metres && std::abs(*metres) <= kMostMetres) return LengthRule{*metres, Base::metre};
  return std::nullopt;
}

constexpr std::string_view kRuleNeed =
    "a length such as \"0.245 HL\" (hand length), \"0.1 HB\" (breadth), "
    "\"1 HT\" (thickness) or \"45 mm\", at most 2 of these or 0.5 m";

LengthRule read_rule(const YamlNode& node, const std::string& path, bool positive, Diagnostics& diagnostics) {
  const std::optional<LengthRule> rule =
      node.kind == YamlNode::Kind::scalar ? parse_rule(node.text) : std::nullopt;
  if (rule && (!positive || rule->factor > 0)) return *rule;
  diagnostics.problems.push_back(
      {node.place(), path, node.described(), std::string(kRuleNeed) + (positive ? ", above 0" : "")});
  return {1, LengthRule::Base::hand_breadth};
}

LengthRule read_length(MapReader& reader, std::string_view key) {
  if (const YamlNode* node = reader.value(key, {{YamlNode::Kind::scalar}, std::string(kRuleNeed)}))
    return read_rule(*node, reader.path_of(key), true, reader.diagnostics());
  return {1, LengthRule::Base::hand_breadth};
}

std::optional<std::array<LengthRule, 3>> read_place(MapReader& reader, std::string_view key) {
  const YamlNode* node = reader.value(key, {{YamlNode::Kind::sequence}, "a list of three lengths", false});
  if (!node) return std::nullopt;
  if (node->items.size() != 3) {
    reader.problem(key, node->described(), "a list of three lengths");
    return std::nullopt;
  }
  std::array<LengthRule, 3> out;
  for (std::size_t i = 0; i < 3; ++i)
    out[i] =
        read_rule(node->items[i], fmt::format("{}.{}", reader.path_of(key), i), false, reader.diagnostics());
  return out;
}

model::JointAxis read_axis(MapReader reader) {
  model::JointAxis axis;
  axis.name = reader.name("name");
  axis.axis = reader.direction("axis");
  if (const auto range = reader.maybe_range("range", kAngle, true)) {
    model::Stop stop{range->first, range->second};
    stop.bounce = reader.number("bounce", kShare, 0.0);
    stop.ode.fudge_factor = reader.number("fudge_factor", kShare, 1.0);
    axis.stop = stop;
  }
  model::Tissue tissue;
  tissue.stiffness = reader.maybe_number("stiffness", {Dimension::rotational_stiffness, 0, 1e3}).value_or(0);
  tissue.damping = reader.maybe_number("damping", {Dimension::rotational_damping, 0, 1e3}).value_or(0);
  tissue.rest = reader.maybe_number("rest", kAngle).value_or(0);
  if (tissue.stiffness > 0 || tissue.damping > 0) axis.tissue = tissue;
  reader.maybe_text("source");
  reader.finish();
  return axis;
}

/// @param any_kind one axis or two, whatever the joint's kind.
void check_axes(MapReader& reader, const JointSpec& joint, bool any_kind) {
  const std::size_t count = joint.axes.size();
  const auto needed = static_cast<std::size_t>(model::dof_count(joint.kind));
  if (any_kind ? count < 1 || count > 2 : count != needed)
    return reader.problem("axes", count == 1 ? "one axis" : fmt::format("{} axes", count),
                          any_kind      ? "one axis or two"
                          : needed == 1 ? "one axis for a hinge"
                                        : "two axes for a universal joint");
  check_axis_pair(reader, joint.axes);
}

/// @param kind absent: given in the file as `type`; present (the wrist): one axis or two.
JointSpec read_joint(MapReader& reader, std::optional<JointKind> kind) {
  JointSpec joint;
  joint.name = reader.name("name");
  if (kind)
    joint.kind = *kind;
  else
    joint.kind = reader.choice<JointKind>("type", kKinds);
  reader.each("axes", 1, 2, [&](MapReader axis) { joint.axes.push_back(read_axis(std::move(axis))); });
  if (reader.sound()) check_axes(reader, joint, kind.has_value());
  return joint;
}

/// Nothing if the kind of rule is missing or unknown.
std::optional<MassRule> read_mass(MapReader reader) {
  MassRule rule;
  rule.kind = reader.choice<MassRule::Kind>(
      "rule", {{"body_mass_share", MassRule::Kind::body_mass_share}, {"density", MassRule::Kind::density}});
  if (!reader.has("rule") || !reader.sound()) return std::nullopt;
  const Quantity share = {Dimension::none, 0, 0.1, true};
  if (rule.kind == MassRule::Kind::body_mass_share) {
    rule.male = reader.number("male", share);
    rule.female = reader.number("female", share);
    rule.unknown = reader.number("unknown", share);
  } else {
    rule.density = reader.number("density", {Dimension::density, 1, 1e5});
  }
  rule.source = reader.maybe_text("source").value_or("");
  reader.finish();
  return rule;
}

PalmSpec read_palm(MapReader reader) {
  PalmSpec palm;
  palm.length = read_length(reader, "length");
  palm.breadth = read_length(reader, "breadth");
  palm.thickness = read_length(reader, "thickness");
  palm.offset = read_place(reader, "offset").value_or(std::array<LengthRule, 3>{});
  reader.finish();
  return palm;
}

int find_segment(const std::vector<SegmentSpec>& segments, std::string_view name) {
  for (std::size_t i = 0; i < segments.size(); ++i)
    if (segments[i].name == name) return static_cast<int>(i);
  return kPalm;
}

void read_parent(MapReader& reader, SegmentSpec& segment, HandSpec& spec) {
  const std::string parent = reader.name("parent");
  segment.parent = find_segment(spec.segments, parent);
  if (segment.parent != kPalm) {
    spec.segments[static_cast<std::size_t>(segment.parent)].has_child = true;
  } else if (parent != "palm" && !parent.empty()) {
    std::vector<std::string> known = {"palm"};
    for (const SegmentSpec& row : spec.segments) known.push_back(row.name);
    reader.problem("parent", parent, "palm or a segment above this row" + nearest_hint(parent, known));
  }
}

/// Reads the joint of a segment; its name must be unique in the hand.
JointSpec read_segment_joint(MapReader reader, const HandSpec& spec) {
  JointSpec joint = read_joint(reader, std::nullopt);
  bool taken = joint.name == spec.wrist.name;
  for (const SegmentSpec& other : spec.segments) taken = taken || other.joint.name == joint.name;
  if (taken && !joint.name.empty())
    reader.problem("name", joint.name + " a second time", "a unique name for each joint");
  reader.finish();
  return joint;
}

SegmentSpec read_segment(MapReader reader, HandSpec& spec, const std::optional<MassRule>& mass) {
  SegmentSpec segment;
  segment.place = reader.node().place();
  segment.name = reader.name("name");
  const bool taken = segment.name == "palm" || find_segment(spec.segments, segment.name) != kPalm;
  if (taken && !segment.name.empty())
    reader.problem("name", segment.name + " a second time", "a unique name for each segment");
  segment.finger = reader.choice<Part>("finger", kFingers);
  read_parent(reader, segment, spec);
  segment.at = read_place(reader, "at");
  if (reader.sound() && segment.parent == kPalm && !segment.at)
    reader.problem("at", "nothing", "the joint's place in the palm");
  segment.rotation = reader.rotation("rotation");
  segment.length = read_length(reader, "length");
  segment.radius = read_length(reader, "radius");
  if (!mass)
    reader.child("mass_share");
  else if (mass->kind == MassRule::Kind::body_mass_share)
    segment.mass_share = reader.number("mass_share", {Dimension::none, 0, 1, true});
  segment.joint =
      read_segment_joint(reader.required_map("joint", "a mapping with name, type and axes"), spec);
  reader.finish();
  return segment;
}

void read_segments(MapReader& reader, HandSpec& spec, const std::optional<MassRule>& mass) {
  double shares = 0;
  reader.each("segments", 1, kMostSegments, [&](MapReader row) {
    spec.segments.push_back(read_segment(std::move(row), spec, mass));
    shares += spec.segments.back().mass_share;
  });
  if (reader.sound() && shares >= 1)
    reader.problem("segments", fmt::format("mass shares of {:g} in all", shares),
                   "less than 1, the palm has the rest");
}

void read_wrist(MapReader reader, HandSpec& spec) {
  spec.wrist = read_joint(reader, JointKind::universal);
  if (spec.wrist.axes.size() == 1) spec.wrist.kind = JointKind::hinge;
  reader.finish();
}

}  // namespace

double LengthRule::value(const HandSize& size) const {
  switch (base) {
    case Base::metre:
      return factor;
    case Base::hand_length:
      return factor * size.length;
    case Base::hand_breadth:
      return factor * size.breadth;
    case Base::hand_thickness:
      return factor * size.thickness;
  }
  return 0;
}

void check_axis_pair(MapReader& reader, const std::vector<model::JointAxis>& axes) {
  if (axes.size() < 2) return;
  const double cosine = axes[0].axis.dot(axes[1].axis);
  if (std::abs(cosine) > 1e-9)
    reader.problem(
        "axes",
        fmt::format("axes {:.9g} deg apart", kDegreesPerRadian * std::acos(std::clamp(cosine, -1.0, 1.0))),
        "perpendicular axes");
  if (axes[0].name == axes[1].name)
    reader.problem("axes", fmt::format("two axes called {}", axes[0].name), "a unique name for each axis");
}

HandSpec read_hand_spec(YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  MapReader reader(node, path, diagnostics);
  HandSpec spec;
  spec.title = reader.text("title", "a hand");
  spec.sources = reader.named_texts("sources");
  if (YamlNode* file = reader.file_or_block("anthropometry", "an anthropometry file"))
    spec.anthropometry = read_anthropometry(*file, reader.path_of("anthropometry"), diagnostics);
  const std::optional<MassRule> mass =
      read_mass(reader.required_map("mass", "a mapping with the rule of the hand's mass"));
  spec.mass = mass.value_or(MassRule{});
  spec.palm = read_palm(reader.required_map("palm", "a mapping with length, breadth and thickness"));
  read_wrist(reader.required_map("wrist", "a mapping with name and axes"), spec);
  MapReader skin = reader.map("skin");
  spec.skin = read_material(skin, "skin");
  skin.finish();
  read_segments(reader, spec, mass);
  if (YamlNode* file = reader.file_or_block("muscles", "muscles of a hand", false))
    spec.muscles = read_muscle_file(*file, reader.path_of("muscles"), hand_axes(spec), diagnostics);
  reader.finish();
  return spec;
}

std::vector<HandAxis> hand_axes(const HandSpec& spec) {
  std::vector<HandAxis> out;
  const auto add = [&](const JointSpec& joint) {
    for (const model::JointAxis& axis : joint.axes) {
      HandAxis& each = out.emplace_back();
      each.name = joint.name + "." + axis.name;
      if (axis.stop) {
        each.low = axis.stop->low;
        each.high = axis.stop->high;
      }
      if (axis.tissue) each.rest = axis.tissue->rest;
    }
  };
  add(spec.wrist);
  for (const SegmentSpec& segment : spec.segments) add(segment.joint);
  return out;
}

}  // namespace handsim::hand
