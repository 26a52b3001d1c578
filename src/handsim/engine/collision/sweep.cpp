#include "handsim/engine/collision/sweep.h"

#include <algorithm>
#include <limits>

#include "handsim/engine/checks.h"
#include "handsim/engine/collision/clearance.h"
#include "handsim/model/shape_extent.h"

namespace handsim::engine {

namespace {

using model::Shape;
using model::ShapeKind;

constexpr double kEndless = std::numeric_limits<double>::infinity();

}  // namespace

double lever(const Shape& shape) {
  const model::Extent of = extent(shape);
  // A mesh is no ball: a turn brings its corners nearer.
  return shape.pose.p.norm() + (shape.kind == ShapeKind::convex_mesh ? of.round : of.farthest);
}

Pose moved(const Pose& body, const Way& way, double share) {
  const Quat turn = rotation_quaternion(share * way.turn);
  return {body.p + share * way.shift, (turn * body.q).normalized()};
}

Sweep::Sweep(const model::Model& model, const model::Effects& effects)
    : model_(model),
      immovable_(immovable_bodies(model, effects)),
      untested_(model, immovable_),
      rules_(model),
      limits_(model.bodies.size(), Limit{0, kEndless}),
      tracks_(model.shapes.size()) {
  for (const Shape& shape : model.shapes) {
    radii_.push_back(inner_radius(shape));
    levers_.push_back(lever(shape));
  }
  compute_limits();
  order_.reserve(model.shapes.size());
  found_.reserve(model.shapes.size());
}

bool Sweep::allowed(std::size_t i, std::size_t j) const {
  const Shape &a = model_.shapes[i], &b = model_.shapes[j];
  return rules_.meet(a.group, b.group) && !untested_(a.body, b.body);
}

/// A pair whose two bodies each keep to half of what it may go is slow.
void Sweep::compute_limits() {
  const std::size_t n = model_.shapes.size();
  std::vector<double> least(limits_.size(), kEndless);
  const auto lower = [&](int body, int other, double radius) {
    const double share = immovable_[as_index(other)] ? kSlowShare : 0.5 * kSlowShare;
    double& limit = least[as_index(body)];
    limit = std::min(limit, share * radius);
  };
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i + 1; j < n; ++j) {
      if (!allowed(i, j)) continue;
      const int a = model_.shapes[i].body, b = model_.shapes[j].body;
      const double radius = std::min(radii_[i], radii_[j]);
      lower(a, b, radius);
      lower(b, a, radius);
    }
  for (std::size_t i = 0; i < n; ++i) {
    Limit& limit = limits_[as_index(model_.shapes[i].body)];
    limit.lever2 = std::max(limit.lever2, levers_[i] * levers_[i]);
  }
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    limits_[i].way2 = least[i] * least[i];
    if (!immovable_[i] && least[i] < kEndless) bodies_.push_back(static_cast<int>(i));
  }
}

std::span<const Sweep::Pair> Sweep::find(const model::State& state, std::span<const Way> ways) {
  found_.clear();
  order_.clear();
  const auto is_plane = [&](std::size_t i) { return model_.shapes[i].kind == ShapeKind::plane; };
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    const Shape& shape = model_.shapes[i];
    if (!rules_.meets_any(shape.group)) continue;
    const auto body = as_index(shape.body);
    Track& track = tracks_[i];
    track.centre = state.bodies[body].p + state.bodies[body].q * shape.pose.p;
    track.way = ways[body].shift.norm() + ways[body].turn.norm() * levers_[i];
    const model::Extent of = extent(shape);
    track.reach = of.farthest + of.round;
    order_.push_back(i);
  }
  const auto low = [&](std::size_t i) {
    return is_plane(i) ? -kEndless : tracks_[i].centre.x() - tracks_[i].reach - tracks_[i].way;
  };
  std::ranges::sort(order_, [&](std::size_t i, std::size_t j) { return low(i) < low(j); });
  for (std::size_t k = 0; k < order_.size(); ++k) {
    const std::size_t i = order_[k];
    const double high = is_plane(i) ? kEndless : tracks_[i].centre.x() + tracks_[i].reach + tracks_[i].way;
    for (std::size_t l = k + 1; l < order_.size() && low(order_[l]) <= high; ++l)
      add(std::min(i, order_[l]), std::max(i, order_[l]), state, ways);
  }
  std::ranges::sort(found_);
  return found_;
}

void Sweep::add(std::size_t i, std::size_t j, const model::State& state, std::span<const Way> ways) {
  if (tracks_[i].way + tracks_[j].way <= kSlowShare * std::min(radii_[i], radii_[j])) return;
  const Shape &a = model_.shapes[i], &b = model_.shapes[j];
  const Way &way_a = ways[as_index(a.body)], &way_b = ways[as_index(b.body)];
  const double way =
      (way_a.shift - way_b.shift).norm() + way_a.turn.norm() * levers_[i] + way_b.turn.norm() * levers_[j];
  if (way <= kSlowShare * std::min(radii_[i], radii_[j]) || !allowed(i, j)) return;
  const bool flat = a.kind == ShapeKind::plane || b.kind == ShapeKind::plane;
  const double apart = (tracks_[i].centre - tracks_[j].centre).norm() - tracks_[i].reach - tracks_[j].reach;
  if (!flat && apart > way) return;
  const auto pose = [&](const Shape& shape) {
    return state.bodies[as_index(shape.body)].pose() * shape.pose;
  };
  if (least_gap(a, pose(a), b, pose(b)) <= way) found_.emplace_back(i, j);
}

}  // namespace handsim::engine
