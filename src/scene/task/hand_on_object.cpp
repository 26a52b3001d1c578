#include "handsim/scene/task/hand_on_object.h"

#include <algorithm>

#include "handsim/core/index.h"
#include "handsim/engine/collision/ode_library.h"
#include "handsim/scene/read/contact_groups.h"

namespace handsim::scene {

namespace {

using Owner = ContactGroups::Owner;

/// @returns its body.
int add_object_body(model::Model& model, const ObjectSpec& object, int group) {
  model::Body body;
  body.name = object.name;
  body.mass = object.is_static ? 1 : object.body.mass;
  body.inertia = object.is_static ? Mat3(Mat3::Identity()) : object.body.inertia;
  const int index = static_cast<int>(model.bodies.size());
  model.bodies.push_back(std::move(body));
  const int material = static_cast<int>(model.materials.size());
  model.materials.push_back(object.material);
  for (model::Shape shape : object.shapes) {
    shape.part = model::Part::object;
    shape.group = group;
    shape.material = material;
    shape.body = index;
    shape.pose = object.body_frame().inverse() * shape.pose;
    model.shapes.push_back(std::move(shape));
  }
  return index;
}

/// The rules between this hand and the object, whatever effects are on.
void add_rules(model::Model& model, const ContactsSpec& contacts, const ContactGroups& groups) {
  const auto add = [&](const auto& a, const auto& b, int material) {
    if (effect_of(a, b) == model::Effect::object_contact)
      model.contact_rules.push_back({a.number, b.number, material});
  };
  if (!contacts.rules) {
    for (const auto& a : groups.all)
      for (const auto& b : groups.all)
        if (a.owner == Owner::hand) add(a, b, model::kCombined);
    return;
  }
  for (const ContactRuleSpec& rule : *contacts.rules) {
    int material = model::kCombined;
    for (const model::Material& named : contacts.materials)
      if (rule.material == named.name) {
        material = static_cast<int>(model.materials.size());
        model.materials.push_back(named);
      }
    for_each_pair(groups, rule, [&](const auto& a, const auto& b) { add(a, b, material); });
  }
}

}  // namespace

HandOnObject::HandOnObject(const TaskSite& site) : model_(model::make_model()) {
  engine::enter_ode();
  hand::Placement placement;
  placement.name = site.entry.placement.name;
  ContactGroups groups;
  groups.add_hand(placement.name, hand::add_hand(model_, site.built, placement));
  const int group = model_.add_group("objects");
  groups.add({group, Owner::object}, {"objects", site.object.name});
  object_ = add_object_body(model_, site.object, group);
  body_frame_ = site.object.body_frame();
  add_rules(model_, site.scene.contacts, groups);
  axes_ = control::hand_axes(model_, model_.hands.front());
  parts_.assign(model_.bodies.size(), model::Part::palm);
  for (const model::Shape& shape : model_.shapes) parts_[at(shape.body)] = shape.part;
  collider_ = std::make_unique<engine::Collider>(model_, model::Effects{}, false);
  q_.assign(at(model_.dof_count()), 0.0);
  state_ = model::state_at(model_, q_);
}

/// Moves the bodies beyond joints whose angles have changed, and the object.
void HandOnObject::move(std::span<const double> q) {
  moved_.assign(model_.bodies.size(), false);
  for (const model::Joint& joint : model_.joints) {
    const auto first = q.begin() + joint.first_dof, end = first + model::dof_count(joint.kind);
    const bool moves = moved_[at(joint.parent)] || !std::equal(first, end, q_.begin() + joint.first_dof);
    moved_[at(joint.child)] = moves;
    if (!moves) continue;
    const Pose pose = state_.bodies[at(joint.parent)].pose() * joint.parent_frame *
                      model::joint_transform(joint, {first, end}) * joint.child_frame.inverse();
    state_.bodies[at(joint.child)].p = pose.p;
    state_.bodies[at(joint.child)].q = pose.q;
  }
  q_.assign(q.begin(), q.end());
  model::BodyState& object = state_.bodies[at(object_)];
  const Pose x_HB = x_HO_ * body_frame_;
  object.p = x_HB.p;
  object.q = x_HB.q;
}

const std::vector<TouchPoint>& HandOnObject::touches(std::span<const double> q) {
  move(q);
  collider_->collide(state_, {});
  touches_.clear();
  for (const engine::Touch& touch : collider_->touches())
    for (std::size_t i = touch.first; i < touch.first + at(touch.count); ++i) {
      const engine::Contact& contact = collider_->contacts()[i];
      const int a = model_.shapes[at(contact.shape_a)].body;
      const int b = model_.shapes[at(contact.shape_b)].body;
      const bool hand_is_a = b == object_;
      const double share = collider_->shares()[i];
      touches_.push_back({hand_is_a ? a : b, contact.position,
                          hand_is_a ? Vec3(-contact.normal) : contact.normal, contact.depth,
                          touch.surface.friction, touch.surface.spinning_friction,
                          touch.surface.compliance ? share * touch.surface.compliance->stiffness : 0});
    }
  return touches_;
}

std::size_t HandOnObject::watch(std::span<const int> bodies) {
  auto watched = std::make_unique<Watched>();
  watched->model = model_;
  std::erase_if(watched->model.shapes, [&](const model::Shape& shape) {
    return shape.body != object_ && std::find(bodies.begin(), bodies.end(), shape.body) == bodies.end();
  });
  watched->collider = std::make_unique<engine::Collider>(watched->model, model::Effects{}, false);
  watched_.push_back(std::move(watched));
  return watched_.size() - 1;
}

const std::vector<double>& HandOnObject::depths(std::span<const double> q, std::size_t watched) {
  move(q);
  Watched& of = *watched_[watched];
  of.collider->collide(state_, {});
  depths_.assign(model_.bodies.size(), 0);
  for (const engine::Contact& contact : of.collider->contacts())
    for (const int shape : {contact.shape_a, contact.shape_b}) {
      double& depth = depths_[at(of.model.shapes[at(shape)].body)];
      depth = std::max(depth, contact.depth);
    }
  return depths_;
}

model::Jacobian HandOnObject::jacobian(std::span<const double> q, int body, const Vec3& point) {
  move(q);
  return model::jacobian(model_, state_, body, point);
}

}  // namespace handsim::scene
