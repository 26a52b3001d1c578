#include "handsim/scene/read/mechanism.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/hand/hand_file.h"
#include "handsim/scene/read/blocks.h"
#include "handsim/scene/read/objects.h"

namespace handsim::scene {

namespace {

using model::JointKind;

constexpr std::size_t kMostBodies = 1000;

/// `rotation`, or the shortest rotation of the body's z axis to `z_axis`.
Quat read_orientation(MapReader& reader) {
  Quat rotation = reader.rotation("rotation");
  if (!reader.has("z_axis")) return rotation;
  if (reader.has("rotation")) reader.problem("z_axis", "a z_axis beside a rotation", "one of the two");
  return rotation_between(Vec3::UnitZ(), reader.direction("z_axis"));
}

model::Shape read_shape(MapReader reader) {
  model::Shape shape;
  shape.part = model::Part::mechanism;
  if (!read_solid(reader, "kind", shape)) return shape;
  const Pose at{reader.vector("position", kCoordinate, Vec3::Zero()), reader.rotation("rotation")};
  shape.pose = at * shape.pose;
  reader.finish();
  return shape;
}

BodySpec read_body(MapReader reader, const std::vector<model::Material>& materials) {
  BodySpec body;
  body.place = reader.node().place();
  body.name = reader.name("name");
  body.mass = reader.number("mass", {Dimension::mass, 1e-6, 1e4});
  body.inertia = reader.vector("inertia", {Dimension::none, 1e-12, 1e6});
  body.pose.p = reader.vector("position", kCoordinate);
  body.pose.q = read_orientation(reader);
  body.velocity = reader.vector("velocity", kVelocity, Vec3::Zero());
  body.angular_velocity = reader.vector("angular_velocity", kAngularVelocity, Vec3::Zero());
  if (reader.has("shape")) body.shape = read_shape(reader.map("shape"));
  body.collides = reader.flag("collides", false);
  body.material = read_surface(reader, body.name, materials);
  if (body.collides && !body.shape) reader.problem("collides", "true without a shape", "a shape");
  reader.finish();
  return body;
}

model::JointAxis read_axis(MapReader reader, bool slides) {
  model::JointAxis axis;
  axis.name = reader.name("name");
  axis.axis = reader.direction("axis");
  const Quantity range = slides ? kCoordinate : Quantity{Dimension::angle, -M_PI, M_PI};
  if (const auto stop = reader.maybe_range("range", range)) {
    axis.stop = model::Stop{stop->first, stop->second, 0};
    axis.stop->restitution = reader.number("bounce", {Dimension::none, 0, 1}, 0.0);
  }
  axis.torque = reader.number("torque", {Dimension::torque, -1e4, 1e4}, 0.0);
  reader.finish();
  return axis;
}

void check_axes(MapReader& reader, const MechanismJointSpec& joint) {
  const std::size_t needed = model::type_of(joint.kind).axes();
  if (joint.axes.size() != needed)
    return reader.problem("axes", fmt::format("a list of {}", joint.axes.size()),
                          fmt::format("a list of {} for this type of joint", needed));
  if (model::type_of(joint.kind).perpendicular()) hand::check_axis_pair(reader, joint.axes);
}

MechanismJointSpec read_joint(MapReader reader) {
  MechanismJointSpec joint;
  joint.place = reader.node().place();
  joint.name = reader.name("name");
  std::vector<std::pair<std::string_view, JointKind>> types;
  for (std::size_t i = 0; i < std::size(model::kJointTypes); ++i)
    types.emplace_back(model::kJointTypes[i].name, static_cast<JointKind>(i));
  joint.kind = reader.choice("type", types);
  const bool kind_known = reader.sound();
  joint.parent = reader.text("parent", "world");
  joint.child = reader.name("child");
  joint.position = reader.vector("position", kCoordinate);
  const model::JointType& type = model::type_of(joint.kind);
  reader.each("axes", kind_known && type.axes() > 0 ? 1 : 0, 2, [&](MapReader axis) {
    joint.axes.push_back(read_axis(std::move(axis), joint.axes.size() < as_index(type.slides)));
  });
  if (reader.sound()) check_axes(reader, joint);
  reader.finish();
  return joint;
}

/// Names must be unique.
void check_bodies(MapReader& scene, const std::vector<BodySpec>& bodies, std::vector<std::string> taken) {
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const std::string& name = bodies[i].name;
    if (!name.empty() && std::ranges::find(taken, name) != taken.end())
      scene.diagnostics().problems.push_back(
          {bodies[i].place, item_path("bodies", i) + ".name", name + " a second time",
           "a unique name for each body and object, other than world and ground"});
    taken.push_back(name);
  }
}

/// Names must be unique, and the bodies of joints must exist.
void check_joints(MapReader& scene, const MechanismSpec& spec) {
  std::vector<std::string> known = {"world"};
  for (const BodySpec& body : spec.bodies) known.push_back(body.name);
  for (std::size_t i = 0; i < spec.joints.size(); ++i) {
    const MechanismJointSpec& joint = spec.joints[i];
    const auto problem = [&](const char* key, std::string got, std::string need) {
      scene.diagnostics().problems.push_back(
          {joint.place, item_path("joints", i) + key, std::move(got), std::move(need)});
    };
    const auto check_body = [&](const char* key, const std::string& name) {
      if (std::ranges::find(known, name) != known.end()) return;
      problem(key, name, "world or the name of one of bodies" + nearest_hint(name, known));
    };
    check_body(".parent", joint.parent);
    check_body(".child", joint.child);
    if (joint.child == "world" || joint.child == joint.parent)
      problem(".child", joint.child, "a body other than the parent and the world");
    for (std::size_t k = 0; k < i; ++k)
      if (spec.joints[k].name == joint.name)
        problem(".name", joint.name + " a second time", "a unique name for each joint");
  }
}

}  // namespace

MechanismSpec read_mechanism(MapReader& scene, std::vector<std::string> taken,
                             const std::vector<model::Material>& materials) {
  MechanismSpec spec;
  const std::size_t before = scene.diagnostics().problems.size();
  scene.each("bodies", 0, kMostBodies,
             [&](MapReader reader) { spec.bodies.push_back(read_body(std::move(reader), materials)); });
  check_bodies(scene, spec.bodies, std::move(taken));
  scene.each("joints", 0, kMostBodies,
             [&](MapReader reader) { spec.joints.push_back(read_joint(std::move(reader))); });
  if (scene.diagnostics().problems.size() == before) check_joints(scene, spec);
  return spec;
}

}  // namespace handsim::scene
