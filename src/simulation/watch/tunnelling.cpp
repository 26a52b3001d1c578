#include "handsim/simulation/watch/tunnelling.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "handsim/engine/contact/crossing.h"

namespace handsim::simulation {

namespace {

/// More pairs are counted and not named.
constexpr std::size_t kMostNamed = 10;
/// A turn by an angle t changes a quaternion by 2 sin(t / 4): t is at most this times as much.
constexpr double kTurnPerChange = 2.3;

}  // namespace

Tunnelling::Tunnelling(const model::Model& model, const model::Effects& effects, const model::State& start)
    : model_(model), sweep_(model, effects) {
  for (const model::Shape& shape : model.shapes)
    radii_.push_back(model.bodies[static_cast<std::size_t>(shape.body)].kinematic ||
                             shape.body == model::kWorld
                         ? std::numeric_limits<double>::infinity()
                         : engine::smallest_radius(shape));
  restart(start);
}

void Tunnelling::restart(const model::State& state) {
  last_.time = state.time;
  last_.bodies = state.bodies;
}

void Tunnelling::look(std::span<const engine::Contact> contacts, const model::State& state) {
  look_at_depths(contacts);
  bool fast = false;
  for (const int body : sweep_.bodies()) {
    const model::BodyState &before = last_.bodies[static_cast<std::size_t>(body)],
                           &now = state.bodies[static_cast<std::size_t>(body)];
    const double change2 = std::min((now.q.coeffs() - before.q.coeffs()).squaredNorm(),
                                    (now.q.coeffs() + before.q.coeffs()).squaredNorm());
    fast = fast ||
           sweep_.fast(body, (now.p - before.p).squaredNorm(), kTurnPerChange * kTurnPerChange * change2);
  }
  if (fast) look_at_ways(state);
  restart(state);
}

/// Contacts are found where the last step ended.
void Tunnelling::look_at_depths(std::span<const engine::Contact> contacts) {
  for (const engine::Contact& contact : contacts) {
    const double most = std::min(radii_[static_cast<std::size_t>(contact.shape_a)],
                                 radii_[static_cast<std::size_t>(contact.shape_b)]);
    if (!(contact.depth > most)) continue;
    Event& met = event(contact.shape_a, contact.shape_b, last_.time);
    if (!(contact.depth > met.depth)) continue;
    met.depth = contact.depth;
    met.depth_time = last_.time;
  }
}

void Tunnelling::look_at_ways(const model::State& state) {
  ways_.assign(state.bodies.size(), {});
  for (std::size_t i = 0; i < ways_.size(); ++i)
    ways_[i] = {state.bodies[i].p - last_.bodies[i].p,
                rotation_vector(state.bodies[i].q * last_.bodies[i].q.conjugate())};
  for (const auto& [a, b] : sweep_.find(last_, ways_))
    if (passes(a, b, state) || passes(b, a, state))
      event(static_cast<int>(a), static_cast<int>(b), state.time).passed = true;
}

/// Whether the centre of a shape has passed through another, as seen from that.
bool Tunnelling::passes(std::size_t a, std::size_t b, const model::State& state) const {
  const model::Shape &point = model_.shapes[a], &solid = model_.shapes[b];
  const auto seen = [&](const model::State& at) -> Vec3 {
    const Pose x_WS = at.bodies[static_cast<std::size_t>(solid.body)].pose() * solid.pose;
    return x_WS.inverse() * (at.bodies[static_cast<std::size_t>(point.body)].pose() * point.pose.p);
  };
  return point.kind != model::ShapeKind::plane && engine::crosses(solid, seen(last_), seen(state));
}

Tunnelling::Event& Tunnelling::event(int a, int b, double time) {
  const auto met =
      std::find_if(events_.begin(), events_.end(), [&](const Event& e) { return e.a == a && e.b == b; });
  if (met != events_.end()) return *met;
  Event& first = events_.emplace_back();
  first.a = a;
  first.b = b;
  first.time = time;
  return first;
}

std::string Tunnelling::first_where() const {
  if (events_.empty()) return "";
  const auto name = [&](int shape) { return model_.shapes[static_cast<std::size_t>(shape)].name; };
  return name(events_.front().a) + " and " + name(events_.front().b);
}

std::vector<std::string> Tunnelling::warnings() const {
  std::vector<std::string> out;
  constexpr const char* kRemedy = "try a smaller step, or stiffer contact";
  for (const Event& met : events_) {
    if (out.size() == kMostNamed) {
      out.push_back(fmt::format("{} more pairs of shapes passed or lay deep in each other",
                                events_.size() - kMostNamed));
      break;
    }
    const auto radius = [&](int shape) { return radii_[static_cast<std::size_t>(shape)]; };
    const bool first = radius(met.a) <= radius(met.b);
    const std::string& body = model_.shapes[static_cast<std::size_t>(first ? met.a : met.b)].name;
    const std::string& other = model_.shapes[static_cast<std::size_t>(first ? met.b : met.a)].name;
    std::string text =
        met.passed ? fmt::format("{} passed through {} at {:.3f} s", body, other, met.time) : "";
    if (met.depth > 0)
      text += fmt::format("{} {:.3g} mm deep in {} at {:.3f} s, beyond its smallest radius of {:.3g} mm",
                          met.passed ? " and lay" : body + " lay", 1e3 * met.depth, met.passed ? "it" : other,
                          met.depth_time, 1e3 * std::min(radius(met.a), radius(met.b)));
    out.push_back(text + ": " + kRemedy);
  }
  return out;
}

template <class Archive, class Self>
void Tunnelling::carry(Archive& archive, Self& self) {
  for (auto& met : self.events_) {
    archive(met.a);
    archive(met.b);
    archive(met.time);
    archive(met.passed);
    archive(met.depth);
    archive(met.depth_time);
  }
}

void Tunnelling::save(ArchiveWriter& out) const {
  out(events_.size());
  carry(out, *this);
}

void Tunnelling::restore(ArchiveReader& in) {
  events_.resize(in.size());
  carry(in, *this);
  const auto shapes = static_cast<int>(model_.shapes.size());
  for (const Event& met : events_)
    if (met.a < 0 || met.b < 0 || met.a >= shapes || met.b >= shapes)
      in.refuse("a pair of shapes that are not there", "pairs of this scene's shapes");
}

}  // namespace handsim::simulation
