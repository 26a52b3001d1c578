#include "handsim/engine/ode/collider.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "handsim/engine/narrow_phase.h"

namespace handsim::engine::ode {

namespace {

template <class Archive, class T>
void carry(Archive& archive, T& contact) {
  archive(contact.shape_a);
  archive(contact.shape_b);
  archive(contact.position);
  archive(contact.normal);
  archive(contact.depth);
  archive(contact.force);
}

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

Collider::Collider(const model::Model& model, const std::vector<bool>& immovable,
                   std::span<const OdeBody> bodies)
    : model_(model), untested_(model, immovable), rules_(model) {
  const bool sweep = model.shapes.size() >= kSweepFrom;
  space_.reset(sweep ? dSweepAndPruneSpaceCreate(nullptr, dSAP_AXES_XYZ) : dSimpleSpaceCreate(nullptr));
  add_geoms(bodies);
}

void Collider::add_geoms(std::span<const OdeBody> bodies) {
  geoms_.assign(model_.shapes.size(), nullptr);
  for (std::size_t i = 0; i < geoms_.size(); ++i) {
    const model::Shape& shape = model_.shapes[i];
    if (!rules_.meets_any(shape.group)) continue;
    geoms_[i] = make_geom(space_.get(), shape, i);
    const dBodyID body = bodies.empty() ? nullptr : bodies[static_cast<std::size_t>(shape.body)].id;
    if (body != nullptr && shape.kind != model::ShapeKind::plane) fix_geom(geoms_[i], shape, body);
  }
}

void Collider::place(const model::State& state) {
  for (std::size_t i = 0; i < geoms_.size(); ++i)
    if (geoms_[i] != nullptr && dGeomGetBody(geoms_[i]) == nullptr)
      place_geom(geoms_[i], model_.shapes[i],
                 state.bodies[static_cast<std::size_t>(model_.shapes[i].body)].pose());
}

void Collider::near(void* self, dGeomID a, dGeomID b) {
  Collider& collider = *static_cast<Collider*>(self);
  const std::size_t i = shape_index(a);
  const std::size_t j = shape_index(b);
  const model::Shape& first = collider.model_.shapes[i];
  const model::Shape& second = collider.model_.shapes[j];
  if (!collider.rules_.meet(first.group, second.group) || collider.untested_(first.body, second.body)) return;
  collider.near_pairs_.emplace_back(std::min(i, j), std::max(i, j));
}

void Collider::save(ArchiveWriter& out) const {
  out(contacts_.size());
  for (const Contact& contact : contacts_) carry(out, contact);
}

void Collider::restore(ArchiveReader& in) {
  contacts_.resize(in.size());
  for (Contact& contact : contacts_) {
    carry(in, contact);
    const auto shapes = static_cast<int>(model_.shapes.size());
    if (contact.shape_a >= shapes || contact.shape_b >= shapes)
      in.refuse("a contact of a shape that is not there", "contacts of this scene's shapes");
  }
}

int Collider::collide(const model::State& state) {
  near_pairs_.clear();
  contacts_.clear();
  touches_.clear();
  dSpaceCollide(space_.get(), this, &Collider::near);
  // The space's order depends on its past; the solver's rounding on the order of contacts.
  std::sort(near_pairs_.begin(), near_pairs_.end());
  for (const auto& [a, b] : near_pairs_) {
    const std::size_t first = contacts_.size();
    const int count = narrow_phase(a, b, state);
    if (count > 0) touches_.push_back({first, count, surface(a, b)});
  }
  return static_cast<int>(near_pairs_.size());
}

/// Appends the pair's contact points to the list. @return how many
int Collider::narrow_phase(std::size_t a, std::size_t b, const model::State& state) {
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

model::Material Collider::surface(std::size_t a, std::size_t b) const {
  const model::Shape& first = model_.shapes[a];
  const model::Shape& second = model_.shapes[b];
  const int ruled = rules_.material(first.group, second.group);
  if (ruled != model::kCombined) return model_.materials[static_cast<std::size_t>(ruled)];
  return model::combined(model_.materials[static_cast<std::size_t>(first.material)],
                         model_.materials[static_cast<std::size_t>(second.material)]);
}

}  // namespace handsim::engine::ode
