#include "handsim/hand/hand_spec.h"

#include <cmath>

#include <fmt/format.h>

namespace handsim::hand {

namespace {

using model::JointKind;
using model::Tint;

const std::vector<std::pair<std::string_view, Tint>> kFingers = {{"thumb", Tint::thumb},
                                                                 {"index", Tint::index},
                                                                 {"middle", Tint::middle},
                                                                 {"ring", Tint::ring},
                                                                 {"little", Tint::little}};
const std::vector<std::pair<std::string_view, JointKind>> kKinds = {{"hinge", JointKind::hinge},
                                                                    {"universal", JointKind::universal}};
const Quantity kAngle = {Dimension::angle, -M_PI, M_PI};
const Quantity kShare = {Dimension::none, 0, 1};

std::string_view unit_of(LengthRule::Base base) {
  switch (base) {
    case LengthRule::Base::metre:
      return "m";
    case LengthRule::Base::hand_length:
      return "HL";
    case LengthRule::Base::hand_breadth:
      return "HB";
    case LengthRule::Base::hand_thickness:
      return "HT";
  }
  return {};
}

std::optional<LengthRule> parse_rule(std::string_view text) {
  for (const LengthRule::Base base :
       {LengthRule::Base::hand_length, LengthRule::Base::hand_breadth, LengthRule::Base::hand_thickness}) {
    const std::string suffix = fmt::format(" {}", unit_of(base));
    if (!text.ends_with(suffix)) continue;
    const std::optional<double> factor = parse_number(text.substr(0, text.size() - suffix.size()));
    if (factor && std::abs(*factor) <= 10) return LengthRule{*factor, base};
    return std::nullopt;
  }
  const std::optional<double> metres = parse_quantity(text, Dimension::length);
  if (metres && std::abs(*metres) <= 10) return LengthRule{*metres, LengthRule::Base::metre};
  return std::nullopt;
}

constexpr std::string_view kRuleNeed = "a length such as \"0.245 HL\" (hand length), \"0.1 HB\" (breadth), "
                                       "\"1 HT\" (thickness) or \"45 mm\"";

LengthRule read_rule(const YamlNode& node, const std::string& path, bool positive, Diagnostics& diagnostics) {
  const std::optional<LengthRule> rule = node.kind == YamlNode::Kind::scalar ? parse_rule(node.text) : std::nullopt;
  if (rule && (!positive || rule->factor > 0)) return *rule;
  diagnostics.problems.push_back(
      {node.place(), path, node.described(), std::string(kRuleNeed) + (positive ? ", above 0" : "")});
  return {1, LengthRule::Base::hand_breadth};
}

LengthRule read_length(MapReader& reader, std::string_view key) {
  if (const YamlNode* node = reader.child(key)) return read_rule(*node, reader.path_of(key), true, reader.diagnostics());
  reader.problem(key, "nothing", std::string(kRuleNeed));
  return {1, LengthRule::Base::hand_breadth};
}

std::optional<std::array<LengthRule, 3>> read_place(MapReader& reader, std::string_view key) {
  const YamlNode* node = reader.child(key);
  if (!node) return std::nullopt;
  if (node->kind != YamlNode::Kind::sequence || node->items.size() != 3) {
    reader.problem(key, node->described(), "a list of three lengths");
    return std::nullopt;
  }
  std::array<LengthRule, 3> out;
  for (std::size_t i = 0; i < 3; ++i)
    out[i] = read_rule(node->items[i], fmt::format("{}.{}", reader.path_of(key), i), false, reader.diagnostics());
  return out;
}

model::JointAxis read_axis(MapReader reader, std::vector<std::string>& sources) {
  model::JointAxis axis;
  axis.name = reader.text("name");
  const Vec3 direction = reader.vector("axis", {Dimension::none, -1e6, 1e6});
  if (direction.norm() < 1e-9)
    reader.problem("axis", "a vector of length 0", "a direction");
  else
    axis.axis = direction.normalized();
  if (const auto range = reader.maybe_range("range", kAngle)) {
    model::Stop stop{range->first, range->second, 0, 1};
    stop.bounce = reader.number("bounce", kShare, 0.0);
    stop.fudge_factor = reader.number("fudge_factor", kShare, 1.0);
    axis.stop = stop;
  } else if (!reader.has("range")) {
    reader.problem("range", "nothing", "a list of two angles, low then high");
  }
  model::Tissue tissue;
  const auto stiffness = reader.maybe_number("stiffness", {Dimension::rotational_stiffness, 0, 1e3});
  const auto damping = reader.maybe_number("damping", {Dimension::rotational_damping, 0, 1e3});
  const auto rest = reader.maybe_number("rest", kAngle);
  tissue.stiffness = stiffness.value_or(0);
  tissue.damping = damping.value_or(0);
  tissue.rest = rest.value_or(0);
  if (tissue.stiffness > 0 || tissue.damping > 0) axis.tissue = tissue;
  sources.push_back(reader.text("source", ""));
  reader.finish();
  return axis;
}

JointSpec read_joint(MapReader& reader, std::optional<JointKind> kind) {
  JointSpec joint;
  joint.name = reader.text("name");
  if (kind) joint.kind = *kind;
  else joint.kind = reader.choice<JointKind>("type", kKinds);
  YamlNode* axes = reader.list("axes", true);
  if (!axes) return joint;
  for (std::size_t i = 0; i < axes->items.size(); ++i)
    joint.axes.push_back(read_axis(
        MapReader(axes->items[i], fmt::format("{}.{}", reader.path_of("axes"), i), reader.diagnostics()), joint.sources));
  return joint;
}

void check_axes(MapReader& reader, const JointSpec& joint) {
  const auto wanted = static_cast<std::size_t>(model::dof_count(joint.kind));
  if (joint.axes.size() != wanted)
    reader.problem("axes", fmt::format("{} axes", joint.axes.size()),
                   wanted == 1 ? "one axis for a hinge" : "two axes for a universal joint");
  else if (wanted == 2 && std::abs(joint.axes[0].axis.dot(joint.axes[1].axis)) > 1e-9)
    reader.problem("axes", fmt::format("axes {:.3g} deg apart", std::acos(joint.axes[0].axis.dot(joint.axes[1].axis)) * 180 / M_PI),
                   "perpendicular axes");
}

MassRule read_mass(MapReader reader) {
  MassRule rule;
  rule.kind = reader.choice<MassRule::Kind>("rule", {{"body_mass_share", MassRule::Kind::body_mass_share},
                                                     {"density", MassRule::Kind::density}});
  const Quantity share = {Dimension::none, 0, 0.1, true};
  if (rule.kind == MassRule::Kind::body_mass_share) {
    rule.male = reader.number("male", share);
    rule.female = reader.number("female", share);
    rule.unknown = reader.number("unknown", share);
  } else {
    rule.density = reader.number("density", {Dimension::density, 1, 1e5});
  }
  rule.source = reader.text("source", "");
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
  const std::string parent = reader.text("parent");
  segment.parent = find_segment(spec.segments, parent);
  if (segment.parent != kPalm) {
    spec.segments[static_cast<std::size_t>(segment.parent)].has_child = true;
  } else if (parent != "palm" && !parent.empty()) {
    std::vector<std::string> known = {"palm"};
    for (const SegmentSpec& row : spec.segments) known.push_back(row.name);
    const auto near = nearest_word(parent, known);
    reader.problem("parent", parent, "palm or a segment above this row" + (near ? " (nearest: " + *near + ")" : ""));
  }
}

SegmentSpec read_segment(MapReader reader, HandSpec& spec) {
  SegmentSpec segment;
  segment.place = reader.node().place();
  segment.name = reader.text("name");
  if (segment.name == "palm" || find_segment(spec.segments, segment.name) != kPalm)
    reader.problem("name", segment.name + " a second time", "a name of its own for each segment");
  segment.finger = reader.choice<Tint>("finger", kFingers);
  read_parent(reader, segment, spec);
  segment.at = read_place(reader, "at");
  if (segment.parent == kPalm && !segment.at) reader.problem("at", "nothing", "the joint's place in the palm");
  segment.rotation = reader.rotation("rotation");
  segment.length = read_length(reader, "length");
  segment.radius = read_length(reader, "radius");
  if (spec.mass.kind == MassRule::Kind::body_mass_share)
    segment.mass_share = reader.number("mass_share", {Dimension::none, 0, 1, true});
  MapReader joint = reader.map("joint");
  segment.joint = read_joint(joint, std::nullopt);
  check_axes(joint, segment.joint);
  for (const SegmentSpec& other : spec.segments)
    if (other.joint.name == segment.joint.name)
      joint.problem("name", segment.joint.name + " a second time", "a name of its own for each joint");
  joint.finish();
  reader.finish();
  return segment;
}

void read_segments(MapReader& reader, HandSpec& spec) {
  YamlNode* rows = reader.list("segments", true);
  if (!rows) return;
  if (rows->items.empty()) reader.problem("segments", "an empty list", "at least one segment");
  double shares = 0;
  for (std::size_t i = 0; i < rows->items.size(); ++i) {
    spec.segments.push_back(
        read_segment(MapReader(rows->items[i], fmt::format("segments.{}", i), reader.diagnostics()), spec));
    shares += spec.segments.back().mass_share;
  }
  if (shares >= 1) reader.problem("segments", fmt::format("mass shares of {:g} in all", shares), "less than 1, the palm has the rest");
}

void read_wrist(MapReader reader, HandSpec& spec) {
  spec.wrist = read_joint(reader, JointKind::universal);
  if (spec.wrist.axes.size() == 1) spec.wrist.kind = JointKind::hinge;
  check_axes(reader, spec.wrist);
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

std::string LengthRule::text() const { return fmt::format("{:g} {}", factor, unit_of(base)); }

std::string_view name(Tint finger) {
  for (const auto& entry : kFingers)
    if (entry.second == finger) return entry.first;
  return "palm";
}

HandSpec read_hand_spec(YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  MapReader reader(node, path, diagnostics);
  HandSpec spec;
  spec.title = reader.text("title", "a hand");
  if (YamlNode* sources = reader.child("sources"))
    for (const YamlEntry& entry : sources->entries) spec.sources[entry.key] = entry.value.text;
  if (YamlNode* file = reader.child("anthropometry")) {
    try {
      follow_reference(*file, reader.path_of("anthropometry"));
      spec.anthropometry = read_anthropometry(*file, reader.path_of("anthropometry"), diagnostics);
    } catch (const Error& error) {
      diagnostics.take(error);
    }
  } else {
    reader.problem("anthropometry", "nothing", "the path of an anthropometry file");
  }
  spec.mass = read_mass(reader.map("mass"));
  spec.palm = read_palm(reader.map("palm"));
  read_wrist(reader.map("wrist"), spec);
  MapReader skin = reader.map("skin");
  spec.skin.name = "skin";
  spec.skin.friction = skin.number("friction", {Dimension::none, 0, 10}, 0.8);
  spec.skin.restitution = skin.number("restitution", kShare, 0.0);
  skin.finish();
  read_segments(reader, spec);
  reader.finish();
  return spec;
}

}  // namespace handsim::hand
