#include "handsim/scene/task/hand_on_object.h"

#include <algorithm>

#include "handsim/engine/contact/ode_library.h"
#include "handsim/model/kinematics.h"
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
  for (const model::Shape& shape : model_.shapes) parts_[static_cast<std::size_t>(shape.body)] = shape.part;
  collider_ = std::make_unique<engine::Collider>(model_, model::Effects{}, false);
}

const std::vector<TouchPoint>& HandOnObject::touches(std::span<const double> q) {
  model::State state = model::state_at(model_, q);
  model::BodyState& object = state.bodies[static_cast<std::size_t>(object_)];
  const Pose x_HB = x_HO_ * body_frame_;
  object.p = x_HB.p;
  object.q = x_HB.q;
  collider_->collide(state, {});
  touches_.clear();
  for (const engine::Touch& touch : collider_->touches())
    for (std::size_t i = touch.first; i < touch.first + static_cast<std::size_t>(touch.count); ++i) {
      const engine::Contact& contact = collider_->contacts()[i];
      const int a = model_.shapes[static_cast<std::size_t>(contact.shape_a)].body;
      const int b = model_.shapes[static_cast<std::size_t>(contact.shape_b)].body;
      const bool hand_is_a = b == object_;
      const double share = collider_->shares()[i];
      touches_.push_back({hand_is_a ? a : b, contact.position,
                          hand_is_a ? Vec3(-contact.normal) : contact.normal, contact.depth,
                          touch.surface.friction,
                          touch.surface.compliance ? share * touch.surface.compliance->stiffness : 0});
    }
  return touches_;
}

const std::vector<double>& HandOnObject::depths(std::span<const double> q) {
  depths_.assign(model_.bodies.size(), 0);
  for (const TouchPoint& touch : touches(q)) {
    double& depth = depths_[static_cast<std::size_t>(touch.body)];
    depth = std::max(depth, touch.depth);
  }
  return depths_;
}

std::vector<Vec3> HandOnObject::jacobian(std::span<const double> q, int body, const Vec3& point) const {
  constexpr double kAngleStep = 1e-6;
  const auto on_body = static_cast<std::size_t>(body);
  const Vec3 local = model::state_at(model_, q).bodies[on_body].pose().inverse() * point;
  std::vector<Vec3> out(q.size());
  std::vector<double> moved(q.begin(), q.end());
  for (std::size_t i = 0; i < q.size(); ++i) {
    moved[i] = q[i] + kAngleStep;
    const Vec3 ahead = model::state_at(model_, moved).bodies[on_body].pose() * local;
    moved[i] = q[i] - kAngleStep;
    out[i] = (ahead - model::state_at(model_, moved).bodies[on_body].pose() * local) / (2 * kAngleStep);
    moved[i] = q[i];
  }
  return out;
}

}  // namespace handsim::scene
