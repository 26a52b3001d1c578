#include "handsim/engine/ode/friction_limits.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace handsim::engine::ode {

namespace {

/// Friction of this share of its limit is at it.
constexpr double kAtLimit = 1 - 1e-6;
/// Friction below this share of its limit is taken to stick in the next solution. Chosen.
constexpr double kStickingShare = 0.5;
/// No contact of a saved state has more [N].
constexpr double kMostForce = 1e12;

template <class Archive, class Point>
void carry_point(Archive& archive, Point& point) {
  archive(point.shape_a);
  archive(point.shape_b);
  archive(point.index);
  archive(point.force);
}

}  // namespace

void FrictionLimits::recall(const Collider& collider) {
  limits_.clear();
  auto known = last_.begin();
  for (const Touch& touch : collider.touches())
    for (int index = 0; index < touch.count; ++index) {
      const Contact& contact = collider.contacts()[touch.first + static_cast<std::size_t>(index)];
      const auto key = std::tuple(contact.shape_a, contact.shape_b, index);
      const auto of = [](const PointForce& point) {
        return std::tuple(point.shape_a, point.shape_b, point.index);
      };
      while (known != last_.end() && of(*known) < key) ++known;
      const bool found = known != last_.end() && of(*known) == key;
      limits_.push_back(found ? std::optional<Vec3>(known->force) : std::nullopt);
    }
}

bool FrictionLimits::unlimited(std::size_t index, const Contact& contact,
                               const model::Material& surface) const {
  if (!relaxed_ || !surface.compliance || !limits_[index]) return false;
  const double normal = contact.normal.dot(*limits_[index]);
  return (*limits_[index] - normal * contact.normal).norm() < kStickingShare * surface.friction * normal;
}

bool FrictionLimits::take_in(const Collider& collider, const std::vector<Vec3>& forces) {
  last_.clear();
  double largest = 0, error = 0;
  for (const Touch& touch : collider.touches())
    for (int index = 0; index < touch.count; ++index) {
      const std::size_t i = touch.first + static_cast<std::size_t>(index);
      const Contact& contact = collider.contacts()[i];
      last_.push_back({contact.shape_a, contact.shape_b, index, forces[i]});
      const double normal = std::max(contact.normal.dot(forces[i]), 0.0);
      const double limit = touch.surface.friction * normal;
      const double friction = (forces[i] - contact.normal.dot(forces[i]) * contact.normal).norm();
      largest = std::max(largest, limit);
      // Friction within its limits and the cone is exact, whatever the limits were. Those of a new contact
      // are not known.
      const double was = limits_[i] ? touch.surface.friction * contact.normal.dot(*limits_[i]) : 0;
      const bool at_limit = friction >= kAtLimit * was && !unlimited(i, contact, touch.surface);
      error = std::max(error, at_limit ? std::abs(friction - limit) : friction - limit);
      limits_[i] = forces[i];
    }
  return error > kFrictionError * largest;
}

void FrictionLimits::save(ArchiveWriter& out) const {
  out(last_.size());
  for (const PointForce& point : last_) carry_point(out, point);
}

void FrictionLimits::restore(ArchiveReader& in) {
  last_.resize(in.size());
  for (PointForce& point : last_) {
    carry_point(in, point);
    if (!(point.force.norm() <= kMostForce)) in.refuse("a contact force that is no force", "at most 1e12 N");
  }
}

}  // namespace handsim::engine::ode
