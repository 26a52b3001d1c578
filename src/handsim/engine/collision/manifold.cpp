#include "handsim/engine/collision/manifold.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "handsim/core/triple.h"
#include "handsim/engine/collision/surface_walk.h"

namespace handsim::engine {

namespace {

/// Points of one manifold nearer to each other than this share of the radius are one point.
constexpr double kApart = 0.02;
/// A third point counts where it is this share of the radius deeper than the outer two's line; more: jumps.
constexpr double kBulge = 1e-4;
constexpr int kSearchSteps = 40;
constexpr double kSearchEnd = 1e-12;  ///< share of the segment
constexpr double kGolden = 0.6180339887498949;
/// Squares of distances that differ by this factor do so by more than rounding.
constexpr double kSurelyApart = 1 + 1e-9;
/// By how much a segment in a solid is moved out of it, as a share of the solid's reach.
constexpr double kOutside = 1e-9;

/// Distance of a point from a solid's surface [m], negative inside, and the direction out of the solid.
struct Distance {
  double value = 0;
  Vec3 normal = Vec3::UnitZ();
};

/// Places along a segment, fractions 0..1, in ascending order: its two ends, and what was added.
class Places {
 public:
  static constexpr int kMost = 40;
  static constexpr double kSame = 1e-9;

  Places() { at_[0] = 0; }
  /// Places for which there is no room are left out.
  void add(double t) {
    if (!(t > 0 && t < 1 && count_ < kMost - 1)) return;
    auto k = static_cast<std::size_t>(count_++);
    for (; at_[k - 1] > t; --k) at_[k] = at_[k - 1];
    at_[k] = t;
  }
  /// Adds part / whole: most are not between 0 and 1, and need no division.
  void add(double part, double whole) {
    if (whole < 0 ? part < 0 && part > whole : part > 0 && part < whole) add(part / whole);
  }
  /// Adds the far end. Two places that differ by rounding alone count as one.
  void end() {
    at_[static_cast<std::size_t>(count_++)] = 1;
    const auto end = std::unique(at_.begin(), at_.begin() + count_,
                                 [](double low, double high) { return high - low < kSame; });
    count_ = static_cast<int>(end - at_.begin());
    at_[static_cast<std::size_t>(count_ - 1)] = 1;
  }
  int count() const { return count_; }
  double operator[](int i) const { return at_[static_cast<std::size_t>(i)]; }

 private:
  std::array<double, kMost> at_;
  int count_ = 1;
};

/// Where an increasing function passes zero, or the nearer end: false position, Illinois rule (Dowell 1971).
template <class Function>
double zero_of(const Function& f, double low, double high) {
  double below = f(low), above = f(high);
  if (!(below < 0)) return low;
  if (!(above > 0)) return high;
  int side = 0;
  for (int i = 0; i < kSearchSteps && high - low > kSearchEnd; ++i) {
    const double t = (low * above - high * below) / (above - below);
    // Rounding.
    if (!(t > low && t < high)) break;
    const double value = f(t);
    if (value == 0) return t;
    if (value > 0) {
      high = t;
      above = value;
      if (side > 0) below *= 0.5;
      side = 1;
    } else {
      low = t;
      below = value;
      if (side < 0) above *= 0.5;
      side = -1;
    }
  }
  return side > 0 ? high : low;
}

struct Box {
  Vec3 half;
  /// A minimum at a bend is the bend itself, to which a search comes within this share of the radius.
  static constexpr double kBendNear = 1e-6;

  /// Whether a segment's bounding box is further off than a radius, by more than rounding.
  bool apart(const Vec3& a, const Vec3& along, double radius) const {
    const Vec3 beyond = (a + 0.5 * along).cwiseAbs() - 0.5 * along.cwiseAbs() - half;
    return beyond.cwiseMax(0.0).squaredNorm() > kSurelyApart * radius * radius;
  }

  Distance from(const Vec3& p) const {
    const Vec3 beyond = p.cwiseAbs() - half;
    int face = 0;
    const double most = beyond.maxCoeff(&face);
    Distance out;
    if (most <= 0) {
      out.value = most;
      out.normal = std::copysign(1.0, p[face]) * Vec3::Unit(face);
      return out;
    }
    const Vec3 away = beyond.cwiseMax(0.0);
    out.value = away.norm();
    out.normal = (away / out.value).cwiseProduct(p.cwiseSign());
    return out;
  }

  static bool beyond(double) { return false; }

  double distance(const Vec3& p) const {
    const Vec3 beyond = p.cwiseAbs() - half;
    const double most = beyond.maxCoeff();
    return most <= 0 ? most : beyond.cwiseMax(0.0).norm();
  }

  /// Outside, the distance's square is a parabola between two bends, by the axes that the segment is beyond.
  std::optional<double> least(const Vec3& a, const Vec3& along, double low, double high) const {
    const Vec3 middle = a + 0.5 * (low + high) * along;
    double curve = 0, slope = 0;
    bool outside = false;
    for (int i = 0; i < 3; ++i) {
      if (std::abs(middle[i]) <= half[i]) continue;
      outside = true;
      curve += along[i] * along[i];
      slope += along[i] * (a[i] - std::copysign(half[i], middle[i]));
    }
    if (!outside) return std::nullopt;
    return curve > 0 ? std::clamp(-slope / curve, low, high) : low;
  }

  Places bends(const Vec3& a, const Vec3& along) const {
    Places places;
    for (int i = 0; i < 3; ++i) {
      places.add(half[i] - a[i], along[i]);
      places.add(-half[i] - a[i], along[i]);
    }
    places.end();
    return places;
  }
};

struct Cylinder {
  double radius;
  double half;
  static constexpr double kBendNear = Box::kBendNear;

  /// True if distances from the axis and along it show that a segment is further off than `within`.
  bool apart(const Vec3& a, const Vec3& along, double within) const {
    const double square = along.x() * along.x() + along.y() * along.y();
    const double mixed = a.x() * along.x() + a.y() * along.y();
    const double t = square > 0 ? std::clamp(-mixed / square, 0.0, 1.0) : 0;
    const double x = a.x() + t * along.x(), y = a.y() + t * along.y();
    const double beside = std::max(std::sqrt(x * x + y * y) - radius, 0.0);
    const double beyond = std::max(std::abs(a.z() + 0.5 * along.z()) - 0.5 * std::abs(along.z()) - half, 0.0);
    return beside * beside + beyond * beyond > kSurelyApart * within * within;
  }

  Distance from(const Vec3& p) const {
    const double rho = std::hypot(p.x(), p.y());
    const double out_side = rho - radius;
    const double out_end = std::abs(p.z()) - half;
    const Vec3 side = rho > 0 ? Vec3(p.x() / rho, p.y() / rho, 0) : Vec3::UnitX();
    const Vec3 end = std::copysign(1.0, p.z()) * Vec3::UnitZ();
    if (out_side <= 0 && out_end <= 0)
      return out_side > out_end ? Distance{out_side, side} : Distance{out_end, end};
    if (out_end <= 0) return {out_side, side};
    if (out_side <= 0) return {out_end, end};
    const double value = std::hypot(out_side, out_end);
    return {value, (out_side * side + out_end * end) / value};
  }

  static bool beyond(double) { return false; }

  double distance(const Vec3& p) const {
    const double out_side = std::sqrt(p.x() * p.x() + p.y() * p.y()) - radius;
    const double out_end = std::abs(p.z()) - half;
    if (out_side <= 0 || out_end <= 0) return std::max(out_side, out_end);
    return std::sqrt(out_side * out_side + out_end * out_end);
  }

  /// Beside the mantle the distance from the axis is a parabola's root, beyond an end the height is straight.
  std::optional<double> least(const Vec3& a, const Vec3& along, double low, double high) const {
    const Vec3 middle = a + 0.5 * (low + high) * along;
    const bool beside = std::sqrt(middle.x() * middle.x() + middle.y() * middle.y()) > radius;
    const bool beyond = std::abs(middle.z()) > half;
    if (beside && beyond) return nearest_to_rim(a, along, low, high);
    if (!beside && !beyond) return std::nullopt;
    if (beyond) return middle.z() * along.z() > 0 ? low : high;
    const double square = along.x() * along.x() + along.y() * along.y();
    return square > 0 ? std::clamp(-(a.x() * along.x() + a.y() * along.y()) / square, low, high) : low;
  }

  /// Between two bends outside the rim: where the derivative of the distance's square vanishes.
  double nearest_to_rim(const Vec3& a, const Vec3& along, double low, double high) const {
    const auto slope = [&](double t) {
      const Vec3 p = a + t * along;
      const double rho = std::sqrt(p.x() * p.x() + p.y() * p.y());
      const double rise = rho > 0 ? (p.x() * along.x() + p.y() * along.y()) / rho : 0;
      return (rho - radius) * rise + (std::abs(p.z()) - half) * std::copysign(along.z(), p.z() * along.z());
    };
    return zero_of(slope, low, high);
  }

  Places bends(const Vec3& a, const Vec3& along) const {
    Places places;
    places.add(half - a.z(), along.z());
    places.add(-half - a.z(), along.z());
    // Where the segment enters and leaves the endless cylinder.
    const double square = along.x() * along.x() + along.y() * along.y();
    const double mixed = a.x() * along.x() + a.y() * along.y();
    const double rest = a.x() * a.x() + a.y() * a.y() - radius * radius;
    const double inside = mixed * mixed - square * rest;
    if (square > 0 && inside > 0) {
      const double root = std::sqrt(inside);
      places.add(-mixed - root, square);
      places.add(-mixed + root, square);
    }
    places.end();
    return places;
  }
};

/// Bends are the outermost where a sphere of radius `within` that touches leaves a face below it for its rim.
struct Polyhedron {
  const model::ConvexMesh& mesh;
  double within;
  static constexpr double kBendNear = 0;  ///< The least is exact, and bends on both sides of it are as deep.
  double least_at = 0;                    ///< where on the segment the distance is least
  mutable int near = 0;                   ///< the face last met
  mutable std::array<bool, 2> off = {};   ///< the ends that are further off than `within`

  /// Finds where the distance is least.
  bool apart(const Vec3& a, const Vec3& along, double radius) {
    const double t = along.squaredNorm() > 0 ? std::clamp(-a.dot(along) / along.squaredNorm(), 0.0, 1.0) : 0;
    near = mesh.face_towards(a + t * along);
    const Distance middle = from(a + t * along);
    const double slope = middle.normal.dot(along);
    // A convex function is nowhere below its tangent.
    if (middle.value - std::max(slope * t, slope * (t - 1)) > radius) return true;
    // The feature that is nearest where the distance is least says where that is.
    std::optional<double> exact;
    const auto rise = [&](double at) {
      if (exact) return 0.0;
      const Foot foot = nearest_foot(mesh, a + at * along, near);
      near = foot.face;
      exact = least_in_cell(mesh, foot, a, along);
      return exact ? 0.0 : foot.normal.dot(along);
    };
    const double found = slope < 0 ? zero_of(rise, t, 1) : zero_of(rise, 0, t);
    least_at = exact ? std::clamp(*exact, 0.0, 1.0) : found;
    return distance(a + least_at * along) > radius;
  }

  Distance from(const Vec3& p) const {
    const Foot foot = nearest_foot(mesh, p, near);
    near = foot.face;
    return {foot.distance, foot.normal};
  }
  double distance(const Vec3& p) const { return from(p).value; }
  std::optional<double> least(const Vec3&, const Vec3&, double low, double high) const {
    return std::clamp(least_at, low, high);
  }
  /// Whether an end is known to be further off than `within`.
  bool beyond(double t) const { return (t == 0 && off[0]) || (t == 1 && off[1]); }

  Places bends(Vec3 a, const Vec3& along) const {
    Places places;
    Foot lowest = nearest_foot(mesh, a + least_at * along, near);
    // A segment that is in the solid is first moved out of it.
    const double lift = std::max(0.0, kOutside * mesh.reach - lowest.distance);
    a += lift * lowest.normal;
    if (lift > 0) lowest = nearest_foot(mesh, a + least_at * along, lowest.face);
    for (const bool forward : {false, true}) {
      const Bends found = bends_from(mesh, a, along, {least_at, lowest}, within + lift, forward);
      off[forward ? 1 : 0] = found.end_off;
      if (found.inner) places.add(*found.inner);
      if (found.outer) places.add(*found.outer);
    }
    places.end();
    return places;
  }
};

/// Where a convex function is least between two places.
template <class Function>
double search(const Function& f, double low, double high) {
  double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
  double fa = f(a), fb = f(b);
  for (int i = 0; i < kSearchSteps; ++i) {
    if (fa < fb) {
      high = b;
      b = a;
      fb = fa;
      a = high - kGolden * (high - low);
      fa = f(a);
    } else {
      low = a;
      a = b;
      fa = fb;
      b = low + kGolden * (high - low);
      fb = f(b);
    }
  }
  return 0.5 * (low + high);
}

template <class Solid>
Manifold sweep(Solid solid, const CapsuleAt& capsule, const Pose& x_WS) {
  const Vec3 axis = rotate_back(x_WS.q, rotate(capsule.pose.q, Triple(0, 0, capsule.length)));
  const Vec3 start = rotate_back(x_WS.q, Triple(capsule.pose.p) - x_WS.p) - 0.5 * Triple(axis);
  const auto at = [&](double t) -> Vec3 { return start + t * axis; };
  const auto distance = [&](double t) { return solid.distance(at(t)); };

  if (solid.apart(start, axis, capsule.radius)) return {};
  const Places places = solid.bends(start, axis);
  std::array<double, Places::kMost> found;
  int nearest = 0;
  for (int i = 0; i < places.count(); ++i) {
    found[static_cast<std::size_t>(i)] = solid.beyond(places[i]) ? 2 * capsule.radius : distance(places[i]);
    if (found[static_cast<std::size_t>(i)] < found[static_cast<std::size_t>(nearest)]) nearest = i;
  }
  const double low = places[std::max(nearest - 1, 0)];
  const double high = places[std::min(nearest + 1, places.count() - 1)];
  // A distance changes by no more than the way along the segment.
  if (found[static_cast<std::size_t>(nearest)] - (high - low) * capsule.length > capsule.radius) return {};
  double best = places[nearest];
  double best_distance = found[static_cast<std::size_t>(nearest)];
  const auto refine = [&](double from, double to) {
    const std::optional<double> known = solid.least(start, axis, from, to);
    if (known && (*known == from || *known == to)) return;  // found already
    const double t = known ? *known : search(distance, from, to);
    if (const double value = distance(t); value < best_distance - Solid::kBendNear * capsule.radius) {
      best = t;
      best_distance = value;
    }
  };
  if (low < places[nearest]) refine(low, places[nearest]);
  if (high > places[nearest]) refine(places[nearest], high);

  double first = best, last = best;
  double first_distance = best_distance, last_distance = best_distance;
  for (int i = 0; i < places.count(); ++i) {
    const double value = found[static_cast<std::size_t>(i)];
    if (value >= capsule.radius) continue;
    if (places[i] < first) first = places[i], first_distance = value;
    if (places[i] > last) last = places[i], last_distance = value;
  }

  Manifold out;
  const auto add = [&](double t) {
    const Vec3 p = at(t);
    const Distance d = solid.from(p);
    if (d.value >= capsule.radius) return;
    ManifoldPoint& point = out.points[static_cast<std::size_t>(out.count++)];
    point.normal = rotate(x_WS.q, d.normal);
    point.depth = capsule.radius - d.value;
    point.position =
        Triple(x_WS.p) + rotate(x_WS.q, Triple(p) - 0.5 * (capsule.radius + d.value) * Triple(d.normal));
  };
  const double apart = kApart * capsule.radius;
  const bool has_first = (best - first) * capsule.length > apart;
  const bool has_last = (last - best) * capsule.length > apart;
  if (has_first) add(first);
  const double share = last > first ? (best - first) / (last - first) : 0;
  const double chord = (1 - share) * first_distance + share * last_distance;
  if (!has_first || !has_last || best_distance < chord - kBulge * capsule.radius) add(best);
  if (has_last) add(last);
  return out;
}

}  // namespace

Manifold capsule_on_box(const CapsuleAt& capsule, const Pose& pose, const Vec3& edges) {
  return sweep(Box{0.5 * edges}, capsule, pose);
}

Manifold capsule_on_mesh(const CapsuleAt& capsule, const Pose& pose, const model::ConvexMesh& mesh) {
  return sweep(Polyhedron{mesh, capsule.radius}, capsule, pose);
}

std::optional<ManifoldPoint> capsule_on_sphere(const CapsuleAt& capsule, const Vec3& centre, double radius) {
  // The rotation's last column and the sums as ODE has them.
  const double s = capsule.pose.q.w(), x = capsule.pose.q.x(), y = capsule.pose.q.y(), z = capsule.pose.q.z();
  const Vec3 axis(2 * (x * z + s * y), 2 * (y * z - s * x), 1 - 2 * x * x - 2 * y * y);
  const Vec3 away = centre - capsule.pose.p;
  const double half = 0.5 * capsule.length;
  const double along =
      std::clamp(axis.x() * away.x() + axis.y() * away.y() + axis.z() * away.z(), -half, half);
  const Vec3 nearest = capsule.pose.p + along * axis, apart = nearest - centre;
  const double distance = std::sqrt(apart.x() * apart.x() + apart.y() * apart.y() + apart.z() * apart.z());
  if (distance > capsule.radius + radius) return std::nullopt;
  if (!(distance > 0)) return ManifoldPoint{nearest, Vec3::UnitX(), capsule.radius + radius};
  const Vec3 normal = apart * (1 / distance);
  return ManifoldPoint{nearest + normal * (0.5 * (radius - capsule.radius - distance)), normal,
                       capsule.radius + radius - distance};
}

Manifold capsule_on_cylinder(const CapsuleAt& capsule, const Pose& pose, double radius, double length) {
  return sweep(Cylinder{radius, 0.5 * length}, capsule, pose);
}

}  // namespace handsim::engine
