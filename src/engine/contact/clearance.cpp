#include "handsim/engine/contact/clearance.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace handsim::engine {

namespace {

using model::Extent;
using model::Shape;
using model::ShapeKind;

/// Rounding of poses and distances within a few metres [m].
constexpr double kRounding = 1e-12;

/// Gap along the axes of the first.
double gap_along(const Extent& a, const Mat3& R_A, const Extent& b, const Mat3& R_B, const Vec3& from_a) {
  const Vec3 apart = (R_A.transpose() * from_a).cwiseAbs();
  const Vec3 wide = a.half + (R_A.transpose() * R_B).cwiseAbs() * b.half;
  return (apart - wide).maxCoeff() - a.round - b.round;
}

/// Squared distance of two segments through p and q, half as long as a and b reach.
/// Source: C. Ericson, Real-Time Collision Detection (2005), section 5.1.9.
double square_between(const Vec3& p, const Vec3& a, const Vec3& q, const Vec3& b) {
  const Vec3 r = p - q;
  const double aa = a.squaredNorm(), bb = b.squaredNorm(), ab = a.dot(b), ar = a.dot(r), br = b.dot(r);
  const double det = aa * bb - ab * ab;
  const auto within = [](double x) { return std::clamp(x, -1.0, 1.0); };
  double s = det > 0 ? within((ab * br - ar * bb) / det) : 0;
  double t = bb > 0 ? (ab * s + br) / bb : 0;
  if (std::abs(t) > 1 || !(bb > 0)) {
    t = within(t);
    s = aa > 0 ? within((ab * t - ar) / aa) : 0;
  }
  return (r + s * a - t * b).squaredNorm();
}

bool segment(const Shape& shape) {
  return shape.kind == ShapeKind::capsule || shape.kind == ShapeKind::sphere;
}

/// A shape with its extent and rotation.
struct Placed {
  const Shape& shape;
  const Extent& extent;
  const Pose& pose;
  const Mat3& R;
};

double gap_to_plane(const Placed& a, const Pose& plane) {
  const Vec3 normal = plane.q * Vec3::UnitZ();
  return normal.dot(a.pose.p - plane.p) - (a.R.transpose() * normal).cwiseAbs().dot(a.extent.half) -
         a.extent.round;
}

double gap_between(const Placed& a, const Placed& b) {
  if (a.shape.kind == ShapeKind::plane) return gap_to_plane(b, a.pose);
  if (b.shape.kind == ShapeKind::plane) return gap_to_plane(a, b.pose);
  if (segment(a.shape) && segment(b.shape))
    return std::sqrt(square_between(a.pose.p, a.extent.half.z() * a.R.col(2), b.pose.p,
                                    b.extent.half.z() * b.R.col(2))) -
           a.extent.round - b.extent.round;
  const Vec3 from_a = b.pose.p - a.pose.p;
  return std::max(gap_along(a.extent, a.R, b.extent, b.R, from_a),
                  gap_along(b.extent, b.R, a.extent, a.R, -from_a));
}

}  // namespace

double least_gap(const Shape& a, const Pose& x_WA, const Shape& b, const Pose& x_WB) {
  const Extent of_a = extent(a), of_b = extent(b);
  const Mat3 R_A = x_WA.q.toRotationMatrix(), R_B = x_WB.q.toRotationMatrix();
  return gap_between({a, of_a, x_WA, R_A}, {b, of_b, x_WB, R_B});
}

Clearance::Clearance(const model::Model& model, std::vector<Pair> pairs)
    : model_(model),
      rotations_(model.shapes.size()),
      rotated_(model.shapes.size(), false),
      pairs_(std::move(pairs)),
      overlap_(pairs_.size(), false),
      limit_(pairs_.size(), 0.0),
      travel_(model.shapes.size(), 0.0) {
  for (const Shape& shape : model.shapes) {
    const Extent of = extents_.emplace_back(extent(shape));
    reach_.push_back(of.half.norm() + of.round);
  }
  near_.reserve(pairs_.size());
  last_.resize(model.shapes.size());
}

const Mat3& Clearance::rotation(std::size_t shape, const Pose& pose) {
  if (!std::exchange(rotated_[shape], true)) rotations_[shape] = pose.q.toRotationMatrix();
  return rotations_[shape];
}

double Clearance::gap(std::size_t a, std::size_t b, std::span<const Pose> poses) {
  return gap_between({model_.shapes[a], extents_[a], poses[a], rotation(a, poses[a])},
                     {model_.shapes[b], extents_[b], poses[b], rotation(b, poses[b])});
}

/// Adds up how far the shapes have moved. False where a plane has: it has no farthest point.
bool Clearance::move(std::span<const Pose> poses) {
  bool bounded = true;
  double most = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose &now = poses[i], &last = last_[i];
    // Of a turn by an angle t: |q - q'| = 2 sin(t / 4), while a point moves by 2 sin(t / 2) times its
    // distance.
    const double turn2 = std::min((now.q.coeffs() - last.q.coeffs()).squaredNorm(),
                                  (now.q.coeffs() + last.q.coeffs()).squaredNorm());
    const double way2 = (now.p - last.p).squaredNorm();
    if (way2 == 0 && turn2 == 0) continue;
    rotated_[i] = false;
    const double travel = std::sqrt(way2) + 2 * reach_[i] * std::sqrt(turn2);
    travel_[i] += travel;
    most = std::max(most, travel);
    bounded = bounded && model_.shapes[i].kind != ShapeKind::plane;
    last_[i] = now;
  }
  moved_ += 2 * most;
  return bounded;
}

void Clearance::test_pairs(std::span<const Pose> poses) {
  near_.clear();
  moved_ = 0;
  slack_ = HUGE_VAL;
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    const auto [a, b] = pairs_[k];
    const double travel = travel_[a] + travel_[b];
    if (!(travel < limit_[k])) {
      const double apart = gap(a, b, poses);
      overlap_[k] = !(apart > kRounding);
      limit_[k] = travel + std::abs(apart) - kRounding;
    }
    if (overlap_[k]) near_.push_back(pairs_[k]);
    slack_ = std::min(slack_, limit_[k] - travel);
  }
}

std::span<const Clearance::Pair> Clearance::near(std::span<const Pose> poses) {
  const bool bounded = move(poses);
  if (!bounded) std::fill(limit_.begin(), limit_.end(), 0.0);
  if (!bounded || !(moved_ < slack_)) test_pairs(poses);
  return near_;
}

}  // namespace handsim::engine
