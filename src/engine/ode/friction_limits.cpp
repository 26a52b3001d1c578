#include "handsim/engine/ode/friction_limits.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace handsim::engine::ode {

namespace {

/// Friction of this share of its limit is at it.
constexpr double kAtLimit = 1 - 1e-6;
/// A point moves by less in a step, or is another one [m]. Chosen.
constexpr double kSamePoint = 5e-3;
/// A solution whose error is not below this share of that of the one before does not come nearer.
constexpr double kContraction = 0.5;
/// Of the change of normal forces of rigid contacts that the limits take over at least; how fast the share
/// grows back to 1, a step without error. Chosen.
constexpr double kLeastShare = 0.1, kRecovery = 1.02;
/// No contact of a saved state has more [N].
constexpr double kMostForce = 1e12;

template <class Archive, class Point>
void carry_point(Archive& archive, Point& point) {
  archive(point.shape_a);
  archive(point.shape_b);
  archive(point.position);
  archive(point.force);
}

}  // namespace

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
    for (std::size_t i = touch.first; i < touch.first + static_cast<std::size_t>(touch.count); ++i) {
      const auto away = [&](const PointForce* point) {
        return (point->position - collider.contacts()[i].position).squaredNorm();
      };
      const auto nearest =
          std::min_element(left.begin(), left.end(), [&](auto* a, auto* b) { return away(a) < away(b); });
      const bool found = nearest != left.end() && away(*nearest) < kSamePoint * kSamePoint;
      limits_.push_back(found ? std::optional<Vec3>((*nearest)->force) : std::nullopt);
      if (found)
        left.erase(nearest);
      else if (!touch.surface.compliance)
        memory_.share = 1;
    }
  }
}

bool FrictionLimits::take_in(const Collider& collider, const std::vector<Vec3>& forces) {
  double largest = 0, off = 0;  // in units of what it may be
  normals_.clear();
  for (const Touch& touch : collider.touches())
    for (std::size_t i = touch.first; i < touch.first + static_cast<std::size_t>(touch.count); ++i) {
      const Vec3& n = collider.contacts()[i].normal;
      const double normal = std::max(n.dot(forces[i]), 0.0), limit = touch.surface.friction * normal;
      const double friction = (forces[i] - n.dot(forces[i]) * n).norm();
      largest = std::max(largest, limit);
      // Friction within its limits and the cone is exact, whatever the limits were. Those of a new contact
      // are not known.
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
    for (std::size_t i = touch.first; i < touch.first + static_cast<std::size_t>(touch.count); ++i) {
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
  out(memory_.points.size());
  for (const PointForce& point : memory_.points) carry_point(out, point);
}

void FrictionLimits::restore(ArchiveReader& in) {
  in(memory_.share);
  if (!(memory_.share >= 0 && memory_.share <= 1)) in.refuse("a share that is no share", "0 to 1");
  memory_.points.resize(in.size());
  for (PointForce& point : memory_.points) {
    carry_point(in, point);
    if (!(point.force.norm() <= kMostForce)) in.refuse("a contact force that is no force", "at most 1e12 N");
  }
}

}  // namespace handsim::engine::ode
