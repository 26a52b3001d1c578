#include "handsim/hand/built_hand.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/hand/cut_capsule.h"
#include "handsim/hand/deviations.h"
#include "handsim/hand/pieces.h"
#include "handsim/model/mass_properties.h"
#include "handsim/model/shape_extent.h"
#include "handsim/model/shape_union.h"

namespace handsim::hand {

namespace {

using model::Body;
using model::Joint;
using model::MassProperties;
using model::Shape;
using model::ShapeKind;

/// Capsules and cylinders lie along z, segments along y.
const Quat kZToY(Eigen::AngleAxisd(-M_PI / 2, Vec3::UnitX()));

/// Measured bones and radii must be of segments of the hand model.
void check_measured(const HandSpec& spec, const Person& person, std::vector<Problem>& problems) {
  std::vector<std::string> known;
  for (const SegmentSpec& row : spec.segments)
    if (!row.carrier && row.of_palm.empty()) known.push_back(row.name);
  for (const auto& [key, measures] : {std::pair("bones.", &person.bones), {"radii.", &person.radii}})
    for (const auto& [name, length] : *measures)
      if (std::ranges::find(known, name) == known.end())
        problems.push_back({person.place.value_or(Place{}), key + name, "an unknown segment",
                            "a segment of the hand model" + nearest_hint(name, known)});
}

/// Length of the capsule's axis: a fingertip's cap ends at the tip, other caps are centred on the joints.
double axis_of(const SegmentSpec& row, const BuiltSegment& built) {
  return row.has_child ? built.length : built.length - built.radius;
}

/// Frames and sizes of the segments.
std::vector<BuiltSegment> lay_out(const HandSpec& spec, const HandSize& size, const Person& person) {
  std::vector<BuiltSegment> out;
  std::vector<Problem> problems;
  int rows = 0;  // of the file: a carrier has none
  for (const SegmentSpec& row : spec.segments) {
    const Pose parent_frame = row.parent ? out[*row.parent].frame : Pose{};
    const Vec3 at = row.at ? position(*row.at, size) : Vec3(0, out[*row.parent].length, 0);
    BuiltSegment& built = out.emplace_back();
    built.frame = parent_frame * Pose{at, row.rotation};
    if (row.carrier) continue;
    const std::string key = fmt::format("segments.{}.", rows++);
    if (!row.of_palm.empty()) continue;
    const auto length = person.bones.find(row.name), radius = person.radii.find(row.name);
    // A measured finger scales its segments, but not the thumb's metacarpal, which is within the palm.
    const auto finger = size.fingers.find(row.finger);
    const bool scaled = finger != size.fingers.end() && (row.parent || row.part != model::Part::thumb);
    built.length = length != person.bones.end()
                       ? length->second
                       : (scaled ? finger->second.scale : 1) * row.length.value(size);
    built.radius = radius != person.radii.end() ? radius->second : row.radius.value(size);
    const std::size_t before = problems.size();
    check_size(row.place, key + "radius", built.radius, problems);
    check_size(row.place, key + "length", built.length, problems);
    if (problems.size() == before && !(axis_of(row, built) >= 1e-5))
      problems.push_back(
          {row.place, "model." + key + "length",
           fmt::format("a length of {:.3g} m with a radius of {:.3g} m", built.length, built.radius),
           "a fingertip longer than its radius"});
  }
  check_measured(spec, person, problems);
  throw_if_any(std::move(problems));
  return out;
}

/// A box has its frame at its centre: that of its body.
Piece palm_part(const PalmSpec& spec, const HandSize& size) {
  Piece out;
  out.name = "palm";
  if (spec.shapes.empty()) {
    Shape box;
    box.name = "palm";
    box.kind = ShapeKind::box;
    box.edges = {spec.breadth.value(size), spec.length.value(size), spec.thickness.value(size)};
    std::vector<Problem> problems;
    const char* const keys[] = {"palm.breadth", "palm.length", "palm.thickness"};
    for (int i = 0; i < 3; ++i) check_size(spec.place, keys[i], box.edges[i], problems);
    throw_if_any(std::move(problems));
    out.frame.p = Vec3(0, 0.5 * box.edges.y(), 0) + position(spec.offset, size);
    out.shapes.push_back(std::move(box));
  }
  for (const ShapeSpec& row : spec.shapes) {
    out.shapes.push_back(shape_of(row, size));
    out.shapes.back().name = "palm." + row.name;
  }
  for (Shape& shape : out.shapes) shape.part = model::Part::palm;
  for (const ShapeSpec& row : spec.matter) {
    out.matter.push_back(shape_of(row, size));
    out.matter.back().name = "palm." + row.name;
  }
  return out;
}

Piece segment_part(const SegmentSpec& row, const BuiltSegment& built, const HandSize& size) {
  Piece out;
  out.name = row.name;
  out.body = built.body;
  out.frame = built.frame;
  out.round = row.carrier ? row.radius.value(size) : 0;
  for (const std::string& name : row.of_palm) out.of_palm.push_back("palm." + name);
  if (row.carrier || !row.of_palm.empty()) return out;
  Shape capsule;
  capsule.name = row.name;
  capsule.kind = ShapeKind::capsule;
  capsule.radius = built.radius;
  capsule.length = axis_of(row, built);
  capsule.pose = {{0, 0.5 * capsule.length, 0}, kZToY};
  out.shapes.push_back(std::move(capsule));
  for (const ShapeSpec& shape : row.shapes) {
    out.shapes.push_back(shape_of(shape, size));
    out.shapes.back().name = row.name + "." + shape.name;
  }
  for (Shape& shape : out.shapes) shape.part = row.part;
  return out;
}

/// A body of one shape has its frame at the shape's centre, with the axes of its segment.
void place_simple(Body& body, Shape& shape, const Piece& part) {
  body.mass = part.mass;
  body.zero_pose = part.frame * Pose{shape.pose.p, Quat::Identity()};
  shape.pose.p.setZero();
  if (shape.kind == ShapeKind::box) {
    body.inertia = (body.mass / 12 * model::box_moments(shape.edges)).asDiagonal();
    return;
  }
  if (part.cut) {
    const CapsuleMatter own = matter(shape, *part.cut);
    shape.pose.p.y() = 0.5 * shape.length - own.centre;
    body.zero_pose = part.frame * Pose{{0, own.centre, 0}, Quat::Identity()};
    body.inertia = (body.mass * Vec3(own.transverse, own.axial, own.transverse)).asDiagonal();
    return;
  }
  const model::CapsuleInertia solid = model::capsule_inertia(shape.radius, shape.length);
  body.inertia = (body.mass * Vec3(solid.transverse, solid.axial, solid.transverse)).asDiagonal();
}

/// Mass properties of a part in the hand frame.
MassProperties properties_of(const Piece& part) {
  MassProperties out;
  if (part.cut) {
    const CapsuleMatter own = matter(part.shapes[0], *part.cut);
    out.centre = {0, own.centre, 0};
    out.inertia = Vec3(own.transverse, own.axial, own.transverse).asDiagonal();
  } else if (part.shapes.empty()) {
    out.inertia = 0.4 * part.round * part.round * Mat3::Identity();
  } else {
    out = part.together ? *part.together : model::union_properties(part.shapes);
    out.inertia /= out.mass;
  }
  const Mat3 r = part.frame.q.toRotationMatrix();
  return {part.mass, part.frame * out.centre, part.mass * r * out.inertia * r.transpose()};
}

/// A body of several shapes, several rows or none: its frame is at its mass centre with its first row's axes.
void place_composite(Body& body, std::vector<Piece*>& parts) {
  std::vector<MassProperties> each;
  for (const Piece* part : parts) each.push_back(properties_of(*part));
  const MassProperties whole = model::joined(each);
  body.mass = whole.mass;
  body.zero_pose = {whole.centre, parts[0]->frame.q};
  const Mat3 r = body.zero_pose.q.conjugate().toRotationMatrix();
  body.inertia = r * whole.inertia * r.transpose();
  body.inertia = 0.5 * (body.inertia + body.inertia.transpose().eval());
  for (Piece* part : parts)
    for (Shape& shape : part->shapes) shape.pose = body.zero_pose.inverse() * (part->frame * shape.pose);
}

void place_bodies(BuiltHand& hand, std::vector<Piece>& parts) {
  for (std::size_t b = 0; b < hand.bodies.size(); ++b) {
    std::vector<Piece*> own;
    for (Piece& part : parts)
      if (part.body == static_cast<int>(b)) own.push_back(&part);
    hand.bodies[b].name = own[0]->name;
    const bool capsule_or_box = own.size() == 1 && own[0]->shapes.size() == 1 && !own[0]->together &&
                                (b > 0 || own[0]->shapes[0].kind == ShapeKind::box);
    if (capsule_or_box)
      place_simple(hand.bodies[b], own[0]->shapes[0], *own[0]);
    else
      place_composite(hand.bodies[b], own);
  }
}

void add_shapes_of(BuiltHand& hand, const std::vector<Piece>& parts) {
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (i > 0 && !parts[i].shapes.empty() && parts[i].of_palm.empty())
      hand.segments[i - 1].capsule = hand.shapes.size();
    for (Shape shape : parts[i].shapes) {
      shape.body = parts[i].body;
      hand.shapes.push_back(std::move(shape));
    }
  }
}

/// The joint frame in a body: of a simple body exactly on the axis of its capsule.
Pose joint_in_body(const BuiltHand& hand, const HandSpec& spec, std::size_t i) {
  const BuiltSegment& built = hand.segments[i];
  const Body& body = hand.bodies[as_index(built.body)];
  const Vec3 half(0, 0.5 * axis_of(spec.segments[i], built), 0);
  const bool simple = !spec.segments[i].carrier && (built.frame * half - body.zero_pose.p).isZero(0);
  return simple ? Pose{-half, Quat::Identity()} : body.zero_pose.inverse() * built.frame;
}

void add_joints_of(BuiltHand& hand, const HandSpec& spec) {
  for (std::size_t i = 0; i < spec.segments.size(); ++i) {
    const SegmentSpec& row = spec.segments[i];
    if (row.fixed) continue;
    const BuiltSegment& built = hand.segments[i];
    Joint joint;
    joint.name = row.joint.name;
    joint.kind = row.joint.kind;
    joint.axes = row.joint.axes;
    joint.parent = row.parent ? hand.segments[*row.parent].body : 0;
    joint.child = built.body;
    joint.parent_frame = hand.bodies[as_index(joint.parent)].zero_pose.inverse() * built.frame;
    joint.child_frame = joint_in_body(hand, spec, i);
    hand.segments[i].joint = static_cast<int>(hand.joints.size());
    hand.joints.push_back(std::move(joint));
  }
}

/// The distal ends of the last segments, named after their joints: `index_tip` beyond `index_dip`.
void add_fingertips(BuiltHand& hand, const HandSpec& spec) {
  for (std::size_t i = 0; i < spec.segments.size(); ++i) {
    const SegmentSpec& row = spec.segments[i];
    const BuiltSegment& built = hand.segments[i];
    if (row.has_child || !row.of_palm.empty()) continue;
    std::string name = row.finger;
    for (const Joint& joint : hand.joints)
      if (joint.child == built.body) name = joint.name.substr(0, joint.name.rfind('_'));
    hand.fingertips.push_back(
        {name + "_tip", row.part, built.body, joint_in_body(hand, spec, i) * Vec3(0, built.length, 0)});
  }
}

/// Palm and segments with their bodies; a fixed segment belongs to the body of its parent.
std::vector<Piece> parts_of(BuiltHand& hand, const HandSpec& spec, const Person& person) {
  hand.segments = lay_out(spec, hand.size, person);
  std::vector<Piece> parts = {palm_part(spec.palm, hand.size)};
  hand.bodies.resize(1);
  for (std::size_t i = 0; i < spec.segments.size(); ++i) {
    const SegmentSpec& row = spec.segments[i];
    BuiltSegment& built = hand.segments[i];
    if (!row.fixed) {
      built.body = static_cast<int>(hand.bodies.size());
      hand.bodies.emplace_back();
    } else if (row.parent) {
      built.body = hand.segments[*row.parent].body;
    }
    parts.push_back(segment_part(row, built, hand.size));
    parts.back().row = i;
  }
  for (std::size_t i = 0; i < spec.segments.size(); ++i) {
    if (spec.segments[i].pads.empty()) continue;
    Piece pad;
    pad.name = parts[i + 1].name;
    pad.body = parts[i + 1].body;
    pad.frame = parts[i + 1].frame;
    pad.row = i;
    for (const std::string& name : spec.segments[i].pads) pad.of_palm.push_back("palm." + name);
    parts.push_back(std::move(pad));
  }
  for (Piece& part : parts)
    if (part.shapes.size() > 1 || !part.matter.empty())
      part.together = model::union_properties(part.solids());
  return parts;
}

}  // namespace

BuiltHand build_hand(const HandSpec& given, const Person& stated) {
  const bool deviates = !stated.deviations.empty();
  const std::optional<HandSpec> own = deviates ? std::optional(deviated(given, stated)) : std::nullopt;
  const HandSpec& spec = own ? *own : given;
  const Person person = deviates ? measured_again(given, stated) : stated;
  BuiltHand hand;
  hand.size = hand_size(spec.anthropometry, person);
  hand.skin = spec.skin;
  std::vector<Piece> parts = parts_of(hand, spec, person);
  set_masses(parts, hand, spec, person);
  place_bodies(hand, parts);
  add_shapes_of(hand, parts);
  add_joints_of(hand, spec);
  add_fingertips(hand, spec);
  hand.wrist.name = spec.wrist.name;
  hand.wrist.kind = spec.wrist.kind;
  hand.wrist.axes = spec.wrist.axes;
  hand.wrist.child_frame = hand.bodies[0].zero_pose.inverse();
  if (spec.forearm) hand.forearm = forearm_of(*spec.forearm, hand.size, person);
  hand.axes = hand_axes(spec);
  if (spec.muscles) hand.muscles = build_muscles(*spec.muscles, hand.axes, hand.size, person);
  return hand;
}

Vec3 palm_box(const BuiltHand& hand) {
  std::vector<Shape> palm;
  for (const Shape& shape : hand.shapes)
    if (shape.body == 0 && shape.part == model::Part::palm) palm.push_back(shape);
  return model::box_edges(palm);
}

WholeHand whole_hand(const BuiltHand& hand) {
  std::vector<model::MassProperties> parts;
  for (const Body& body : hand.bodies) {
    const Mat3 r = body.zero_pose.q.toRotationMatrix();
    parts.push_back({body.mass, body.zero_pose.p, r * body.inertia * r.transpose()});
  }
  const model::MassProperties whole = model::joined(parts);
  const auto gyration = [&](int axis) {
    return std::sqrt(whole.inertia(axis, axis) / whole.mass) / hand.size.length;
  };
  return {whole.centre, {whole.centre.y() / hand.size.length, gyration(2), gyration(0), gyration(1)}};
}

BuiltHand::Forearm forearm_of(const ForearmSpec& spec, const HandSize& size, const Person& person) {
  BuiltHand::Forearm out;
  std::vector<Problem> problems;
  check_size(spec.place, "forearm.length", spec.length.value(size), problems);
  check_size(spec.place, "forearm.radius", spec.radius.value(size), problems);
  throw_if_any(std::move(problems));
  const double length = spec.length.value(size), distal = (1 - spec.centre) * length;
  out.body.name = "forearm";
  out.body.mass = share_of(spec, person.sex) * person.mass;
  out.body.zero_pose.p = {0, -distal, 0};
  const double across = std::pow(spec.across * length, 2), along = std::pow(spec.along * length, 2);
  out.body.inertia = (out.body.mass * Vec3(across, along, across)).asDiagonal();
  out.shape.name = "forearm";
  out.shape.kind = model::ShapeKind::capsule;
  out.shape.part = model::Part::palm;
  out.shape.radius = spec.radius.value(size);
  out.shape.length = std::max(length - 2 * out.shape.radius, 1e-3 * length);
  out.shape.pose = {{0, distal - 0.5 * length, 0}, Quat(Eigen::AngleAxisd(-M_PI / 2, Vec3::UnitX()))};
  out.joint.name = spec.joint.name;
  out.joint.axes = spec.joint.axes;
  out.joint.parent_frame.p = {0, -length, 0};
  out.joint.child_frame.p = {0, distal - length, 0};
  return out;
}

}  // namespace handsim::hand
