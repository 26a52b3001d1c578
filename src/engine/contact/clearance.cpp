#include "handsim/engine/contact/clearance.h"

#include <algorithm>
#include <cmath>

#include "handsim/model/shape_extent.h"

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

}  // namespace

double least_gap(const Shape& a, const Pose& x_WA, const Shape& b, const Pose& x_WB) {
  if (a.kind == ShapeKind::plane) return least_gap(b, x_WB, a, x_WA);
  const Extent of_a = extent(a);
  const Mat3 R_A = x_WA.q.toRotationMatrix();
  if (b.kind == ShapeKind::plane) {
    const Vec3 normal = x_WB.q * Vec3::UnitZ();
    return normal.dot(x_WA.p - x_WB.p) - (R_A.transpose() * normal).cwiseAbs().dot(of_a.half) - of_a.round;
  }
  const Extent of_b = extent(b);
  const Mat3 R_B = x_WB.q.toRotationMatrix();
  if (segment(a) && segment(b))
    return std::sqrt(square_between(x_WA.p, of_a.half.z() * R_A.col(2), x_WB.p, of_b.half.z() * R_B.col(2))) -
           of_a.round - of_b.round;
  const Vec3 from_a = x_WB.p - x_WA.p;
  return std::max(gap_along(of_a, R_A, of_b, R_B, from_a), gap_along(of_b, R_B, of_a, R_A, -from_a));
}

Clearance::Clearance(const model::Model& model, std::vector<Pair> pairs)
    : model_(model), pairs_(std::move(pairs)), limit_(pairs_.size(), 0.0), travel_(model.shapes.size(), 0.0) {
  for (const Shape& shape : model.shapes) {
    const Extent of = extent(shape);
    reach_.push_back(of.half.norm() + of.round);
  }
  near_.reserve(pairs_.size());
  last_.resize(model.shapes.size());
}

std::span<const Clearance::Pair> Clearance::near(std::span<const Pose> poses) {
  bool tilted = false;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose &now = poses[i], &last = last_[i];
    // Of a turn by an angle t: |q - q'| = 2 sin(t / 4), while a point moves by 2 sin(t / 2) times its
    // distance.
    const double turn = std::sqrt(std::min((now.q.coeffs() - last.q.coeffs()).squaredNorm(),
                                           (now.q.coeffs() + last.q.coeffs()).squaredNorm()));
    const double way = (now.p - last.p).norm();
    if (way == 0 && turn == 0) continue;
    travel_[i] += way + 2 * reach_[i] * turn;
    tilted = tilted || model_.shapes[i].kind == ShapeKind::plane;
    last_[i] = now;
  }
  // A plane has no farthest point.
  if (tilted) std::fill(limit_.begin(), limit_.end(), 0.0);
  near_.clear();
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    const auto [a, b] = pairs_[k];
    const double travel = travel_[a] + travel_[b];
    if (travel < limit_[k]) continue;
    const double gap = least_gap(model_.shapes[a], poses[a], model_.shapes[b], poses[b]);
    if (gap > kRounding)
      limit_[k] = travel + gap - kRounding;
    else
      near_.push_back(pairs_[k]);
  }
  return near_;
}

}  // namespace handsim::engine
