#include "handsim/engine/collision/clearance.h"

#include <algorithm>
#include <cmath>

#include "handsim/core/triple.h"
#include "handsim/engine/collision/segments.h"

namespace handsim::engine {

namespace {

using model::Extent;
using model::Shape;
using model::ShapeKind;

constexpr double kRounding = 1e-12;  ///< Rounding of poses and distances within a few metres [m].
constexpr std::size_t kGroup = 12;   ///< So many pairs are looked at together.

/// Gap along the axes of the first.
double gap_along(const Extent& a, const Mat3& R_A, const Extent& b, const Mat3& R_B, const Vec3& from_a) {
  const Vec3 apart = (R_A.transpose() * from_a).cwiseAbs();
  const Vec3 wide = a.half + (R_A.transpose() * R_B).cwiseAbs() * b.half;
  return (apart - wide).maxCoeff() - a.round - b.round;
}

/// Squared distance of segments through p and q, half as long as a and b reach.
double square_between(const Vec3& p, const Vec3& a, const Vec3& q, const Vec3& b) {
  const auto [s, t] = nearest_of_segments(p, a, q, b);
  return (p - q + s * a - t * b).squaredNorm();
}

bool segment(const Shape& shape) {
  return shape.kind == ShapeKind::capsule || shape.kind == ShapeKind::sphere;
}

/// A shape where it is, with its extent and rotation.
struct At {
  const Shape& shape;
  const Extent& extent;
  const Pose& pose;
  const Mat3& R;
};

double gap_to_plane(const At& a, const Pose& plane) {
  const Vec3 normal = plane.q * Vec3::UnitZ();
  return normal.dot(a.pose.p - plane.p) - (a.R.transpose() * normal).cwiseAbs().dot(a.extent.half) -
         a.extent.round;
}

double gap_between(const At& a, const At& b) {
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
      placed_(model.shapes.size()),
      pairs_(std::move(pairs)),
      watched_(pairs_.size()),
      due_((pairs_.size() + kGroup - 1) / kGroup, 0.0) {
  extents_.reserve(model.shapes.size());
  for (const Shape& shape : model.shapes) extents_.push_back(extent(shape));
  std::vector<std::size_t> mover_of(model.bodies.size(), model.bodies.size());
  const auto watch = [&](std::size_t index) {
    const Shape& shape = model.shapes[index];
    std::size_t& mover = mover_of[as_index(shape.body)];
    if (mover == model.bodies.size()) {
      mover = movers_.size();
      movers_.emplace_back().body = as_index(shape.body);
    }
    placed_[index].mover = mover;
    const Extent& of = extents_[index];
    Mover& by = movers_[mover];
    by.reach = std::max(by.reach, shape.pose.p.norm() + of.half.norm() + of.round);
    by.endless = by.endless || shape.kind == ShapeKind::plane;
  };
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    watch(pairs_[k].first);
    watch(pairs_[k].second);
    watched_[k].mover_a = static_cast<std::uint32_t>(placed_[pairs_[k].first].mover);
    watched_[k].mover_b = static_cast<std::uint32_t>(placed_[pairs_[k].second].mover);
  }
  pairs_.shrink_to_fit();
  movers_.shrink_to_fit();
  travel_.assign(movers_.size(), 0.0);
  near_.reserve(std::min(pairs_.size(), kUsualNear));
}

const Pose& Clearance::pose(std::size_t shape) {
  Placed& placed = placed_[shape];
  const Mover& by = movers_[placed.mover];
  if (std::exchange(placed.posed, by.moves) != by.moves) {
    const Pose& own = model_.shapes[shape].pose;
    placed.pose = {Triple(by.last.p) + rotate(by.last.q, own.p), (by.last.q * own.q).normalized()};
  }
  return placed.pose;
}

const Mat3& Clearance::rotation(std::size_t shape) {
  Placed& placed = placed_[shape];
  const std::uint64_t moves = movers_[placed.mover].moves;
  if (std::exchange(placed.rotated, moves) != moves) placed.R = pose(shape).q.toRotationMatrix();
  return placed.R;
}

double Clearance::gap(std::size_t a, std::size_t b) {
  return gap_between({model_.shapes[a], extents_[a], pose(a), rotation(a)},
                     {model_.shapes[b], extents_[b], pose(b), rotation(b)});
}

/// Adds up how far the bodies have moved. False where a plane has: it has no farthest point.
bool Clearance::move(const model::State& state) {
  bool bounded = true;
  double most = 0;
  for (std::size_t i = 0; i < movers_.size(); ++i) {
    Mover& each = movers_[i];
    const model::BodyState& now = state.bodies[each.body];
    // A turn by an angle t: |q - q'| = 2 sin(t / 4), and a point moves by 2 sin(t / 2) times its distance.
    // A quaternion that changes its sign only makes the turn too large.
    const double turn2 = (now.q.coeffs() - each.last.q.coeffs()).squaredNorm();
    const double way2 = (now.p - each.last.p).squaredNorm();
    if (way2 == 0 && turn2 == 0) continue;
    const double travel = std::sqrt(way2) + 2 * each.reach * std::sqrt(turn2);
    travel_[i] += travel;
    ++each.moves;
    most = std::max(most, travel);
    bounded = bounded && !each.endless;
    each.last = now.pose();
  }
  moved_ += 2 * most;
  return bounded;
}

/// Tests the pairs of a group that have moved far enough. True where one may touch now or no longer.
bool Clearance::test_group(std::size_t group) {
  bool changed = false;
  double slack = HUGE_VAL;
  const std::size_t end = std::min((group + 1) * kGroup, pairs_.size());
  for (std::size_t k = group * kGroup; k < end; ++k) {
    Watched& pair = watched_[k];
    const double travel = travel_[pair.mover_a] + travel_[pair.mover_b];
    if (!(travel < pair.limit)) {
      const double apart = gap(pairs_[k].first, pairs_[k].second);
      const bool overlap = !(apart > kRounding);
      changed = std::exchange(pair.overlap, overlap) != overlap || changed;
      pair.limit = travel + std::abs(apart) - kRounding;
    }
    slack = std::min(slack, pair.limit - travel);
  }
  due_[group] = moved_ + slack;
  return changed;
}

std::span<const Clearance::Pair> Clearance::near(const model::State& state) {
  if (!move(state)) {
    for (Watched& pair : watched_) pair.limit = 0;
    std::ranges::fill(due_, 0.0);
  }
  bool changed = false;
  for (std::size_t group = 0; group < due_.size(); ++group)
    if (!(moved_ < due_[group])) changed = test_group(group) || changed;
  if (!changed) return near_;
  near_.clear();
  for (std::size_t k = 0; k < pairs_.size(); ++k)
    if (watched_[k].overlap) near_.push_back(pairs_[k]);
  return near_;
}

}  // namespace handsim::engine
