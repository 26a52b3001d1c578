#include "handsim/engine/collision/collider.h"

#include <algorithm>
#include <cmath>

#include "handsim/engine/checks.h"

namespace handsim::engine {

namespace {

constexpr std::size_t kUsualContacts = 32, kUsualTouches = 16;  ///< So many need no allocation in a step.

Clearance::Pair pair_of(std::size_t i, std::size_t j) {
  return {static_cast<std::uint32_t>(std::min(i, j)), static_cast<std::uint32_t>(std::max(i, j))};
}

template <class Archive, class T>
void serialize(Archive& archive, T& contact) {
  archive(contact.shape_a, contact.shape_b, contact.position, contact.normal, contact.depth, contact.force);
}

}  // namespace

Collider::Collider(const model::Model& model, const model::Effects& effects, bool speculative,
                   std::span<const dBodyID> bodies)
    : model_(model),
      untested_(model, immovable_bodies(model, effects)),
      rules_(model),
      narrow_(model),
      approach_(model, narrow_) {
  if (speculative) sweep_.emplace(model, effects);
  ways_.reserve(model.bodies.size());
  const bool sweep = model.shapes.size() >= kSweepFrom;
  space_.reset(sweep ? dSweepAndPruneSpaceCreate(nullptr, dSAP_AXES_XYZ) : dSimpleSpaceCreate(nullptr));
  add_geoms(bodies);
  contacts_.reserve(kUsualContacts);
  touches_.reserve(kUsualTouches);
  shares_.reserve(kUsualContacts);
  if (!bodies.empty()) return;
  clearance_.emplace(model, allowed_pairs());
  near_pairs_.reserve(std::min(clearance_->size(), Clearance::kUsualNear));
}

bool Collider::allowed(std::size_t i, std::size_t j) const {
  const model::Shape &a = model_.shapes[i], &b = model_.shapes[j];
  return rules_.meet(a.group, b.group) && !untested_(a.body, b.body);
}

std::vector<Clearance::Pair> Collider::allowed_pairs() const {
  std::vector<Clearance::Pair> out;
  for (std::size_t i = 0; i < model_.shapes.size(); ++i)
    for (std::size_t j = i + 1; j < model_.shapes.size(); ++j)
      if (allowed(i, j)) out.push_back(pair_of(i, j));
  out.shrink_to_fit();
  return out;
}

void Collider::add_geoms(std::span<const dBodyID> bodies) {
  geoms_.assign(model_.shapes.size(), nullptr);
  for (std::size_t i = 0; i < geoms_.size(); ++i) {
    const model::Shape& shape = model_.shapes[i];
    if (!rules_.meets_any(shape.group)) continue;
    geoms_[i] = make_geom(space_.get(), shape, i);
    const dBodyID body = bodies.empty() ? nullptr : bodies[as_index(shape.body)];
    if (body != nullptr && shape.kind != model::ShapeKind::plane) fix_geom(geoms_[i], shape, body);
  }
}

void Collider::place(const model::State& state) {
  if (clearance_) return;
  for (std::size_t i = 0; i < geoms_.size(); ++i)
    if (geoms_[i] != nullptr && dGeomGetBody(geoms_[i]) == nullptr)
      place_geom(geoms_[i], model_.shapes[i], state.bodies[as_index(model_.shapes[i].body)].pose());
}

void Collider::near(void* self, dGeomID a, dGeomID b) {
  Collider& collider = *static_cast<Collider*>(self);
  const std::size_t i = shape_index(a);
  const std::size_t j = shape_index(b);
  if (collider.allowed(i, j)) collider.near_pairs_.push_back(pair_of(i, j));
}

void Collider::collect_near(const model::State& state) {
  near_pairs_.clear();
  if (!clearance_) {
    dSpaceCollide(space_.get(), this, &Collider::near);
    // The space's order depends on its past; the solver's rounding on the order of contacts.
    std::ranges::sort(near_pairs_);
    return;
  }
  const std::span<const Clearance::Pair> near = clearance_->near(state);
  near_pairs_.assign(near.begin(), near.end());
}

model::Material Collider::surface(int shape_a, int shape_b) const {
  const model::Shape &a = model_.shapes[as_index(shape_a)], &b = model_.shapes[as_index(shape_b)];
  return rules_.meet(a.group, b.group) ? rules_.between(a, b) : model::Material{};
}

void Collider::save(ArchiveWriter& out) const {
  out(contacts_.size());
  for (const Contact& contact : contacts_) serialize(out, contact);
}

void Collider::restore(ArchiveReader& in) {
  contacts_.resize(in.size());
  for (Contact& contact : contacts_) {
    serialize(in, contact);
    const auto shapes = static_cast<int>(model_.shapes.size());
    if (contact.shape_a >= shapes || contact.shape_b >= shapes)
      in.refuse("a contact of a shape that is not there", "contacts of this scene's shapes");
  }
}

/// Pairs so fast that they could pass each other within the step.
std::span<const Sweep::Pair> Collider::find_fast(const model::State& state, const StepForecast& prospect) {
  if (!sweep_) return {};
  const double step2 = prospect.step * prospect.step;
  const auto fast = [&](int body) {
    const model::BodyState& now = state.bodies[as_index(body)];
    return sweep_->fast(body, step2 * (now.v + prospect.fall).squaredNorm(), step2 * now.w.squaredNorm());
  };
  const auto driven_fast = [&](const StepForecast::Driven& each) {
    return sweep_->fast(each.body, each.way.shift.squaredNorm(), each.way.turn.squaredNorm());
  };
  if (std::ranges::none_of(sweep_->bodies(), fast) && std::ranges::none_of(prospect.driven, driven_fast))
    return {};
  ways_.assign(state.bodies.size(), {});
  for (const int body : sweep_->bodies()) {
    const model::BodyState& now = state.bodies[as_index(body)];
    ways_[as_index(body)] = {prospect.step * (now.v + prospect.fall), prospect.step * now.w};
  }
  for (const StepForecast::Driven& each : prospect.driven) ways_[as_index(each.body)] = each.way;
  return sweep_->find(state, ways_);
}

int Collider::collide(const model::State& state, const StepForecast& prospect) {
  contacts_.clear();
  touch_count_ = 0;
  shares_.clear();
  collect_near(state);
  const std::span<const Sweep::Pair> fast = find_fast(state, prospect);
  if (!fast.empty()) {
    // In order, each pair once.
    near_pairs_.insert(near_pairs_.end(), fast.begin(), fast.end());
    std::ranges::sort(near_pairs_);
    near_pairs_.erase(std::unique(near_pairs_.begin(), near_pairs_.end()), near_pairs_.end());
  }
  for (const auto& [a, b] : near_pairs_) {
    const std::size_t first = contacts_.size();
    const bool flat = narrow_.flat(a, b);
    if (touch_count_ == touches_.size()) touches_.emplace_back();
    Touch& touch = touches_[touch_count_];
    const auto set_surface = [&, a = a, b = b] {
      rules_.set_between(model_.shapes[a], model_.shapes[b], touch.surface);
    };
    if (flat) set_surface();
    const bool pad = flat && touch.surface.compliance.has_value();
    int count = narrow_phase(a, pose(a, state), b, pose(b, state), pad, contacts_);
    if (!fast.empty() && std::binary_search(fast.begin(), fast.end(), Sweep::Pair(a, b)))
      count += approach(a, b, count > 0, state);
    if (count == 0) continue;
    if (!flat) set_surface();
    touch.first = first;
    touch.count = count;
    ++touch_count_;
    share_stiffness(touch, flat);
  }
  return static_cast<int>(near_pairs_.size());
}

/// Points of flat faces come and go as these tilt. Equal shares would make all forces of the pair jump; these
/// are of the energy K/2 sqrt(sum of depth^4), so that a point enters with neither force nor stiffness. One
/// point alone has all of K, as has the end of a capsule.
void Collider::share_stiffness(const Touch& touch, bool flat) {
  double sum = 0;
  for (std::size_t i = touch.first; flat && i < touch.first + as_index(touch.count); ++i) {
    const double depth2 = contacts_[i].depth * contacts_[i].depth;
    sum += depth2 * depth2;
  }
  for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i) {
    const double depth = contacts_[i].depth;
    shares_.push_back(flat && sum > 0 ? std::max(depth * depth / std::sqrt(sum), kLeastShare)
                                      : 1.0 / touch.count);
  }
}

/// Several points are one pad: of paraboloids of pressure whose middles are off the common one, the moment is
/// nearly that of the root of squares of their own arm and the distance, of which sliding friction at the
/// points has the distance.
double Collider::spinning(const Touch& touch, std::size_t contact) const {
  const model::Material& surface = touch.surface;
  const Contact& at = contacts_[contact];
  const double alone = surface.spinning(surface.friction, at.depth);
  if (touch.count == 1 || !surface.spins_by_area || !(surface.friction > 0)) return alone;
  Vec3 middle = Vec3::Zero();
  double sum = 0;
  for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i) {
    middle += shares_[i] * contacts_[i].position;
    sum += shares_[i];
  }
  const double off = surface.friction * at.normal.cross(at.position - middle / sum).norm();
  return std::hypot(alone, off) - off;
}

/// Appends the points at which a fast pair is about to touch. @return how many
int Collider::approach(std::size_t a, std::size_t b, bool touching, const model::State& state) {
  const std::span<const ManifoldPoint> points = approach_.find(a, b, touching, state, ways_);
  for (const ManifoldPoint& point : points)
    contacts_.push_back(
        {static_cast<int>(a), static_cast<int>(b), point.position, point.normal, point.depth, Vec3::Zero()});
  return static_cast<int>(points.size());
}

Pose Collider::pose(std::size_t shape, const model::State& state) {
  if (clearance_) return clearance_->pose(shape);
  const model::Shape& of = model_.shapes[shape];
  return state.bodies[as_index(of.body)].pose() * of.pose;
}

/// Appends the contact point of a capsule and a sphere. @return how many; nothing for other pairs
std::optional<int> Collider::capsule_and_sphere(std::size_t a, const Pose& x_WA, std::size_t b,
                                                const Pose& x_WB, std::vector<Contact>& out) const {
  using model::ShapeKind;
  const bool turned = model_.shapes[a].kind == ShapeKind::sphere;
  const model::Shape &capsule = model_.shapes[turned ? b : a], &sphere = model_.shapes[turned ? a : b];
  if (capsule.kind != ShapeKind::capsule || sphere.kind != ShapeKind::sphere) return std::nullopt;
  const auto found = capsule_on_sphere({turned ? x_WB : x_WA, capsule.radius, capsule.length},
                                       (turned ? x_WA : x_WB).p, sphere.radius);
  if (!found) return 0;
  const Vec3 normal = turned ? Vec3(-found->normal) : found->normal;
  out.push_back(
      {static_cast<int>(a), static_cast<int>(b), found->position, normal, found->depth, Vec3::Zero()});
  return 1;
}

/// Appends a pair's contact points. @return how many
int Collider::narrow_phase(std::size_t a, const Pose& x_WA, std::size_t b, const Pose& x_WB, bool pad,
                           std::vector<Contact>& out) {
  const auto add = [&](const Vec3& position, const Vec3& normal, double depth) {
    out.push_back({static_cast<int>(a), static_cast<int>(b), position, normal, depth, Vec3::Zero()});
  };
  if (const auto own = narrow_.manifold(a, x_WA, b, x_WB, pad)) {
    for (int i = 0; i < own->count; ++i) {
      const ManifoldPoint& point = own->points[as_index(i)];
      add(point.position, point.normal, point.depth);
    }
    return own->count;
  }
  if (clearance_) {
    if (const auto count = capsule_and_sphere(a, x_WA, b, x_WB, out)) return *count;
    place_shape(geoms_[a], model_.shapes[a], x_WA);
    place_shape(geoms_[b], model_.shapes[b], x_WB);
  }
  return add_ode_points(geoms_[a], geoms_[b], add);
}

std::span<const Contact> Collider::touch_at(std::size_t a, const Pose& x_WA, std::size_t b,
                                            const Pose& x_WB) {
  const bool pad =
      narrow_.flat(a, b) && rules_.between(model_.shapes[a], model_.shapes[b]).compliance.has_value();
  trial_.clear();
  narrow_phase(a, x_WA, b, x_WB, pad, trial_);
  return trial_;
}

}  // namespace handsim::engine
