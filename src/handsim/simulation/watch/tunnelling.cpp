#include "handsim/simulation/watch/tunnelling.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "handsim/engine/collision/crossing.h"
#include "handsim/model/shape_extent.h"

namespace handsim::simulation {

namespace {

constexpr std::size_t kMostNamed = 10;  ///< More pairs are counted and not named.
/// A turn by an angle t changes a quaternion by 2 sin(t / 4): t is at most this times as much.
constexpr double kTurnPerChange = 2.3;

}  // namespace

Tunnelling::Tunnelling(const Watched& watched)
    : model_(watched.scene.model),
      tested_(watched.engine.tests_contacts()),
      sweep_(model_, watched.scene.spec.solver.effects) {
  for (const model::Shape& shape : model_.shapes)
    radii_.push_back(model_.bodies[as_index(shape.body)].kinematic || shape.body == model::kWorld
                         ? std::numeric_limits<double>::infinity()
                         : model::inner_radius(shape));
  start_from(watched.engine.state());
}

void Tunnelling::start_from(const model::State& state) {
  last_.time = state.time;
  last_.bodies = state.bodies;
}

void Tunnelling::update(Step& step) {
  if (!tested_) return;
  const model::State& state = step.engine.state();
  update_depths(step.engine);
  bool fast = false;
  for (const int body : sweep_.bodies()) {
    const model::BodyState &before = last_.bodies[as_index(body)], &now = state.bodies[as_index(body)];
    const double change2 = std::min((now.q.coeffs() - before.q.coeffs()).squaredNorm(),
                                    (now.q.coeffs() + before.q.coeffs()).squaredNorm());
    fast = fast ||
           sweep_.fast(body, (now.p - before.p).squaredNorm(), kTurnPerChange * kTurnPerChange * change2);
  }
  if (fast) collect_passages(state);
  start_from(state);
}

/// Contacts are found where the last step ended.
void Tunnelling::update_depths(const engine::Engine& engine) {
  for (const engine::Contact& contact : engine.contacts()) {
    if (contact.depth > depth_) {
      depth_ = contact.depth;
      depth_time_ = engine.state().time - engine.settings().step;
      deep_a_ = contact.shape_a;
      deep_b_ = contact.shape_b;
    }
    const double most = std::min(radii_[as_index(contact.shape_a)], radii_[as_index(contact.shape_b)]);
    if (!(contact.depth > most)) continue;
    Event& met = event(contact.shape_a, contact.shape_b, last_.time);
    if (!(contact.depth > met.depth)) continue;
    met.depth = contact.depth;
    met.depth_time = last_.time;
  }
}

void Tunnelling::collect_passages(const model::State& state) {
  ways_.assign(state.bodies.size(), {});
  for (std::size_t i = 0; i < ways_.size(); ++i)
    ways_[i] = {state.bodies[i].p - last_.bodies[i].p,
                rotation_vector(state.bodies[i].q * last_.bodies[i].q.conjugate())};
  for (const auto& [a, b] : sweep_.find(last_, ways_))
    if (passes(a, b, state) || passes(b, a, state))
      event(static_cast<int>(a), static_cast<int>(b), state.time).passed = true;
}

/// Whether the centre of a shape has passed through another, in the other's frame.
bool Tunnelling::passes(std::size_t a, std::size_t b, const model::State& state) const {
  const model::Shape &point = model_.shapes[a], &solid = model_.shapes[b];
  const auto seen = [&](const model::State& then) -> Vec3 {
    const Pose x_WS = then.bodies[as_index(solid.body)].pose() * solid.pose;
    return x_WS.inverse() * (then.bodies[as_index(point.body)].pose() * point.pose.p);
  };
  return point.kind != model::ShapeKind::plane && engine::crosses(solid, seen(last_), seen(state));
}

Tunnelling::Event& Tunnelling::event(int a, int b, double time) {
  const auto met = std::ranges::find_if(events_, [&](const Event& e) { return e.a == a && e.b == b; });
  if (met != events_.end()) return *met;
  Event& first = events_.emplace_back();
  first.a = a;
  first.b = b;
  first.time = time;
  return first;
}

std::string Tunnelling::names(int a, int b) const {
  const auto name = [&](int shape) { return model_.shapes[as_index(shape)].name; };
  return name(a) + " and " + name(b);
}

std::string Tunnelling::first_where() const {
  return events_.empty() ? "" : names(events_.front().a, events_.front().b);
}

Peak Tunnelling::penetration() const {
  return depth_ > 0 ? Peak{depth_, depth_time_, names(deep_a_, deep_b_)} : Peak{};
}

std::string Tunnelling::warning(const Event& met) const {
  const auto radius = [&](int shape) { return radii_[as_index(shape)]; };
  const bool first = radius(met.a) <= radius(met.b);
  const std::string& body = model_.shapes[as_index(first ? met.a : met.b)].name;
  const std::string& other = model_.shapes[as_index(first ? met.b : met.a)].name;
  std::string text = met.passed ? fmt::format("{} passed through {} at {:.3f} s", body, other, met.time) : "";
  if (met.depth > 0)
    text += fmt::format("{} {:.3g} mm deep in {} at {:.3f} s, beyond its smallest radius of {:.3g} mm",
                        met.passed ? " and lay" : body + " lay", 1e3 * met.depth, met.passed ? "it" : other,
                        met.depth_time, 1e3 * std::min(radius(met.a), radius(met.b)));
  return text + ": try a smaller step, or stiffer contact";
}

void Tunnelling::add_warnings(std::vector<std::string>& out) const {
  const std::size_t named = std::min(kMostNamed, events_.size());
  for (std::size_t i = 0; i < named; ++i) out.push_back(warning(events_[i]));
  if (events_.size() > named)
    out.push_back(
        fmt::format("{} more pairs of shapes passed or lay deep in each other", events_.size() - named));
}

/// Nothing is measured where no contacts are tested.
void Tunnelling::add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const {
  const auto measured = [&](double value) { return tested_ ? std::optional(value) : std::nullopt; };
  const Peak deepest = penetration();
  if (tested_ || criteria.penetration)
    out.push_back(
        {"penetration", "m", measured(deepest.value), criteria.penetration, deepest.time, deepest.where});
  if (tested_ || criteria.tunnelling)
    out.push_back({"tunnelling", "", measured(pairs()), criteria.tunnelling, first_time(), first_where()});
}

template <class Archive, class Self>
void Tunnelling::serialize(Archive& archive, Self& self) {
  archive(self.depth_, self.depth_time_, self.deep_a_, self.deep_b_);
  for (auto& met : self.events_) archive(met.a, met.b, met.time, met.passed, met.depth, met.depth_time);
}

void Tunnelling::save(ArchiveWriter& out) const {
  out(events_.size());
  serialize(out, *this);
}

void Tunnelling::restore(ArchiveReader& in, const model::State& state) {
  events_.resize(in.size());
  serialize(in, *this);
  const auto shapes = static_cast<int>(model_.shapes.size());
  if (depth_ > 0 && (deep_a_ >= shapes || deep_b_ >= shapes))
    in.refuse("a contact of a shape that is not there", "one of this scene's shapes");
  for (const Event& met : events_)
    if (met.a < 0 || met.b < 0 || met.a >= shapes || met.b >= shapes)
      in.refuse("a pair of shapes that are not there", "pairs of this scene's shapes");
  start_from(state);
}

}  // namespace handsim::simulation
