#include "handsim/engine/ode/contacts.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "handsim/engine/narrow_phase.h"
#include "handsim/engine/ode/spring.h"

namespace handsim::engine::ode {

namespace {

/// Slower sliding has no direction that outlasts rounding [m/s].
constexpr double kStill = 1e-9;
/// Moment per normal force that stands for none [m].
constexpr double kLeastMoment = 1e-9;

}  // namespace

PairTable::PairTable(const model::Model& model)
    : groups_(model.groups.size()), table_(groups_ * groups_, kNever) {
  for (const model::ContactRule& rule : model.contact_rules) {
    const auto a = static_cast<std::size_t>(rule.group_a);
    const auto b = static_cast<std::size_t>(rule.group_b);
    table_[a * groups_ + b] = table_[b * groups_ + a] = rule.material;
  }
}

bool PairTable::meets_any(int group) const {
  for (int other = 0; other < static_cast<int>(groups_); ++other)
    if (meet(group, other)) return true;
  return false;
}

bool needs_contacts(const model::Model& model, const model::Effects& effects) {
  return effects.any_contact() && !model.contact_rules.empty();
}

std::vector<Problem> contact_defects(const model::Model& model, const model::Effects& effects) {
  std::vector<Problem> problems;
  if (!needs_contacts(model, effects)) return problems;
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
      rules_(model),
      friction_(settings.effects.has(model::Effect::friction)),
      with_forces_(settings.contact_forces),
      erp_(settings.erp),
      gravity_(settings.effects.has(model::Effect::gravity) ? model.gravity : Vec3(Vec3::Zero())) {
  const bool sweep = model.shapes.size() >= kSweepFrom;
  ids.space.reset(sweep ? dSweepAndPruneSpaceCreate(nullptr, dSAP_AXES_XYZ) : dSimpleSpaceCreate(nullptr));
  ids.contact_joints.reset(dJointGroupCreate(0));
  space_ = ids.space.get();
  joints_ = ids.contact_joints.get();
  dWorldSetContactSurfaceLayer(world_, kSurfaceLayer);
  set_step(settings.step);
  add_geoms(model);
}

void Contacts::set_step(double step) {
  step_ = step;
  fall_ = gravity_ * step;
}

void Contacts::add_geoms(const model::Model& model) {
  geoms_.assign(model.shapes.size(), nullptr);
  for (std::size_t i = 0; i < geoms_.size(); ++i) {
    const model::Shape& shape = model.shapes[i];
    if (!rules_.meets_any(shape.group)) continue;
    geoms_[i] = make_geom(space_, shape, i);
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
  const model::Shape& first = contacts.model_.shapes[i];
  const model::Shape& second = contacts.model_.shapes[j];
  if (!contacts.rules_.meet(first.group, second.group) || contacts.untested_(first.body, second.body)) return;
  contacts.near_pairs_.emplace_back(std::min(i, j), std::max(i, j));
}

int Contacts::collide(const model::State& state) {
  near_pairs_.clear();
  contacts_.clear();
  contact_joints_.clear();
  dSpaceCollide(space_, this, &Contacts::near);
  // The space's order depends on its past; the solver's rounding on the order of contacts.
  std::sort(near_pairs_.begin(), near_pairs_.end());
  for (const auto& [a, b] : near_pairs_) collide_pair(a, b, state);
  if (with_forces_) {
    feedback_.resize(contacts_.size());
    for (std::size_t i = 0; i < contacts_.size(); ++i) dJointSetFeedback(contact_joints_[i], &feedback_[i]);
  }
  return static_cast<int>(near_pairs_.size());
}

void Contacts::read_forces() {
  if (!with_forces_) return;
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    // ODE makes body b the first of a joint whose body a is not there.
    const dReal* f = feedback_[i].f1;
    const double sign = body_of(contacts_[i].shape_a) == nullptr ? -1 : 1;
    contacts_[i].force = sign * Vec3(f[0], f[1], f[2]);
  }
}

void Contacts::release() { dJointGroupEmpty(joints_); }

dBodyID Contacts::body_of(int shape) const {
  return bodies_[static_cast<std::size_t>(model_.shapes[static_cast<std::size_t>(shape)].body)].id;
}

/// Appends the pair's contact points to the list. @return how many
int Contacts::narrow_phase(std::size_t a, std::size_t b, const model::State& state) {
  const auto pose = [&](std::size_t shape) {
    const model::Shape& of = model_.shapes[shape];
    return state.bodies[static_cast<std::size_t>(of.body)].pose() * of.pose;
  };
  const auto add = [&](const Vec3& position, const Vec3& normal, double depth) {
    contacts_.push_back({static_cast<int>(a), static_cast<int>(b), position, normal, depth, Vec3::Zero()});
  };
  if (const auto own = own_manifold(model_.shapes[a], pose(a), model_.shapes[b], pose(b))) {
    for (int i = 0; i < own->count; ++i) {
      const ManifoldPoint& point = own->points[static_cast<std::size_t>(i)];
      add(point.position, point.normal, point.depth);
    }
    return own->count;
  }
  std::array<dContactGeom, kMaxPairContacts> points;
  const int count = dCollide(geoms_[a], geoms_[b], kMaxPairContacts, points.data(), sizeof(dContactGeom));
  for (int i = 0; i < count; ++i) {
    const dContactGeom& point = points[static_cast<std::size_t>(i)];
    add(Vec3(point.pos[0], point.pos[1], point.pos[2]),
        Vec3(point.normal[0], point.normal[1], point.normal[2]), point.depth);
  }
  return count;
}

void Contacts::collide_pair(std::size_t a, std::size_t b, const model::State& state) {
  const std::size_t first = contacts_.size();
  const int count = narrow_phase(a, b, state);
  if (count == 0) return;
  const model::Material between = surface(a, b);
  for (std::size_t i = first; i < contacts_.size(); ++i) add_contact(contacts_[i], between, count, state);
}

/// A row of ODE's obeys v+ + CFM lambda = ERP / h depth: the pad's spring and damper at the step's end.
void Contacts::soften(dSurfaceParameters& surface, const model::Compliance& pad, int sharing) const {
  const SoftRow row = soft_row(pad.stiffness / sharing, pad.damping / sharing, step_);
  surface.mode |= dContactSoftERP | dContactSoftCFM;
  surface.soft_erp = row.erp;
  surface.soft_cfm = row.cfm;
}

void Contacts::add_contact(const Contact& contact, const model::Material& between, int sharing,
                           const model::State& state) {
  dContact joint{};
  for (int i = 0; i < 3; ++i) {
    joint.geom.pos[i] = contact.position[i];
    joint.geom.normal[i] = contact.normal[i];
  }
  joint.geom.depth = contact.depth;
  dSurfaceParameters& surface = joint.surface;
  surface.mode = dContactApprox1;
  surface.mu = friction_ ? between.friction : 0;
  if (between.restitution > 0) {
    surface.mode |= dContactBounce;
    surface.bounce = between.restitution;
    surface.bounce_vel = between.restitution_speed;
  }
  const double inside = contact.depth - kSurfaceLayer;
  if (between.compliance) {
    soften(surface, *between.compliance, sharing);
  } else if (erp_ * inside > kMaxCorrectingSpeed * step_) {
    surface.mode |= dContactSoftERP;
    surface.soft_erp = kMaxCorrectingSpeed * step_ / inside;
  }
  if (friction_ && (between.rolling_friction > 0 || between.spinning_friction > 0)) {
    surface.mode |= dContactRolling | dContactAxisDep | dContactApprox1_N;
    surface.mu2 = surface.mu;
    // ODE counts a row for each of the three, at 0 too, but then leaves it blank.
    surface.rho = surface.rho2 = std::max(between.rolling_friction, kLeastMoment);
    surface.rhoN = std::max(between.spinning_friction, kLeastMoment);
  }
  const Vec3 slip = surface.mu > 0 ? sliding(contact, state) : Vec3::Zero();
  const double speed = slip.norm();
  if (speed > kStill) {
    surface.mode |= dContactFDir1;
    for (int i = 0; i < 3; ++i) joint.fdir1[i] = slip[i] / speed;
  }
  const dJointID id = dJointCreateContact(world_, joints_, &joint);
  dJointAttach(id, body_of(contact.shape_a), body_of(contact.shape_b));
  contact_joints_.push_back(id);
}

model::Material Contacts::surface(std::size_t a, std::size_t b) const {
  const model::Shape& first = model_.shapes[a];
  const model::Shape& second = model_.shapes[b];
  const int ruled = rules_.material(first.group, second.group);
  if (ruled != model::kCombined) return model_.materials[static_cast<std::size_t>(ruled)];
  return model::combined(model_.materials[static_cast<std::size_t>(first.material)],
                         model_.materials[static_cast<std::size_t>(second.material)]);
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
