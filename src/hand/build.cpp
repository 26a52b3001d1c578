#include "handsim/hand/build.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/model/kinematics.h"
#include "handsim/model/mass_properties.h"

namespace handsim::hand {

namespace {

using model::Body;
using model::Joint;
using model::Shape;
using model::ShapeKind;

/// Capsules and cylinders lie along z, segments along y.
const Quat kZToY(Eigen::AngleAxisd(-M_PI / 2, Vec3::UnitX()));

Vec3 position(const std::array<LengthRule, 3>& rules, const HandSize& size) {
  return {rules[0].value(size), rules[1].value(size), rules[2].value(size)};
}

/// Frames of every segment in the hand frame and their lengths.
struct Layout {
  std::vector<Pose> frames;  ///< X_HS, origin at the proximal joint
  std::vector<double> lengths, radii;
  /// Length of the capsule's axis: a fingertip's cap ends at the tip, other caps are centred on the joints.
  double axis(const HandSpec& spec, std::size_t i) const {
    return spec.segments[i].has_child ? lengths[i] : lengths[i] - radii[i];
  }
};

/// Measured bones must be segments of the hand model.
void check_bones(const HandSpec& spec, const Person& person, std::vector<Problem>& problems) {
  std::vector<std::string> known;
  for (const SegmentSpec& row : spec.segments) known.push_back(row.name);
  for (const auto& [name, length] : person.bones)
    if (std::find(known.begin(), known.end(), name) == known.end())
      problems.push_back({person.place.value_or(Place{}), "bones." + name, "an unknown segment",
                          "a segment of the hand model" + nearest_hint(name, known)});
}

Layout compute_layout(const HandSpec& spec, const HandSize& size, const Person& person) {
  Layout out;
  std::vector<Problem> problems;
  for (const SegmentSpec& row : spec.segments) {
    const bool on_palm = row.parent == kPalm;
    const auto parent = static_cast<std::size_t>(row.parent);
    const Pose parent_frame = on_palm ? Pose{} : out.frames[parent];
    const Vec3 at = row.at ? position(*row.at, size) : Vec3(0, out.lengths[parent], 0);
    out.frames.push_back(parent_frame * Pose{at, row.rotation});
    const auto measured = person.bones.find(row.name);
    out.lengths.push_back(measured == person.bones.end() ? row.length.value(size) : measured->second);
    out.radii.push_back(row.radius.value(size));
    if (out.axis(spec, out.frames.size() - 1) < 1e-5)
      problems.push_back({row.place, fmt::format("model.segments.{}.length", out.frames.size() - 1),
                          fmt::format("a length of {:.3g} m with a radius of {:.3g} m", out.lengths.back(),
                                      out.radii.back()),
                          "a fingertip longer than its radius"});
  }
  check_bones(spec, person, problems);
  if (!problems.empty()) throw Error(problems);
  return out;
}

Shape capsule(std::string name, model::Part part, double radius, double axis) {
  Shape shape;
  shape.name = std::move(name);
  shape.kind = ShapeKind::capsule;
  shape.pose.q = kZToY;
  shape.radius = radius;
  shape.length = axis;
  shape.part = part;
  return shape;
}

void add_palm(BuiltHand& hand, const HandSpec& spec) {
  const HandSize& size = hand.size;
  Shape box;
  box.name = "palm";
  box.kind = ShapeKind::box;
  box.edges = {spec.palm.breadth.value(size), spec.palm.length.value(size), spec.palm.thickness.value(size)};
  box.part = model::Part::palm;
  Body palm;
  palm.name = "palm";
  palm.zero_pose.p = Vec3(0, 0.5 * box.edges.y(), 0) + position(spec.palm.offset, size);
  hand.shapes.push_back(box);
  hand.bodies.push_back(palm);
}

void add_segments(BuiltHand& hand, const HandSpec& spec, const Person& person) {
  const Layout layout = compute_layout(spec, hand.size, person);
  for (std::size_t i = 0; i < spec.segments.size(); ++i) {
    const SegmentSpec& row = spec.segments[i];
    const double axis = layout.axis(spec, i);
    Body body;
    body.name = row.name;
    body.zero_pose = layout.frames[i] * Pose{{0, 0.5 * axis, 0}, Quat::Identity()};
    Joint joint;
    joint.name = row.joint.name;
    joint.kind = row.joint.kind;
    joint.axes = row.joint.axes;
    joint.parent = row.parent + 1;
    joint.child = static_cast<int>(hand.bodies.size());
    joint.parent_frame =
        hand.bodies[static_cast<std::size_t>(joint.parent)].zero_pose.inverse() * layout.frames[i];
    joint.child_frame.p = {0, -0.5 * axis, 0};
    hand.bodies.push_back(body);
    hand.joints.push_back(joint);
    hand.shapes.push_back(capsule(row.name, row.finger, layout.radii[i], axis));
  }
}

double share_of(const MassRule& rule, Sex sex) {
  return sex == Sex::male ? rule.male : sex == Sex::female ? rule.female : rule.unknown;
}

/// Masses by share of the hand; the palm gets the remainder, so that the parts sum to the hand.
void set_masses_by_share(BuiltHand& hand, const HandSpec& spec, const Person& person) {
  hand.mass = person.hand_mass.value_or(share_of(spec.mass, person.sex) * person.mass);
  double rest = hand.mass;
  for (std::size_t i = 0; i < spec.segments.size(); ++i) {
    hand.bodies[i + 1].mass = spec.segments[i].mass_share * hand.mass;
    rest -= hand.bodies[i + 1].mass;
  }
  hand.bodies[0].mass = rest;
}

/// Masses by volume; a measured hand mass scales them.
void set_masses_by_volume(BuiltHand& hand, const HandSpec& spec, const Person& person) {
  double total = 0;
  for (const Shape& shape : hand.shapes) total += model::volume(shape);
  hand.mass = person.hand_mass.value_or(spec.mass.density * total);
  for (std::size_t i = 0; i < hand.bodies.size(); ++i)
    hand.bodies[i].mass = hand.mass * model::volume(hand.shapes[i]) / total;
}

void set_inertias(BuiltHand& hand) {
  for (std::size_t i = 0; i < hand.bodies.size(); ++i) {
    Body& body = hand.bodies[i];
    const Shape& shape = hand.shapes[i];
    if (shape.kind == ShapeKind::box) {
      body.inertia = (body.mass / 12 * model::box_moments(shape.edges)).asDiagonal();
    } else {
      const model::CapsuleInertia solid = model::capsule_inertia(shape.radius, shape.length);
      body.inertia = (body.mass * Vec3(solid.transverse, solid.axial, solid.transverse)).asDiagonal();
    }
  }
}

/// The right hand unchanged, or mirrored to a left one.
BuiltHand for_side(BuiltHand hand, model::Side side) {
  if (side == model::Side::right) return hand;
  for (Body& body : hand.bodies) body.zero_pose = mirrored(body.zero_pose);
  for (Shape& shape : hand.shapes) shape.pose = mirrored(shape.pose);
  hand.joints.push_back(hand.wrist);
  for (Joint& joint : hand.joints) {
    joint.parent_frame = mirrored(joint.parent_frame);
    joint.child_frame = mirrored(joint.child_frame);
    for (model::JointAxis& axis : joint.axes) axis.axis = mirrored_axis(axis.axis);
  }
  hand.wrist = hand.joints.back();
  hand.joints.pop_back();
  return hand;
}

/// The slider joint of a palm on a rail.
Joint rail_joint(const BuiltHand& hand, const Placement& placement) {
  Joint joint;
  joint.name = kRailName;
  joint.kind = model::JointKind::slider;
  joint.parent_frame = placement.pose;
  joint.child_frame = hand.wrist.child_frame;
  model::JointAxis axis;
  axis.name = "travel";
  axis.axis = placement.pose.q.conjugate() * placement.rail_direction;
  joint.axes.push_back(axis);
  return joint;
}

/// The joint between world and palm, if the mount has one.
std::optional<Joint> mount_joint(const BuiltHand& hand, const Placement& placement) {
  if (placement.mount == Mount::rail) return rail_joint(hand, placement);
  if (placement.mount != Mount::hinge && placement.mount != Mount::universal) return std::nullopt;
  Joint joint = hand.wrist;
  joint.kind = placement.mount == Mount::hinge ? model::JointKind::hinge : model::JointKind::universal;
  const auto count = static_cast<std::size_t>(model::dof_count(joint.kind));
  if (joint.axes.size() < count)
    throw input_error("wrist.mount", "universal with a hand model whose wrist has one axis",
                      "hinge, or a hand model whose wrist has two axes");
  joint.axes.resize(count);
  joint.parent_frame = placement.pose;
  return joint;
}

void apply_start(Joint& joint, const Placement& placement) {
  const auto found = placement.start.find(joint.name);
  if (found == placement.start.end()) return;
  if (found->second.size() > joint.axes.size())
    throw input_error("pose." + joint.name, fmt::format("{} angles", found->second.size()),
                      fmt::format("at most {}", joint.axes.size()));
  for (std::size_t i = 0; i < found->second.size(); ++i) joint.axes[i].initial = found->second[i];
}

void scale_tissue(Joint& joint, const Placement& placement) {
  for (model::JointAxis& axis : joint.axes) {
    if (!axis.tissue) continue;
    axis.tissue->stiffness *= placement.tissue_stiffness;
    axis.tissue->damping *= placement.tissue_damping;
    if (axis.tissue->stiffness == 0 && axis.tissue->damping == 0) axis.tissue.reset();
  }
}

void check_start_names(const std::vector<Joint>& joints, const Placement& placement) {
  std::vector<std::string> known;
  for (const Joint& joint : joints) known.push_back(joint.name);
  for (const auto& [name, angles] : placement.start) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    throw input_error("pose." + name, "an unknown joint",
                      "a joint of the hand model or its wrist mount" + nearest_hint(name, known));
  }
}

/// Adds the hand's skin as material, its contact groups and its shapes.
HandGroups add_shapes(model::Model& model, const model::HandIndex& index, const BuiltHand& hand) {
  const HandGroups groups = {model.add_group("palm-" + index.name), model.add_group("fingers-" + index.name),
                             model.add_group("fingertips-" + index.name)};
  std::vector<bool> has_child(hand.bodies.size(), false);
  for (const Joint& joint : hand.joints) has_child[static_cast<std::size_t>(joint.parent)] = true;
  model.materials.push_back(hand.skin);
  for (std::size_t i = 0; i < hand.shapes.size(); ++i) {
    Shape shape = hand.shapes[i];
    shape.name = index.name + "." + shape.name;
    shape.body = index.bodies[i];
    shape.group = i == 0 ? groups.palm : has_child[i] ? groups.fingers : groups.fingertips;
    shape.material = static_cast<int>(model.materials.size()) - 1;
    model.shapes.push_back(std::move(shape));
  }
  return groups;
}

/// Adds the mount's joint, if it has one, then those of the segments.
void add_joints(model::Model& model, model::HandIndex& index, const BuiltHand& hand,
                const Placement& placement) {
  std::vector<Joint> joints = hand.joints;
  for (Joint& joint : joints) {
    joint.parent += index.palm;
    joint.child += index.palm;
  }
  if (std::optional<Joint> wrist = mount_joint(hand, placement)) {
    wrist->parent = model::kWorld;
    wrist->child = index.palm;
    joints.insert(joints.begin(), std::move(*wrist));
  }
  check_start_names(joints, placement);
  for (Joint& joint : joints) {
    apply_start(joint, placement);
    scale_tissue(joint, placement);
    joint.name = index.name + "." + joint.name;
    joint.first_dof = model.dof_count();
    if (placement.mount == Mount::rail && &joint == &joints.front())
      index.rail = static_cast<int>(model.joints.size());
    else
      index.joints.push_back(static_cast<int>(model.joints.size()));
    model.joints.push_back(std::move(joint));
  }
}

void set_palm(model::Model& model, int palm, const BuiltHand& hand, const Placement& placement) {
  Body& body = model.bodies[static_cast<std::size_t>(palm)];
  body.kinematic = placement.mount == Mount::fixed || placement.mount == Mount::driven;
  if (placement.mount == Mount::driven)
    model.drives.push_back({palm, hand.bodies[0].zero_pose.inverse(), placement.motion});
}

/// A free hand starts with the velocities of one rigid body.
void set_velocities(model::Model& model, const model::HandIndex& index, const Placement& placement) {
  if (placement.mount != Mount::free) return;
  const model::State start = model::initial_state(model);
  for (const int body : index.bodies) {
    const auto i = static_cast<std::size_t>(body);
    model.bodies[i].initial_angular_velocity = placement.angular_velocity;
    model.bodies[i].initial_velocity =
        placement.velocity + placement.angular_velocity.cross(start.bodies[i].p - placement.pose.p);
  }
}

}  // namespace

BuiltHand build_hand(const HandSpec& spec, const Person& person) {
  BuiltHand hand;
  hand.size = hand_size(spec.anthropometry, person);
  hand.skin = spec.skin;
  add_palm(hand, spec);
  add_segments(hand, spec, person);
  switch (spec.mass.kind) {
    case MassRule::Kind::body_mass_share:
      set_masses_by_share(hand, spec, person);
      break;
    case MassRule::Kind::density:
      set_masses_by_volume(hand, spec, person);
      break;
  }
  set_inertias(hand);
  hand.wrist.name = spec.wrist.name;
  hand.wrist.kind = spec.wrist.kind;
  hand.wrist.axes = spec.wrist.axes;
  hand.wrist.child_frame = hand.bodies[0].zero_pose.inverse();
  return hand;
}

HandGroups add_hand(model::Model& model, const BuiltHand& right, const Placement& placement) {
  const BuiltHand hand = for_side(right, placement.side);
  model::HandIndex index;
  index.name = placement.name;
  index.side = placement.side;
  index.palm = static_cast<int>(model.bodies.size());
  index.wrist_frame = hand.bodies[0].zero_pose.inverse();
  for (Body body : hand.bodies) {
    body.name = placement.name + "." + body.name;
    body.zero_pose = placement.pose * body.zero_pose;
    index.bodies.push_back(static_cast<int>(model.bodies.size()));
    model.bodies.push_back(std::move(body));
  }
  const HandGroups groups = add_shapes(model, index, hand);
  add_joints(model, index, hand, placement);
  set_palm(model, index.palm, hand, placement);
  set_velocities(model, index, placement);
  model.hands.push_back(std::move(index));
  return groups;
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

}  // namespace handsim::hand
