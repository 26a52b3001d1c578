// Contact points of two shapes as functions of how these lie to each other, by differences.
#include <algorithm>
#include <cmath>

#include "handsim/engine/articulated/derivatives/contact_slopes.h"

namespace handsim::engine::articulated {

namespace {

/// Steps of the differences: an error of (step / radius)^2 beside rounding [rad], [m].
constexpr double kTurn = 2e-5, kShift = 2e-7;
constexpr double kFarthest = 1e-5;  ///< A point further away is another one [m].

/// A pose after a twist about a point.
Pose twisted(const Pose& pose, const Vec3& about, int direction, double size) {
  const Vec3 axis = size * Vec3::Unit(direction % 3);
  if (direction >= 3) return {pose.p + axis, pose.q};
  const Quat turn = rotation_quaternion(axis);
  return {about + turn * (pose.p - about), turn * pose.q};
}

}  // namespace

/// Finds the responses of all points of a touch.
void ContactSlopes::compute_responses(const Touch& touch, const model::State& start) {
  const Contact& any = contact_.contacts()[touch.first];
  responses_.assign(as_index(touch.count), {});
  about_ = any.position;
  const auto pose = [&](int shape) {
    const model::Shape& of = model_.shapes[as_index(shape)];
    return start.bodies[as_index(of.body)].pose() * of.pose;
  };
  const Pose x_WA = pose(any.shape_a), x_WB = pose(any.shape_b);
  // A coming contact: bodies move on to it, its place and normal are where they get to.
  bool coming = false;
  for (std::size_t k = 0; k < as_index(touch.count); ++k) {
    const Contact& contact = contact_.contacts()[touch.first + k];
    if (contact.depth >= 0) continue;
    coming = true;
    const Vec3 arm = contact.position - about_;
    responses_[k].depth << -arm.cross(contact.normal).transpose(), -contact.normal.transpose();
    note(contact, "not yet touching: its place and normal are taken as fixed");
  }
  for (int direction = 0; direction < 6 && !coming; ++direction) difference(touch, x_WA, x_WB, direction);
  if (coming || !touch.surface.compliance) return;
  if (contact_.collider_.shares_by_depth(any)) share_depths(touch);
  if (touch.surface.spins_by_area) compute_spinning(touch);
}

void ContactSlopes::difference(const Touch& touch, const Pose& x_WA, const Pose& x_WB, int direction) {
  const Contact& any = contact_.contacts()[touch.first];
  const double size = direction < 3 ? kTurn : kShift;
  // What turns as a rigid body: exact.
  const double span = direction < 3 ? std::sin(size) : size;
  const auto add = [&](double by, double weight, double whole) {
    const std::span<const Contact> found = contact_.collider_.touch_at(
        as_index(any.shape_a), twisted(x_WA, about_, direction, by * size), as_index(any.shape_b), x_WB);
    for (std::size_t k = 0; k < as_index(touch.count); ++k) {
      const Contact& here = contact_.contacts()[touch.first + k];
      // The nearest point found is this one: lists of points change their order.
      const auto apart = [&](const Contact& point) { return (point.position - here.position).squaredNorm(); };
      const auto there = std::ranges::min_element(found, {}, apart);
      if (there == found.end() || apart(*there) > kFarthest * kFarthest) return false;
      ContactResponse& to = responses_[k];
      const double scale = weight / (whole * span);
      to.place.col(direction) += scale * (there->position - here.position);
      to.normal.col(direction) += scale * (there->normal - here.normal);
      to.depth[direction] += scale * (there->depth - here.depth);
    }
    return true;
  };
  const std::vector<ContactResponse> before = responses_;
  const bool above = add(1, 1, 2), below = add(-1, -1, 2);
  if (above && below) return;
  // Points come or go: the side on which they stay.
  responses_ = before;
  note(any, "points come and go with its tilt: one-sided");
  if (add(above ? 1 : -1, above ? 4 : -4, 2)) add(above ? 2 : -2, above ? -1 : 1, 2);
}

/// Shares depth^2 / sqrt(sum of depth^4) of the points of flat faces.
void ContactSlopes::share_depths(const Touch& touch) {
  double sum = 0;
  const auto depth = [&](std::size_t k) { return contact_.contacts()[touch.first + k].depth; };
  Eigen::Matrix<double, 1, 6> change = Eigen::Matrix<double, 1, 6>::Zero();
  for (std::size_t k = 0; k < as_index(touch.count); ++k) {
    sum += std::pow(depth(k), 4);
    change += 2 * std::pow(depth(k), 3) * responses_[k].depth;
  }
  for (std::size_t k = 0; k < as_index(touch.count) && sum > 0; ++k)
    if (contact_.collider_.shares()[touch.first + k] > kLeastShare)
      responses_[k].share = 2 / depth(k) * responses_[k].depth - change / sum;
}

/// Of Collider::spinning.
void ContactSlopes::compute_spinning(const Touch& touch) {
  const std::span<const double> shares = contact_.collider_.shares().subspan(touch.first);
  Vec3 middle = Vec3::Zero();
  Eigen::Matrix<double, 3, 6> moves = Eigen::Matrix<double, 3, 6>::Zero();
  double sum = 0;
  for (std::size_t k = 0; k < as_index(touch.count); ++k) {
    const Vec3 from = contact_.contacts()[touch.first + k].position - about_;
    middle += shares[k] * from;
    moves += shares[k] * (responses_[k].place + from * responses_[k].share);
    sum += shares[k];
  }
  middle /= sum;
  for (std::size_t k = 0; k < as_index(touch.count); ++k) moves -= shares[k] * middle * responses_[k].share;
  moves /= sum;
  for (std::size_t k = 0; k < as_index(touch.count); ++k) {
    const Contact& at = contact_.contacts()[touch.first + k];
    const double friction = touch.surface.friction, alone = touch.surface.spinning(friction, at.depth);
    if (!(alone > 0)) continue;
    // The coefficient goes with the root of the depth.
    Eigen::Matrix<double, 1, 6>& spin = responses_[k].spin = 0.5 / at.depth * responses_[k].depth;
    const Vec3 from = at.position - about_ - middle;
    const double along = at.normal.dot(from);
    const Vec3 across = from - along * at.normal;
    const double off = friction * across.norm(), whole = std::hypot(alone, off);
    if (touch.count == 1 || !(off > 0)) continue;
    const Eigen::Matrix<double, 1, 6> farther = friction * friction / off * across.transpose() *
                                                (responses_[k].place - moves - along * responses_[k].normal);
    spin = (alone * alone * spin + (off - whole) * farther) / (whole * (whole - off));
  }
}

}  // namespace handsim::engine::articulated
