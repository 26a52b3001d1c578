#include "handsim/hand/build.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/model/kinematics.h"

namespace handsim::hand {

namespace {

using model::Body;
using model::Joint;
using model::Shape;

/// The left hand of a right one.
BuiltHand left_of(BuiltHand hand) {
  for (Body& body : hand.bodies) {
    body.zero_pose = mirrored(body.zero_pose);
    for (const int k : {1, 2}) {
      body.inertia(0, k) = -body.inertia(0, k);
      body.inertia(k, 0) = -body.inertia(k, 0);
    }
  }
  for (Shape& shape : hand.shapes) shape.pose = mirrored(shape.pose);
  for (model::Fingertip& tip : hand.fingertips) tip.point = mirrored(tip.point);
  // The forearm is its own mirror image, but for the way that it turns.
  if (hand.forearm)
    for (model::JointAxis& axis : hand.forearm->joint.axes) axis.axis = mirrored_axis(axis.axis);
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

/// Whether the hand hangs on a forearm.
bool on_forearm(const BuiltHand& hand, const Placement& placement) {
  return hand.forearm && (placement.mount == Mount::hinge || placement.mount == Mount::universal);
}

/// Adds the forearm's body before those of the hand.
void add_forearm_body(model::Model& model, const BuiltHand& hand, const Placement& placement) {
  Body body = hand.forearm->body;
  body.name = placement.name + "." + body.name;
  body.zero_pose = placement.pose * body.zero_pose;
  model.bodies.push_back(std::move(body));
}

void apply_start(Joint& joint, const Placement& placement) {
  const auto found = placement.start.find(joint.name);
  if (found == placement.start.end()) return;
  if (found->second.size() > joint.axes.size())
    throw input_error("pose." + joint.name, fmt::format("{} angles", found->second.size()),
                      fmt::format("at most {}", joint.axes.size()));
  for (std::size_t i = 0; i < found->second.size(); ++i) {
    const auto& stop = joint.axes[i].stop;
    const double angle = found->second[i];
    joint.axes[i].initial = stop && stop->stiff ? std::clamp(angle, stop->low, stop->high) : angle;
  }
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
    if (std::ranges::find(known, name) != known.end()) continue;
    throw input_error("pose." + name, "an unknown joint",
                      "a joint of the hand model or its wrist mount" + nearest_hint(name, known));
  }
}

/// Adds the hand's skin as material, its contact groups and its shapes.
HandGroups add_shapes(model::Model& model, const model::HandIndex& index, const BuiltHand& hand) {
  const HandGroups groups = {model.add_group("palm-" + index.name), model.add_group("fingers-" + index.name),
                             model.add_group("fingertips-" + index.name)};
  std::vector<bool> has_child(hand.bodies.size(), false);
  for (const Joint& joint : hand.joints) has_child[as_index(joint.parent)] = true;
  model.materials.push_back(hand.skin);
  for (Shape shape : hand.shapes) {
    const auto body = as_index(shape.body);
    shape.name = index.name + "." + shape.name;
    const bool palm = shape.part == model::Part::palm || body == 0 ||
                      std::ranges::find(hand.palm_parts, shape.body) != hand.palm_parts.end();
    shape.group = palm ? groups.palm : has_child[body] ? groups.fingers : groups.fingertips;
    shape.body = index.bodies[body];
    shape.material = static_cast<int>(model.materials.size()) - 1;
    model.shapes.push_back(std::move(shape));
  }
  if (index.forearm) {
    Shape shape = hand.forearm->shape;
    shape.name = index.name + "." + shape.name;
    shape.group = groups.palm;
    shape.body = *index.forearm;
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
    if (on_forearm(hand, placement)) {
      Joint elbow = hand.forearm->joint;
      elbow.parent = model::kWorld;
      elbow.child = wrist->parent = *index.forearm;
      elbow.parent_frame = placement.pose * elbow.parent_frame;
      wrist->parent_frame = hand.forearm->body.zero_pose.inverse();
      joints.insert(joints.begin(), std::move(*wrist));
      joints.insert(joints.begin(), std::move(elbow));
    } else {
      joints.insert(joints.begin(), std::move(*wrist));
    }
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

/// A path by the model's coordinates; axes that the mount omits are held. @return the excursion of these [m]
double place(model::TendonPath& path, const std::vector<HandAxis>& axes,
             const std::vector<std::optional<int>>& dofs) {
  double held = 0;
  for (std::size_t i = 0; i < dofs.size(); ++i)
    if (!dofs[i]) held += model::hold(path, static_cast<int>(i), axes[i].held);
  for (model::MomentArm& arm : path.arms) arm.dof = *dofs[as_index(arm.dof)];
  return held;
}

/// Adds muscles and bands; the joints are in the model.
void add_muscles(model::Model& model, model::HandIndex& index, const BuiltHand& hand,
                 const Placement& placement) {
  if (hand.muscles.muscles.empty() && hand.muscles.bands.empty()) return;
  std::map<std::string, int> dof_of;
  for (const int joint : index.joints) {
    const Joint& each = model.joints[as_index(joint)];
    for (std::size_t a = 0; a < each.axes.size(); ++a)
      dof_of[each.name + "." + each.axes[a].name] = each.first_dof + static_cast<int>(a);
  }
  std::vector<std::optional<int>> dofs;
  for (const HandAxis& axis : hand.axes) {
    const auto found = dof_of.find(index.name + "." + axis.name);
    dofs.push_back(found == dof_of.end() ? std::nullopt : std::optional(found->second));
  }
  const auto before = static_cast<int>(model.muscles.size());
  for (model::Muscle muscle : hand.muscles.muscles) {
    for (model::Spill& each : muscle.spills) each.from += before;
    muscle.name = index.name + "." + muscle.name;
    muscle.length -= place(muscle.path, hand.axes, dofs);
    if (muscle.slack_length > 0) muscle.tendon_strain = placement.tendon_strain;
    muscle.short_range = placement.short_range;
    index.muscles.push_back(static_cast<int>(model.muscles.size()));
    model.muscles.push_back(std::move(muscle));
  }
  for (model::Band band : hand.muscles.bands) {
    band.name = index.name + "." + band.name;
    band.rest += place(band.path, hand.axes, dofs);
    index.bands.push_back(static_cast<int>(model.bands.size()));
    model.bands.push_back(std::move(band));
  }
}

void set_palm(model::Model& model, int palm, const BuiltHand& hand, const Placement& placement) {
  Body& body = model.bodies[as_index(palm)];
  body.kinematic = placement.mount == Mount::fixed || placement.mount == Mount::driven;
  if (placement.mount == Mount::driven)
    model.drives.push_back({palm, hand.bodies[0].zero_pose.inverse(), placement.motion});
}

/// A free hand starts with the velocities of one rigid body.
void set_velocities(model::Model& model, const model::HandIndex& index, const Placement& placement) {
  if (placement.mount != Mount::free) return;
  const model::State start = model::initial_state(model);
  for (const int body : index.bodies) {
    const auto i = as_index(body);
    model.bodies[i].initial_angular_velocity = placement.angular_velocity;
    model.bodies[i].initial_velocity =
        placement.velocity + placement.angular_velocity.cross(start.bodies[i].p - placement.pose.p);
  }
}

}  // namespace

HandGroups add_hand(model::Model& model, const BuiltHand& right, const Placement& placement) {
  std::optional<BuiltHand> left;
  if (placement.side == model::Side::left) left = left_of(right);
  const BuiltHand& hand = left ? *left : right;
  model::HandIndex index;
  index.name = placement.name;
  index.side = placement.side;
  if (on_forearm(hand, placement)) {
    index.forearm = static_cast<int>(model.bodies.size());
    add_forearm_body(model, hand, placement);
  }
  index.palm = static_cast<int>(model.bodies.size());
  for (const int part : hand.palm_parts) index.palm_parts.push_back(index.palm + part);
  for (model::Fingertip tip : hand.fingertips) {
    tip.name = index.name + "." + tip.name;
    tip.body += index.palm;
    index.fingertips.push_back(std::move(tip));
  }
  index.wrist_frame = hand.bodies[0].zero_pose.inverse();
  for (Body body : hand.bodies) {
    body.name = placement.name + "." + body.name;
    body.zero_pose = placement.pose * body.zero_pose;
    index.bodies.push_back(static_cast<int>(model.bodies.size()));
    model.bodies.push_back(std::move(body));
  }
  const HandGroups groups = add_shapes(model, index, hand);
  add_joints(model, index, hand, placement);
  add_muscles(model, index, hand, placement);
  set_palm(model, index.palm, hand, placement);
  set_velocities(model, index, placement);
  model.hands.push_back(std::move(index));
  return groups;
}

}  // namespace handsim::hand
