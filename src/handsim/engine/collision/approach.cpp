#include "handsim/engine/collision/approach.h"

#include <algorithm>
#include <limits>

#include "handsim/engine/collision/clearance.h"
#include "handsim/model/shape_extent.h"

namespace handsim::engine {

namespace {

/// Shares of the pair's smaller smallest radius: the distance between two samples where the shapes are near,
/// and the depth at which points are taken, so that a face that comes down slightly tilted has all corners.
constexpr double kSampleShare = 0.25, kInto = 0.25;
constexpr int kMostSamples = 500;
/// Bisections of the time of first touch: the shapes are then at most a sixteenth of an interval deep.
constexpr int kHalvings = 4;

}  // namespace

dGeomID Approach::geom(std::size_t shape) {
  if (!geoms_[shape]) geoms_[shape].reset(make_geom(nullptr, model_.shapes[shape], shape));
  return geoms_[shape].get();
}

Approach::Side Approach::side(std::size_t shape, const model::State& state, std::span<const Way> ways) const {
  const auto index = as_index(model_.shapes[shape].body);
  const model::Body& body = model_.bodies[index];
  const bool told = body.kinematic || index == model::kWorld;
  return {shape, state.bodies[index].pose(), ways[index],
          told ? std::numeric_limits<double>::infinity() : body.mass, lever(model_.shapes[shape])};
}

/// The points of two shapes where they touch. @param x_WA, x_WB poses of their bodies
void Approach::touch(const Side& a, const Pose& x_WA, const Side& b, const Pose& x_WB) {
  points_.clear();
  const model::Shape &of_a = shape_of(a), &of_b = shape_of(b);
  if (const auto own = narrow_.manifold(a.shape, x_WA * of_a.pose, b.shape, x_WB * of_b.pose)) {
    points_.assign(own->points.begin(), own->points.begin() + own->count);
    return;
  }
  const dGeomID geom_a = geom(a.shape), geom_b = geom(b.shape);
  place_geom(geom_a, of_a, x_WA);
  place_geom(geom_b, of_b, x_WB);
  add_ode_points(geom_a, geom_b, [&](const Vec3& position, const Vec3& normal, double depth) {
    points_.push_back({position, normal, depth});
  });
}

double Approach::gap(const Side& a, const Side& b, double share) const {
  return least_gap(shape_of(a), moved(a.start, a.way, share) * shape_of(a).pose, shape_of(b),
                   moved(b.start, b.way, share) * shape_of(b).pose);
}

/// The first share of their ways at which two shapes touch: on by the least gap between them where there is
/// one, by small steps where there is none. @param way most that their points can go against each other [m]
std::optional<double> Approach::meeting(const Side& a, const Side& b, double way, double radius) {
  const double interval = std::max(kSampleShare * radius / way, 1.0 / kMostSamples);
  double free = 0;
  for (double share = 0;;) {
    if (const double apart = gap(a, b, share); apart > interval * way) {
      share += apart / way;
      if (share >= 1) return std::nullopt;
      continue;
    }
    touch(a, b, share);
    if (!points_.empty()) {
      for (int i = 0; i < kHalvings && share > free; ++i) {
        const double middle = 0.5 * (free + share);
        touch(a, b, middle);
        (points_.empty() ? free : share) = middle;
      }
      return share;
    }
    if (share >= 1) return std::nullopt;
    free = share;
    share = std::min(1.0, share + interval);
  }
}

/// The points at a share of the ways, moved back to the start. Levers stay as where the two touch: the
/// contact's row then makes the same way, and a ball may spin. @param least approach of points that count [m]
void Approach::measure(const Side& a, const Side& b, double share, double least) {
  const auto way_of = [&](const Side& side, const Vec3& arm) -> Vec3 {
    return share * (side.way.shift + side.way.turn.cross(arm));
  };
  std::size_t kept = 0;
  for (const ManifoldPoint& point : points_) {
    const Vec3 arm_a = point.position - a.start.p - share * a.way.shift;
    const Vec3 arm_b = point.position - b.start.p - share * b.way.shift;
    const double way = -point.normal.dot(way_of(a, arm_a) - way_of(b, arm_b));
    if (!(way > least)) continue;
    // Levers are right for the body that gives way more.
    points_[kept] = {a.mass <= b.mass ? Vec3(a.start.p + arm_a) : Vec3(b.start.p + arm_b), point.normal,
                     std::min(0.0, point.depth - way)};
    ++kept;
  }
  points_.resize(kept);
}

/// Adds points of shapes that touch already: another end may swing down within the step.
void Approach::meet_again(const Side& a, const Side& b, double way, double radius) {
  const double interval = std::max(kSampleShare * radius / way, 1.0 / kMostSamples);
  for (double share = 0; share < 1;) {
    share = std::min(1.0, share + interval);
    touch(a, b, share);
    measure(a, b, share, kInto * radius);
    if (!points_.empty()) return;
  }
}

void Approach::onto_plane(const Side& a, const Side& b) {
  const bool a_is_plane = shape_of(a).kind == model::ShapeKind::plane;
  const Side &plane = a_is_plane ? a : b, &other = a_is_plane ? b : a;
  const Pose ground = plane.start * shape_of(plane).pose;
  const Vec3 up = ground.q * Vec3::UnitZ();
  const double way = -up.dot(other.way.shift) + other.way.turn.norm() * other.lever;
  points_.clear();
  if (!(way > 0) || gap(a, b, 0) > way) return;
  const Pose raised{plane.start.p + way * up, plane.start.q};
  touch(a, a_is_plane ? raised : a.start, b, a_is_plane ? b.start : raised);
  bool meets = false;
  for (ManifoldPoint& point : points_) {
    point.depth -= way;
    // The point is put on the shape, whose height above the plane is the gap.
    point.position -= (up.dot(point.position - ground.p) + point.depth) * up;
    const Vec3 arm = point.position - other.start.p;
    meets = meets || -up.dot(other.way.shift + other.way.turn.cross(arm)) >= -point.depth;
  }
  if (!meets) points_.clear();
}

std::span<const ManifoldPoint> Approach::find(std::size_t shape_a, std::size_t shape_b, bool touching,
                                              const model::State& state, std::span<const Way> ways) {
  const Side a = side(shape_a, state, ways), b = side(shape_b, state, ways);
  if (shape_of(a).kind == model::ShapeKind::plane || shape_of(b).kind == model::ShapeKind::plane) {
    onto_plane(a, b);
    if (touching) std::erase_if(points_, [](const ManifoldPoint& point) { return point.depth >= 0; });
    return points_;
  }
  const double way =
      (a.way.shift - b.way.shift).norm() + a.way.turn.norm() * a.lever + b.way.turn.norm() * b.lever;
  const double radius = std::min(inner_radius(shape_of(a)), inner_radius(shape_of(b)));
  if (touching) {
    meet_again(a, b, way, radius);
    return points_;
  }
  const auto first = meeting(a, b, way, radius);
  points_.clear();
  if (!first) return points_;
  double share = std::min(1.0, *first + kInto * radius / way);
  touch(a, b, share);
  if (points_.empty()) touch(a, b, share = *first);
  measure(a, b, share, 0);
  return points_;
}

}  // namespace handsim::engine
