#include "handsim/hand/hand_file.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <mutex>
#include <utility>

#include <fmt/format.h>

#include "handsim/core/text.h"
#include "handsim/core/units.h"
#include "handsim/hand/what_if.h"
#include "handsim/model/surface_reader.h"

namespace handsim::hand {

namespace {

using model::JointKind;
using model::Part;

/// Types of a row's joint; a ball is a universal joint and a hinge, with a carrier between them.
enum class RowJoint { hinge, universal, ball, fixed };
const std::vector<std::pair<std::string_view, RowJoint>> kTypes = {{"hinge", RowJoint::hinge},
                                                                   {"universal", RowJoint::universal},
                                                                   {"ball", RowJoint::ball},
                                                                   {"fixed", RowJoint::fixed}};
constexpr std::size_t kMostSegments = 100;
const Quantity kAngle = {Dimension::angle, -M_PI, M_PI};

model::JointAxis read_axis(MapReader reader) {
  model::JointAxis axis;
  axis.name = reader.name("name");
  axis.axis = reader.direction("axis");
  if (const auto range = reader.maybe_range("range", kAngle, true)) {
    axis.stop = model::Stop{range->first, range->second};
    reader.fields(*axis.stop);
  }
  model::Tissue tissue;
  reader.fields(tissue);
  if (tissue.stiffness > 0 || tissue.damping > 0) axis.tissue = tissue;
  reader.maybe_text("source");
  reader.finish();
  return axis;
}

void check_axes(MapReader& reader, const JointSpec& joint, std::size_t least, std::size_t most,
                const char* need) {
  const std::size_t count = joint.axes.size();
  if (count < least || count > most)
    return reader.problem("axes", count == 1 ? "one axis" : fmt::format("{} axes", count), need);
  check_axis_pair(reader, joint.axes);
}

void read_axes(MapReader& reader, JointSpec& joint) {
  reader.each("axes", 1, 3, [&](MapReader axis) { joint.axes.push_back(read_axis(std::move(axis))); });
}

/// The joint of a row: three axes with a ball, none where it is fixed.
JointSpec read_joint(MapReader& reader, RowJoint type) {
  JointSpec joint;
  if (type == RowJoint::fixed) return joint;
  joint.name = reader.name("name");
  joint.kind = type == RowJoint::hinge ? JointKind::hinge : JointKind::universal;
  read_axes(reader, joint);
  const auto needed = static_cast<std::size_t>(type) + 1;
  if (reader.sound())
    check_axes(reader, joint, needed, needed,
               type == RowJoint::hinge       ? "one axis for a hinge"
               : type == RowJoint::universal ? "two axes for a universal joint"
                                             : "three axes for a ball joint");
  return joint;
}

/// Nothing if the kind of rule is missing or unknown.
std::optional<MassRule> read_mass(MapReader reader) {
  MassRule rule;
  rule.kind = reader.choice<MassRule::Kind>("rule", {{"body_mass_share", MassRule::Kind::body_mass_share},
                                                     {"tissue_density", MassRule::Kind::tissue_density},
                                                     {"density", MassRule::Kind::density}});
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

PalmSpec read_palm(MapReader reader, const std::optional<MassRule>& mass) {
  PalmSpec palm;
  palm.place = reader.node().place();
  if (reader.has("shapes")) {
    palm.shapes = read_shapes(reader, "shapes", 1);
    palm.matter = read_shapes(reader, "matter", 0);
    for (const ShapeSpec& row : palm.matter)
      if (std::ranges::find(palm.shapes, row.name, &ShapeSpec::name) == palm.shapes.end())
        reader.problem("matter", row.name, "the name of one of the palm's shapes, with which it goes");
  } else {
    palm.length = read_length(reader, "length");
    palm.breadth = read_length(reader, "breadth");
    palm.thickness = read_length(reader, "thickness");
    palm.offset = read_place(reader, "offset").value_or(PlaceRule{});
  }
  if (!mass)
    reader.child("mass_share");
  else if (mass->kind == MassRule::Kind::body_mass_share)
    palm.mass_share = reader.maybe_number("mass_share", {Dimension::none, 0, 1, true});
  reader.finish();
  return palm;
}

std::optional<std::size_t> find_segment(const std::vector<SegmentSpec>& segments, std::string_view name) {
  const auto found = std::ranges::find(segments, name, &SegmentSpec::name);
  return found == segments.end() ? std::nullopt : std::optional(as_index(found - segments.begin()));
}

void read_parent(MapReader& reader, SegmentSpec& segment, HandSpec& spec) {
  const std::string parent = reader.name("parent");
  segment.parent = find_segment(spec.segments, parent);
  if (segment.parent) {
    spec.segments[*segment.parent].has_child = true;
  } else if (parent != "palm" && !parent.empty()) {
    std::vector<std::string> known = {"palm"};
    for (const SegmentSpec& row : spec.segments) known.push_back(row.name);
    reader.problem("parent", parent, "palm or a segment above this row" + nearest_hint(parent, known));
  }
}

/// Reads the joint of a segment; its name must be unique in the hand.
void read_segment_joint(MapReader reader, const HandSpec& spec, SegmentSpec& segment) {
  const RowJoint type = reader.choice<RowJoint>("type", kTypes);
  segment.joint = read_joint(reader, type);
  segment.fixed = type == RowJoint::fixed;
  const std::string& name = segment.joint.name;
  bool taken = name == spec.wrist.name || (spec.forearm && name == spec.forearm->joint.name);
  for (const SegmentSpec& other : spec.segments) taken = taken || other.joint.name == name;
  if (taken && !name.empty()) reader.problem("name", name + " a second time", "a unique name for each joint");
  reader.finish();
}

/// Any name; one that is not a finger's may say with which finger it counts.
void read_finger(MapReader& reader, SegmentSpec& segment) {
  segment.finger = reader.name("finger");
  for (const auto& [name, part] : kFingers)
    if (name == segment.finger) {
      segment.part = part;
      return;
    }
  const std::string name = lower_case(segment.finger);
  const auto within = std::ranges::find_if(
      kFingers, [&](const auto& finger) { return name.find(finger.first) != std::string::npos; });
  const bool like = within != kFingers.end();
  if (!like && !name.empty() && !reader.has("counts_as"))
    reader.warning("finger", segment.finger + " counts as the little finger: counts_as names another one");
  segment.part = reader.choice<Part>("counts_as", kFingers, like ? within->second : Part::little);
}

/// A length and a radius with more shapes, shapes of the palm, or both.
void read_matter(MapReader& reader, const HandSpec& spec, SegmentSpec& segment) {
  const bool on_part = segment.parent && !spec.segments[*segment.parent].of_palm.empty();
  if (reader.sound() && on_part && !segment.at)
    reader.problem("at", "nothing", "the joint's place in a parent that is a part of the palm");
  const bool sized = reader.has("length") || !reader.has("of_palm");
  if (sized) {
    segment.length = read_length(reader, "length");
    segment.radius = read_length(reader, "radius");
    segment.shapes = read_shapes(reader, "shapes", 0);
  }
  if (!reader.has("of_palm")) return;
  std::vector<std::string>& moved = sized ? segment.pads : segment.of_palm;
  moved = reader.texts("of_palm", 1, 20, "names of the palm's shapes");
  std::vector<std::string> open;
  for (const ShapeSpec& shape : spec.palm.matter.empty() ? spec.palm.shapes : spec.palm.matter)
    open.push_back(shape.name);
  for (const SegmentSpec& other : spec.segments)
    for (const auto* names : {&other.of_palm, &other.pads})
      for (const std::string& name : *names) std::erase(open, name);
  for (const std::string& name : moved) {
    if (reader.sound() && (std::ranges::find(open, name) == open.end() || open.size() == 1))
      reader.problem(
          "of_palm", name,
          "shapes of the palm, of its matter if it has one, that no row above has; one stays with the palm");
    std::erase(open, name);
  }
  if (reader.sound() && segment.parent && !sized)
    reader.problem("of_palm", "a row whose parent is not the palm", "parent: palm");
}

SegmentSpec read_segment(MapReader reader, HandSpec& spec, const std::optional<MassRule>& mass) {
  SegmentSpec segment;
  segment.place = reader.node().place();
  segment.name = reader.name("name");
  const bool taken =
      segment.name == "palm" || segment.name == "forearm" || find_segment(spec.segments, segment.name);
  if (taken && !segment.name.empty())
    reader.problem("name", segment.name + " a second time", "a unique name for each segment");
  read_finger(reader, segment);
  read_parent(reader, segment, spec);
  segment.at = read_place(reader, "at");
  if (reader.sound() && !segment.parent && !segment.at)
    reader.problem("at", "nothing", "the joint's place in the palm");
  segment.rotation = reader.rotation("rotation");
  read_matter(reader, spec, segment);
  if (!mass)
    reader.child("mass_share");
  else if (mass->kind == MassRule::Kind::body_mass_share)
    segment.mass_share = reader.number("mass_share", {Dimension::none, 0, 1, true});
  read_segment_joint(reader.required_map("joint", "a mapping with name, type and axes"), spec, segment);
  reader.finish();
  return segment;
}

/// Adds a row. A joint of three axes becomes a carrier on a universal joint and the segment on a hinge.
void add_row(SegmentSpec row, HandSpec& spec) {
  if (row.joint.axes.size() == 3) {
    SegmentSpec carrier = row;
    carrier.name += "_carrier";
    carrier.carrier = carrier.has_child = true;
    carrier.shapes.clear();
    carrier.mass_share *= kCarrierShare;
    carrier.joint.axes.pop_back();
    row.parent = spec.segments.size();
    row.at = PlaceRule{};
    row.rotation = Quat::Identity();
    row.mass_share *= 1 - kCarrierShare;
    row.joint.kind = JointKind::hinge;
    row.joint.axes.erase(row.joint.axes.begin(), row.joint.axes.begin() + 2);
    row.joint.name += "_" + row.joint.axes.front().name;
    spec.segments.push_back(std::move(carrier));
  }
  spec.segments.push_back(std::move(row));
}

void read_segments(MapReader& reader, HandSpec& spec, const std::optional<MassRule>& mass) {
  double shares = 0;
  reader.each("segments", 1, kMostSegments, [&](MapReader row) {
    SegmentSpec segment = read_segment(std::move(row), spec, mass);
    shares += segment.mass_share;
    add_row(std::move(segment), spec);
  });
  if (reader.sound() && shares >= 1 && !spec.palm.mass_share)
    reader.problem("segments", fmt::format("mass shares of {:g} in all", shares),
                   "less than 1, the palm has the rest");
}

void read_wrist(MapReader reader, HandSpec& spec) {
  spec.wrist.name = reader.name("name");
  read_axes(reader, spec.wrist);
  if (reader.sound()) check_axes(reader, spec.wrist, 1, 2, "one axis or two");
  spec.wrist.kind = spec.wrist.axes.size() == 1 ? JointKind::hinge : JointKind::universal;
  reader.finish();
}

ForearmSpec read_forearm(MapReader reader) {
  const Quantity share = {Dimension::none, 0, 0.1, true}, part = {Dimension::none, 0, 1, true};
  ForearmSpec out;
  out.place = reader.node().place();
  out.length = read_length(reader, "length");
  out.radius = read_length(reader, "radius");
  out.male = reader.number("male", share);
  out.female = reader.number("female", share);
  out.unknown = reader.number("unknown", share);
  out.centre = reader.number("centre", part);
  out.across = reader.number("across", part);
  out.along = reader.number("along", part);
  MapReader joint = reader.required_map("joint", "a mapping with name and axes");
  out.joint = read_joint(joint, RowJoint::hinge);
  joint.finish();
  reader.maybe_text("source");
  reader.finish();
  return out;
}

/// A tree that was read without a problem or warning.
struct Known {
  std::optional<YamlNode> given;  ///< absent where reading it has read files, which may change
  YamlNode read;                  ///< the same with defaults
  std::shared_ptr<const HandSpec> spec;
};

/// The last hand models that this process has read.
class KnownSpecs {
 public:
  std::vector<std::shared_ptr<const Known>> all() {
    const std::lock_guard lock(mutex_);
    return {known_.begin(), known_.end()};
  }
  void add(Known known) {
    constexpr std::size_t kMost = 8;
    const std::lock_guard lock(mutex_);
    known_.push_front(std::make_shared<const Known>(std::move(known)));
    if (known_.size() > kMost) known_.pop_back();
  }

 private:
  std::mutex mutex_;
  std::deque<std::shared_ptr<const Known>> known_;
};

KnownSpecs& known_specs() {
  static KnownSpecs specs;
  return specs;
}

}  // namespace

void check_axis_pair(MapReader& reader, const std::vector<model::JointAxis>& axes) {
  for (std::size_t j = 1; j < axes.size(); ++j)
    for (std::size_t i = 0; i < j; ++i) {
      const double cosine = axes[i].axis.dot(axes[j].axis);
      if (std::abs(cosine) > 1e-9)
        reader.problem("axes",
                       fmt::format("axes {:.9g} deg apart",
                                   kDegreesPerRadian * std::acos(std::clamp(cosine, -1.0, 1.0))),
                       "perpendicular axes");
      if (axes[i].name == axes[j].name)
        reader.problem("axes", fmt::format("two axes called {}", axes[i].name),
                       "a unique name for each axis");
    }
}

HandSpec read_hand_spec(const YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  MapReader reader(node, path, diagnostics);
  reader.take_base("based_on");
  HandSpec spec;
  spec.title = reader.text("title", "a hand");
  spec.sources = reader.named_texts("sources");
  if (const YamlNode* file = reader.file_or_block("anthropometry", "an anthropometry file"))
    spec.anthropometry = read_anthropometry(*file, reader.path_of("anthropometry"), diagnostics);
  const std::optional<MassRule> mass =
      read_mass(reader.required_map("mass", "a mapping with the rule of the hand's mass"));
  spec.mass = mass.value_or(MassRule{});
  spec.palm =
      read_palm(reader.required_map("palm", "a mapping with length, breadth and thickness, or shapes"), mass);
  read_wrist(reader.required_map("wrist", "a mapping with name and axes"), spec);
  if (reader.has("forearm")) spec.forearm = read_forearm(reader.map("forearm"));
  MapReader skin = reader.map("skin");
  spec.skin = model::read_material(skin, "skin");
  skin.finish();
  read_segments(reader, spec, mass);
  if (reader.has("spread"))
    spec.spread =
        read_spread(reader.map("spread"), {"segments", "hand_mass", "passive_tissue", "ranges", "measured"});
  if (const YamlNode* file = reader.file_or_block("muscles", "muscles of a hand", false))
    spec.muscles = read_muscle_file(*file, reader.path_of("muscles"), hand_axes(spec), diagnostics);
  if (auto changed = read_what_if(reader, spec)) spec = std::move(*changed);
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
      each.held = axis.initial;
    }
  };
  add(spec.wrist);
  if (spec.forearm) add(spec.forearm->joint);
  for (const SegmentSpec& segment : spec.segments) add(segment.joint);
  return out;
}

std::shared_ptr<const HandSpec> shared_hand_spec(const YamlNode& node, const std::string& path,
                                                 Diagnostics& diagnostics) {
  const auto read_it = [&] {
    return std::make_shared<const HandSpec>(read_hand_spec(node, path, diagnostics));
  };
  if (diagnostics.recorder) return read_it();
  for (const auto& known : known_specs().all())
    if (node.same_as(known->read) || (known->given && node.same_as(*known->given))) {
      diagnostics.resolution.replace(path, known->read);
      return known->spec;
    }
  Known fresh;
  fresh.given = node;
  const std::size_t problems = diagnostics.problems.size(), warnings = diagnostics.warnings.size();
  const std::size_t budget = diagnostics.budget.left, resolved = diagnostics.resolution.size();
  fresh.spec = read_it();
  if (diagnostics.problems.size() != problems || diagnostics.warnings.size() != warnings) return fresh.spec;
  if (diagnostics.budget.left != budget) fresh.given.reset();
  fresh.read = diagnostics.resolution.applied(node, path, resolved);
  // Hands of one scene that name the same file have one model.
  for (const auto& known : known_specs().all())
    if (fresh.read.same_as(known->read)) {
      fresh.read = known->read;
      fresh.spec = known->spec;
      break;
    }
  diagnostics.resolution.replace(path, fresh.read);
  auto spec = fresh.spec;
  known_specs().add(std::move(fresh));
  return spec;
}

}  // namespace handsim::hand
