#include "handsim/engine/ode/friction.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace handsim::engine::ode {

namespace {

std::pair<int, int> shapes_of(const Presliding& pair) { return {pair.shape_a, pair.shape_b}; }

Patch patch_of(std::span<const Contact> points, std::size_t first) {
  Patch patch;
  patch.first = first;
  patch.count = points.size();
  for (const Contact& point : points) {
    patch.centre += point.position / static_cast<double>(points.size());
    patch.normal += point.normal;
  }
  const double length = patch.normal.norm();
  // Normals that cancel each other have no common tangent: the pair is left to speed alone.
  patch.normal = length > 0.5 ? Vec3(patch.normal / length) : Vec3(Vec3::Zero());
  for (const Contact& point : points)
    patch.reach = std::max(patch.reach, (point.position - patch.centre).norm());
  return patch;
}

Vec3 tangential(const Vec3& v, const Vec3& normal) { return v - v.dot(normal) * normal; }

template <class Archive, class Pair>
void serialize_pair(Archive& archive, Pair& pair) {
  archive(pair.shape_a, pair.shape_b, pair.shift, pair.turn);
}

constexpr double kAtLimit = 1 - 1e-6;  ///< Friction of this share of its limit is at it.
/// Slip for each newton by which the next guess weighs slip against friction [m/s/N]: the length of the step
/// of Alart and Curnier (1991). Any value has the same solution; 1e-2 to 1e-4 take about as many.
constexpr double kMobility = 1e-4;
constexpr double kSamePoint = 5e-3;  ///< A point moves by less in a step, or is another one [m]. Chosen.
/// A solution whose error is not below this share of that of the one before does not come nearer.
constexpr double kContraction = 0.5;
/// Least share of the change of rigid contacts' normal forces that the limits take over; factor by which the
/// share grows back to 1 in a step without error. Chosen.
constexpr double kLeastShare = 0.1, kRecovery = 1.02;
constexpr double kMostForce = 1e12;  ///< No contact of a saved state has more [N].

template <class Archive, class Point>
void serialize_point(Archive& archive, Point& point) {
  archive(point.shape_a, point.shape_b, point.position, point.force);
}

}  // namespace

void PreslidingMemory::save(ArchiveWriter& out) const {
  out.list(pairs_, [](auto& archive, auto& pair) { serialize_pair(archive, pair); });
}

void PreslidingMemory::restore(ArchiveReader& in) {
  in.list(pairs_, [](auto& archive, auto& pair) { serialize_pair(archive, pair); });
  const auto shapes = static_cast<int>(model_.shapes.size());
  for (const Presliding& pair : pairs_)
    if (pair.shape_a >= shapes || pair.shape_b >= shapes)
      in.refuse("a pair of shapes that are not there", "pairs of this scene's shapes");
}

void PreslidingMemory::recall(const Collider& collider, const model::State& state) {
  patches_.clear();
  const std::vector<Contact>& contacts = collider.contacts();
  auto known = pairs_.begin();
  for (const Touch& touch : collider.touches()) {
    const Contact& head = contacts[touch.first];
    const std::pair<int, int> shapes = {head.shape_a, head.shape_b};
    Patch patch = patch_of({&head, as_index(touch.count)}, touch.first);
    patch.body_a = model_.shapes[as_index(head.shape_a)].body;
    patch.body_b = model_.shapes[as_index(head.shape_b)].body;
    patch.reach = std::max(patch.reach, touch.surface.spinning_friction);
    patch.longest = touch.surface.compliance ? kLongestPadShift : kLongestRigidShift;
    while (known != pairs_.end() && shapes_of(*known) < shapes) ++known;
    // Surfaces that do not touch yet have not stuck.
    if (head.depth < 0) patch.normal = Vec3::Zero();
    if (known != pairs_.end() && shapes_of(*known) == shapes && patch.normal != Vec3::Zero()) {
      patch.shift = tangential(state.bodies[as_index(patch.body_b)].q * known->shift, patch.normal);
      patch.turn = known->turn;
    }
    patches_.push_back(patch);
  }
  pairs_.clear();
  for (const Patch& patch : patches_)
    pairs_.push_back({contacts[patch.first].shape_a, contacts[patch.first].shape_b, Vec3::Zero(), 0});
}

void PreslidingMemory::update(const model::State& before, double step) {
  for (std::size_t i = 0; i < patches_.size(); ++i) {
    const Patch& patch = patches_[i];
    if (patch.normal == Vec3::Zero()) continue;
    const Vec3 slip =
        velocity(patch.body_a, patch.centre, before) - velocity(patch.body_b, patch.centre, before);
    Vec3 shift = patch.shift + step * tangential(slip, patch.normal);
    const double length = shift.norm();
    if (length > patch.longest) shift *= patch.longest / length;
    double turn = 0;
    if (patch.reach > 0) {
      const double most = patch.longest / std::max(patch.reach, patch.longest);
      turn = patch.turn + step * (spin(patch.body_a) - spin(patch.body_b)).dot(patch.normal);
      turn = std::clamp(turn, -most, most);
    }
    pairs_[i].shift = before.bodies[as_index(patch.body_b)].q.conjugate() * shift;
    pairs_[i].turn = turn;
  }
}

/// Velocity after the step of the material point that was at a place before it.
Vec3 PreslidingMemory::velocity(int body, const Vec3& place, const model::State& before) const {
  const OdeBody& moved = bodies_[as_index(body)];
  if (moved.id == nullptr) return Vec3::Zero();
  return Vec3(moved.v[0], moved.v[1], moved.v[2]) + spin(body).cross(place - before.bodies[as_index(body)].p);
}

Vec3 PreslidingMemory::spin(int body) const {
  const OdeBody& moved = bodies_[as_index(body)];
  return moved.id == nullptr ? Vec3(Vec3::Zero()) : Vec3(moved.w[0], moved.w[1], moved.w[2]);
}

/// Points are known by their place: their number and order change as faces tilt.
void FrictionLimits::recall(const Collider& collider) {
  limits_.clear();
  error_.reset();
  auto known = memory_.points.begin();
  const auto end = memory_.points.end();
  std::vector<const PointForce*> left;
  for (const Touch& touch : collider.touches()) {
    const Contact& head = collider.contacts()[touch.first];
    const auto pair = std::pair(head.shape_a, head.shape_b);
    const auto of = [](const PointForce& point) { return std::pair(point.shape_a, point.shape_b); };
    while (known != end && of(*known) < pair) ++known;
    left.clear();
    for (; known != end && of(*known) == pair; ++known) left.push_back(&*known);
    for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i) {
      const auto away = [&](const PointForce* point) {
        return (point->position - collider.contacts()[i].position).squaredNorm();
      };
      const auto nearest =
          std::ranges::min_element(left, [&](auto* a, auto* b) { return away(a) < away(b); });
      const bool found = nearest != left.end() && away(*nearest) < kSamePoint * kSamePoint;
      limits_.push_back(found ? std::optional<Vec3>((*nearest)->force) : std::nullopt);
      if (found)
        left.erase(nearest);
      else if (!touch.surface.compliance)
        memory_.share = 1;
    }
  }
}

bool FrictionLimits::refute(const Collider& collider, const std::vector<Vec3>& forces,
                            std::vector<Guessed>& guesses, bool mend) {
  double largest = 0;
  for (const Touch& touch : collider.touches())
    for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i)
      largest = std::max(largest, touch.surface.friction * collider.contacts()[i].normal.dot(forces[i]));
  const double slack = kFrictionError * largest;
  bool found = false;
  for (const Touch& touch : collider.touches())
    for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i) {
      Guessed& guessed = guesses[i];
      if (guessed.guess == Guess::limited) continue;
      const Vec3& n = collider.contacts()[i].normal;
      const double normal = n.dot(forces[i]), limit = touch.surface.friction * normal;
      const Vec3 friction = forces[i] - normal * n;
      const double speed = guessed.slip.norm();
      const Vec3 trial = friction - guessed.slip / kMobility;
      Guessed next = guessed;
      bool right = guessed.guess == Guess::sticks ? friction.norm() <= limit + slack
                   : speed > kStill               ? (friction + limit / speed * guessed.slip).norm() <= slack
                                                  : std::abs(friction.norm() - limit) <= slack;
      if (normal < 0) {
        right = false;
        next.guess = Guess::limited;
      } else if (trial.norm() > limit) {
        next = {Guess::slides, -trial.normalized(), kMobility * (trial.norm() - limit), limit};
      } else {
        next.guess = Guess::sticks;
      }
      if (right) continue;
      found = true;
      if (!mend) next.guess = Guess::limited;
      guessed = next;
    }
  return found;
}

bool FrictionLimits::update(const Collider& collider, const std::vector<Vec3>& forces) {
  double largest = 0, off = 0;  // in units of what it may be
  normals_.clear();
  for (const Touch& touch : collider.touches())
    for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i) {
      const Vec3& n = collider.contacts()[i].normal;
      const double normal = std::max(n.dot(forces[i]), 0.0), limit = touch.surface.friction * normal;
      const double friction = (forces[i] - n.dot(forces[i]) * n).norm();
      largest = std::max(largest, limit);
      // Friction within its limits and the cone is exact for any limits. Those of a new contact are unknown.
      const double was = limits_[i] ? n.dot(*limits_[i]) : 0;
      const bool pad = touch.surface.compliance.has_value();
      const bool at_limit = friction >= kAtLimit * touch.surface.friction * was;
      double beyond = at_limit ? std::abs(friction - limit) : friction - limit;
      // The rows of rigid contacts are a pyramid: what the limits themselves are off by counts.
      if (!pad && limits_[i]) beyond = std::min(beyond, touch.surface.friction * std::abs(normal - was));
      off = std::max(off, beyond / (pad ? kFrictionError : kRigidFrictionError));
      normals_.push_back(limits_[i] ? was : normal);
    }
  const double error = largest > 0 ? off / largest : 0;
  const bool exact = error <= 1;
  bool again = !exact;
  if (exact) {
    memory_.share = std::min(kRecovery * memory_.share, 1.0);
  } else if (error_ && error > kContraction * *error_) {
    again = memory_.share == 1;
    memory_.share = std::max(0.5 * memory_.share, kLeastShare);
  }
  error_ = error;
  memory_.points.clear();
  for (const Touch& touch : collider.touches())
    for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i) {
      const Contact& contact = collider.contacts()[i];
      const double normal = contact.normal.dot(forces[i]), change = normal - normals_[i];
      // What carries nothing has no friction.
      const double share = touch.surface.compliance || normal <= 0 ? 1 : memory_.share;
      limits_[i] = forces[i] - (1 - share) * change * contact.normal;
      memory_.points.push_back({contact.shape_a, contact.shape_b, contact.position, *limits_[i]});
    }
  return again;
}

void FrictionLimits::save(ArchiveWriter& out) const {
  out(memory_.share);
  out.list(memory_.points, [](auto& archive, auto& point) { serialize_point(archive, point); });
}

void FrictionLimits::restore(ArchiveReader& in) {
  in(memory_.share);
  if (!(memory_.share >= 0 && memory_.share <= 1)) in.refuse("a share that is no share", "0 to 1");
  in.list(memory_.points, [](auto& archive, auto& point) { serialize_point(archive, point); });
  for (const PointForce& point : memory_.points)
    if (!(point.force.norm() <= kMostForce)) in.refuse("a contact force that is no force", "at most 1e12 N");
}

}  // namespace handsim::engine::ode
