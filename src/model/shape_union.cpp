#include "handsim/model/shape_union.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "handsim/core/error.h"

namespace handsim::model {

namespace {

constexpr int kColumns = 40;

/// Part of a column inside a solid.
struct Interval {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  bool empty() const { return !(low < high); }
  void add(double z) {
    low = std::min(low, z);
    high = std::max(high, z);
  }
};

/// A capsule (or a sphere, of no length) as a column cuts it.
struct RoundCore {
  RoundCore(const Shape& shape)
      : radius(shape.radius), length(shape.kind == ShapeKind::capsule ? shape.length : 0) {
    along = shape.pose.q * Vec3::UnitZ();
    from = shape.pose.p - 0.5 * length * along;
    to = shape.pose.p + 0.5 * length * along;
    across = 1 - along.z() * along.z();
  }

  Interval at(double x, double y) const {
    Interval out;
    // Where both points of the side are between the ends, no ball reaches further.
    if (across > 1e-12 && add_side(x, y, out)) return out;
    for (const Vec3& end : {from, to}) {
      const double dx = x - end.x(), dy = y - end.y();
      const double room = radius * radius - dx * dx - dy * dy;
      if (room < 0) continue;
      const double half = std::sqrt(room);
      out.add(end.z() - half);
      out.add(end.z() + half);
    }
    return out;
  }

  /// Points at distance r of the axis between its ends: |w|^2 - (w . u)^2 = r^2 with w = w0 + z e_z.
  /// @returns true if both are there.
  bool add_side(double x, double y, Interval& out) const {
    const double wx = x - from.x(), wy = y - from.y(), wz = -from.z();
    const double on = wx * along.x() + wy * along.y() + wz * along.z();
    const double b = wz - on * along.z();
    const double c = wx * wx + wy * wy + wz * wz - on * on - radius * radius;
    const double room = b * b - across * c;
    if (room < 0) return false;
    const double root = std::sqrt(room);
    int found = 0;
    for (const double z : {(-b - root) / across, (-b + root) / across}) {
      const double t = on + z * along.z();
      if (t < 0 || t > length) continue;
      out.add(z);
      ++found;
    }
    return found == 2;
  }

  double radius, length, across;
  Vec3 along, from, to;
};

Interval cut_box(const Shape& box, double x, double y) {
  const Quat turn = box.pose.q.conjugate();
  const Vec3 o = turn * (Vec3(x, y, 0) - box.pose.p), d = turn * Vec3::UnitZ();
  double low = -std::numeric_limits<double>::infinity(), high = -low;
  for (int k = 0; k < 3; ++k) {
    const double half = 0.5 * box.edges[k];
    if (std::abs(d[k]) < 1e-12) {
      if (std::abs(o[k]) > half) return {};
      continue;
    }
    const double a = (-half - o[k]) / d[k], b = (half - o[k]) / d[k];
    low = std::max(low, std::min(a, b));
    high = std::min(high, std::max(a, b));
  }
  Interval out;
  out.low = low;
  out.high = high;
  return out;
}

/// Bounds of a shape along x and y.
struct Bounds {
  double low[2], high[2];
};
Bounds bounds(const Shape& shape) {
  Vec3 half;
  if (shape.kind == ShapeKind::box) {
    half = 0.5 * shape.pose.q.toRotationMatrix().cwiseAbs() * shape.edges;
  } else {
    const double length = shape.kind == ShapeKind::capsule ? shape.length : 0;
    half = (0.5 * length * (shape.pose.q * Vec3::UnitZ())).cwiseAbs() + Vec3::Constant(shape.radius);
  }
  const Vec3 low = shape.pose.p - half, high = shape.pose.p + half;
  return {{low.x(), low.y()}, {high.x(), high.y()}};
}

/// Sums over columns.
struct Moments {
  double volume = 0;
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();

  void add(double x, double y, double low, double high) {
    const double h = high - low, z = 0.5 * (low + high), zz = z * z + h * h / 12;
    volume += h;
    first += h * Vec3(x, y, z);
    second(0, 0) += h * x * x;
    second(1, 1) += h * y * y;
    second(2, 2) += h * zz;
    second(0, 1) += h * x * y;
    second(0, 2) += h * x * z;
    second(1, 2) += h * y * z;
  }
};

/// Adds what a column has of the union; `cuts` become sorted.
void add_column(double x, double y, std::vector<Interval>& cuts, Moments& sums) {
  if (cuts.empty()) return;
  std::sort(cuts.begin(), cuts.end(), [](const Interval& a, const Interval& b) { return a.low < b.low; });
  double low = cuts.front().low, high = cuts.front().high;
  for (const Interval& cut : cuts) {
    if (cut.low > high) {
      sums.add(x, y, low, high);
      low = cut.low;
    }
    high = std::max(high, cut.high);
  }
  sums.add(x, y, low, high);
}

MassProperties properties(const Moments& sums, double dx, double dy) {
  MassProperties out;
  out.mass = sums.volume * dx * dy;
  out.centre = sums.first / sums.volume;
  Mat3 second = sums.second;
  second(1, 0) = second(0, 1);
  second(2, 0) = second(0, 2);
  second(2, 1) = second(1, 2);
  second = (second / sums.volume - out.centre * out.centre.transpose()).eval();
  second(0, 0) += dx * dx / 12;
  second(1, 1) += dy * dy / 12;
  out.inertia = out.mass * (second.trace() * Mat3::Identity() - second);
  return out;
}

}  // namespace

MassProperties union_properties(const std::vector<Shape>& shapes) {
  if (shapes.size() == 1) return solid_properties(shapes.front(), volume(shapes.front()));
  std::vector<std::optional<RoundCore>> round(shapes.size());
  std::vector<Bounds> extents;
  Bounds all = {{1e300, 1e300}, {-1e300, -1e300}};
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const ShapeKind kind = shapes[i].kind;
    if (kind == ShapeKind::capsule || kind == ShapeKind::sphere)
      round[i].emplace(shapes[i]);
    else if (kind != ShapeKind::box)
      throw input_error(shapes[i].name, "a shape of another kind", "boxes, capsules and spheres");
    extents.push_back(bounds(shapes[i]));
    for (int k = 0; k < 2; ++k) {
      all.low[k] = std::min(all.low[k], extents[i].low[k]);
      all.high[k] = std::max(all.high[k], extents[i].high[k]);
    }
  }
  const double dx = (all.high[0] - all.low[0]) / kColumns, dy = (all.high[1] - all.low[1]) / kColumns;
  Moments sums;
  std::vector<Interval> cuts;
  for (int i = 0; i < kColumns; ++i)
    for (int j = 0; j < kColumns; ++j) {
      const double x = all.low[0] + (i + 0.5) * dx, y = all.low[1] + (j + 0.5) * dy;
      cuts.clear();
      for (std::size_t k = 0; k < shapes.size(); ++k) {
        const Bounds& e = extents[k];
        if (x < e.low[0] || x > e.high[0] || y < e.low[1] || y > e.high[1]) continue;
        const Interval cut = round[k] ? round[k]->at(x, y) : cut_box(shapes[k], x, y);
        if (!cut.empty()) cuts.push_back(cut);
      }
      add_column(x, y, cuts, sums);
    }
  return properties(sums, dx, dy);
}

}  // namespace handsim::model
