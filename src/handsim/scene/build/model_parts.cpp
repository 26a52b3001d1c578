#include "handsim/scene/build/model_parts.h"

#include <algorithm>

#include "handsim/core/error.h"

namespace handsim::scene {

namespace {

int body_index(const model::Model& model, const std::string& name) {
  for (std::size_t i = 0; i < model.bodies.size(); ++i)
    if (model.bodies[i].name == name) return static_cast<int>(i);
  throw input_error("joints", "an unknown body " + name, "world or one of bodies");
}

}  // namespace

int add_object(model::Model& model, const ObjectSpec& object, int group) {
  const int material = static_cast<int>(model.materials.size());
  model.materials.push_back(object.material);
  model::ObjectIndex index{object.name, {}, {}};
  Pose x_BO = object.pose;
  if (!object.is_static) {
    model::Body body;
    body.name = object.name;
    body.mass = object.body.mass;
    body.inertia = object.body.inertia;
    body.zero_pose = object.pose * object.body_frame();
    body.initial_velocity = object.velocity;
    body.initial_angular_velocity = object.angular_velocity;
    x_BO = object.body_frame().inverse();
    index.body = static_cast<int>(model.bodies.size());
    model.bodies.push_back(std::move(body));
  }
  for (std::size_t i = 0; i < object.shapes.size(); ++i) {
    model::Shape shape = object.shapes[i];
    shape.name = object.name;
    if (object.shapes.size() > 1) shape.name += ".part" + std::to_string(i);
    shape.part = model::Part::object;
    shape.group = group;
    shape.material = material;
    shape.body = index.body.value_or(model::kWorld);
    shape.pose = x_BO * shape.pose;
    index.shapes.push_back(static_cast<int>(model.shapes.size()));
    model.shapes.push_back(std::move(shape));
  }
  model.objects.push_back(index);
  return index.body.value_or(model::kWorld);
}

void add_contact_rules(model::Model& model, const ContactsSpec& contacts, const ContactGroups& groups,
                       const model::Effects& wanted, model::Origins* origins) {
  const auto add = [&](const auto& a, const auto& b, std::optional<int> material) {
    const auto effect = effect_of(a, b);
    if (effect && wanted.has(*effect)) model.contact_rules.push_back({a.number, b.number, material});
  };
  for (std::size_t a = 0; a < groups.all.size() && !contacts.rules; ++a)
    for (std::size_t b = a; b < groups.all.size(); ++b) add(groups.all[a], groups.all[b], {});
  if (!contacts.rules) return;
  for (const ContactRuleSpec& rule : *contacts.rules) {
    std::optional<int> material;
    for (const model::Material& named : contacts.materials)
      if (rule.material == named.name) {
        material = static_cast<int>(model.materials.size());
        model.materials.push_back(named);
      }
    for_each_pair(groups, rule, [&](const auto& a, const auto& b) { add(a, b, material); });
    if (origins) origins->add(model, rule.place);
  }
}

int add_ground(model::Model& model, const GroundSpec& ground) {
  model::Shape plane;
  plane.name = "ground";
  plane.kind = model::ShapeKind::plane;
  plane.pose.p.z() = ground.height;
  plane.part = model::Part::ground;
  plane.group = model.add_group("ground");
  plane.material = static_cast<int>(model.materials.size());
  model.materials.push_back(ground.material);
  model.shapes.push_back(std::move(plane));
  return model.shapes.back().group;
}

void add_body(model::Model& model, const BodySpec& spec, int group) {
  model::Body body;
  body.name = spec.name;
  body.mass = spec.mass;
  body.inertia = spec.inertia.asDiagonal();
  body.zero_pose = spec.pose;
  body.initial_velocity = spec.velocity;
  body.initial_angular_velocity = spec.angular_velocity;
  if (spec.shape) {
    model::Shape shape = *spec.shape;
    shape.name = spec.name;
    shape.body = static_cast<int>(model.bodies.size());
    shape.group = group;
    shape.material = static_cast<int>(model.materials.size());
    model.materials.push_back(spec.material);
    model.shapes.push_back(std::move(shape));
  }
  model.bodies.push_back(std::move(body));
}

void add_joint(model::Model& model, const MechanismJointSpec& spec) {
  model::Joint joint;
  joint.name = spec.name;
  joint.kind = spec.kind;
  joint.parent = body_index(model, spec.parent);
  joint.child = body_index(model, spec.child);
  joint.axes = spec.axes;
  // Frames F and M are parallel to the world at the start.
  const Pose x_WF{spec.position, Quat::Identity()};
  joint.parent_frame = model.bodies[as_index(joint.parent)].zero_pose.inverse() * x_WF;
  joint.child_frame = model.bodies[as_index(joint.child)].zero_pose.inverse() * x_WF;
  joint.closes_loop = std::ranges::any_of(
      model.joints, [&](const model::Joint& other) { return other.child == joint.child; });
  joint.first_dof = model.dof_count();
  model.joints.push_back(std::move(joint));
}

}  // namespace handsim::scene
