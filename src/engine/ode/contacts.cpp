#include "handsim/engine/ode/contacts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace handsim::engine::ode {

namespace {

/// Slower sliding has no direction that outlasts rounding [m/s].
constexpr double kStill = 1e-9;
constexpr int kMaxGroups = std::numeric_limits<unsigned long>::digits;

/// For each group, the bits of the groups it is tested against.
std::vector<unsigned long> group_partners(const model::Model& model) {
  std::vector<unsigned long> partners(model.groups.size(), 0);
  for (const model::ContactRule& rule : model.contact_rules) {
    partners[static_cast<std::size_t>(rule.group_a)] |= 1UL << rule.group_b;
    partners[static_cast<std::size_t>(rule.group_b)] |= 1UL << rule.group_a;
  }
  return partners;
}

}  // namespace

bool needs_contacts(const model::Model& model, const model::Effects& effects) {
  return effects.any_contact() && !model.contact_rules.empty();
}

std::vector<Problem> contact_defects(const model::Model& model, const model::Effects& effects) {
  std::vector<Problem> problems;
  if (!needs_contacts(model, effects)) return problems;
  if (model.groups.size() > static_cast<std::size_t>(kMaxGroups))
    problems.push_back({std::nullopt, "groups", fmt::format("{} contact groups", model.groups.size()),
                        fmt::format("at most {}", kMaxGroups)});
  const std::vector<bool> immovable = immovable_bodies(model, effects);
  for (const model::Shape& shape : model.shapes)
    if (shape.kind == model::ShapeKind::plane && !immovable[static_cast<std::size_t>(shape.body)])
      problems.push_back(
          {std::nullopt, shape.name,
           "a plane on the moving body " + model.bodies[static_cast<std::size_t>(shape.body)].name,
           "a plane on the world or on a body that never moves; a box moves"});
  return problems;
}

Contacts::Contacts(OdeIds& ids, const model::Model& model, const Settings& settings,
                   const std::vector<OdeBody>& bodies, const std::vector<bool>& immovable)
    : model_(model),
      bodies_(bodies),
      world_(ids.world.get()),
      untested_(model, immovable),
      friction_(settings.effects.has(model::Effect::friction)),
      fall_(settings.effects.has(model::Effect::gravity) ? Vec3(model.gravity * settings.step)
                                                         : Vec3::Zero()) {
  const bool sweep = model.shapes.size() >= kSweepFrom;
  ids.space.reset(sweep ? dSweepAndPruneSpaceCreate(nullptr, dSAP_AXES_XYZ) : dSimpleSpaceCreate(nullptr));
  ids.contact_joints.reset(dJointGroupCreate(0));
  space_ = ids.space.get();
  joints_ = ids.contact_joints.get();
  dWorldSetContactSurfaceLayer(world_, kSurfaceLayer);
  dWorldSetContactMaxCorrectingVel(world_, kMaxCorrectingSpeed);
  add_geoms(model);
}

void Contacts::add_geoms(const model::Model& model) {
  const std::vector<unsigned long> partners = group_partners(model);
  geoms_.assign(model.shapes.size(), nullptr);
  for (std::size_t i = 0; i < geoms_.size(); ++i) {
    const model::Shape& shape = model.shapes[i];
    const unsigned long meets = partners[static_cast<std::size_t>(shape.group)];
    if (meets == 0) continue;
    geoms_[i] = make_geom(space_, shape, i);
    dGeomSetCategoryBits(geoms_[i], 1UL << shape.group);
    dGeomSetCollideBits(geoms_[i], meets);
    const dBodyID body = bodies_[static_cast<std::size_t>(shape.body)].id;
    if (body != nullptr && shape.kind != model::ShapeKind::plane) fix_geom(geoms_[i], shape, body);
  }
}

void Contacts::place_immovable(const model::State& state) {
  for (std::size_t i = 0; i < geoms_.size(); ++i)
    if (geoms_[i] != nullptr && dGeomGetBody(geoms_[i]) == nullptr)
      place_geom(geoms_[i], model_.shapes[i],
                 state.bodies[static_cast<std::size_t>(model_.shapes[i].body)].pose());
}

void Contacts::near(void* self, dGeomID a, dGeomID b) {
  Contacts& contacts = *static_cast<Contacts*>(self);
  const std::size_t i = shape_index(a);
  const std::size_t j = shape_index(b);
  if (contacts.untested_(contacts.model_.shapes[i].body, contacts.model_.shapes[j].body)) return;
  contacts.near_pairs_.emplace_back(std::min(i, j), std::max(i, j));
}

int Contacts::collide(const model::State& state) {
  near_pairs_.clear();
  contacts_.clear();
  dSpaceCollide(space_, this, &Contacts::near);
  // The space's order depends on its past; the solver's rounding on the order of contacts.
  std::sort(near_pairs_.begin(), near_pairs_.end());
  for (const auto& [a, b] : near_pairs_) collide_pair(a, b, state);
  return static_cast<int>(near_pairs_.size());
}

void Contacts::release() { dJointGroupEmpty(joints_); }

void Contacts::collide_pair(std::size_t a, std::size_t b, const model::State& state) {
  std::array<dContactGeom, kMaxPairContacts> points;
  const int count = dCollide(geoms_[a], geoms_[b], kMaxPairContacts, points.data(), sizeof(dContactGeom));
  for (int i = 0; i < count; ++i) {
    const dContactGeom& point = points[static_cast<std::size_t>(i)];
    contacts_.push_back({static_cast<int>(a), static_cast<int>(b),
                         Vec3(point.pos[0], point.pos[1], point.pos[2]),
                         Vec3(point.normal[0], point.normal[1], point.normal[2]), point.depth});
    add_contact(contacts_.back(), point, state);
  }
}

void Contacts::add_contact(const Contact& contact, const dContactGeom& point, const model::State& state) {
  const Surface of = surface(contact.shape_a, contact.shape_b);
  dContact joint{};
  joint.geom = point;
  joint.surface.mode = dContactApprox1;
  joint.surface.mu = of.friction;
  if (of.restitution > 0) {
    joint.surface.mode |= dContactBounce;
    joint.surface.bounce = of.restitution;
    joint.surface.bounce_vel = of.restitution_speed;
  }
  const Vec3 slip = of.friction > 0 ? sliding(contact, state) : Vec3::Zero();
  const double speed = slip.norm();
  if (speed > kStill) {
    joint.surface.mode |= dContactFDir1;
    for (int i = 0; i < 3; ++i) joint.fdir1[i] = slip[i] / speed;
  }
  const auto body_of = [&](int shape) {
    return bodies_[static_cast<std::size_t>(model_.shapes[static_cast<std::size_t>(shape)].body)].id;
  };
  const dJointID id = dJointCreateContact(world_, joints_, &joint);
  dJointAttach(id, body_of(contact.shape_a), body_of(contact.shape_b));
}

Contacts::Surface Contacts::surface(int shape_a, int shape_b) const {
  const auto material = [&](int shape) -> const model::Material& {
    return model_
        .materials[static_cast<std::size_t>(model_.shapes[static_cast<std::size_t>(shape)].material)];
  };
  const model::Material& a = material(shape_a);
  const model::Material& b = material(shape_b);
  return {friction_ ? std::sqrt(a.friction * b.friction) : 0.0, std::max(a.restitution, b.restitution),
          std::max(a.restitution_speed, b.restitution_speed)};
}

/// Tangential velocity of a against b as it would be after this step without the contact: bodies that rest
/// get the direction in which gravity is about to move them.
Vec3 Contacts::sliding(const Contact& contact, const model::State& state) const {
  const int a = model_.shapes[static_cast<std::size_t>(contact.shape_a)].body;
  const int b = model_.shapes[static_cast<std::size_t>(contact.shape_b)].body;
  const Vec3 v = point_velocity(a, contact.position, state) - point_velocity(b, contact.position, state);
  return v - v.dot(contact.normal) * contact.normal;
}

Vec3 Contacts::point_velocity(int body, const Vec3& at, const model::State& state) const {
  const auto index = static_cast<std::size_t>(body);
  const model::BodyState& moving = state.bodies[index];
  const Vec3 v = moving.v + moving.w.cross(at - moving.p);
  return model_.bodies[index].kinematic ? v : Vec3(v + fall_);
}

}  // namespace handsim::engine::ode
