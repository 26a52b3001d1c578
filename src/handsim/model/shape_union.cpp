#include "handsim/model/shape_union.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "handsim/core/error.h"

namespace handsim::model {

namespace {

/// Columns are at Gauss-Legendre points of panels between all ends of solids; about so many panels each way.
constexpr double kPanels = 16;
/// Points and weights of a panel from -1 to 1.
constexpr std::array<std::pair<double, double>, 3> kPoints = {
    std::pair{-0.7745966692414834, 5.0 / 9}, {0.0, 8.0 / 9}, {0.7745966692414834, 5.0 / 9}};

/// Gauss points of panels that share the angles from -pi/2 to pi/2.
struct Arc {
  explicit Arc(int panels) {
    const double span = 0.5 * M_PI / panels;  // half a panel's angle
    for (int panel = 0; panel < panels; ++panel)
      for (const auto& [point, weight] : kPoints) {
        const double angle = -0.5 * M_PI + span * (2 * panel + 1 + point);
        points.push_back({std::sin(angle), std::cos(angle), weight * span});
      }
  }
  struct Point {
    double sine, cosine, weight;
  };
  std::vector<Point> points;
};

/// The arc of 1 to kPanels panels, computed once: thousands of columns use the same few arcs.
const Arc& arc(int panels) {
  static const std::vector<Arc> arcs = [] {
    std::vector<Arc> out;
    for (int n = 1; n <= static_cast<int>(kPanels); ++n) out.emplace_back(n);
    return out;
  }();
  return arcs[static_cast<std::size_t>(panels - 1)];
}

struct Interval {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  bool empty() const { return !(low < high); }
  double length() const { return high - low; }
  void add(double z) {
    low = std::min(low, z);
    high = std::max(high, z);
  }
};

/// A capsule, or a sphere, which is one of no length.
struct RoundCore {
  explicit RoundCore(const Shape& shape)
      : radius(shape.radius), length(shape.kind == ShapeKind::capsule ? shape.length : 0) {
    along = shape.pose.q * Vec3::UnitZ();
    from = shape.pose.p - 0.5 * length * along;
    to = shape.pose.p + 0.5 * length * along;
    across = 1 - along.z() * along.z();
  }

  /// Extent along y of the section at x: of the circles that it cuts out of the balls at both ends, and of
  /// the side, whose normal at its farthest point is across axis and z.
  Interval along_y(double x) const {
    Interval out;
    for (const Vec3& end : {from, to}) {
      const double room = radius * radius - (x - end.x()) * (x - end.x());
      if (room < 0) continue;
      out.add(end.y() - std::sqrt(room));
      out.add(end.y() + std::sqrt(room));
    }
    const double flat = std::hypot(along.x(), along.y());
    if (std::abs(along.x()) < 1e-9) return out;
    for (const double sign : {-1.0, 1.0}) {
      const double nx = sign * along.y() / flat, ny = -sign * along.x() / flat;
      const double t = (x - from.x() - radius * nx) / along.x();
      if (t > 0 && t < length) out.add(from.y() + t * along.y() + radius * ny);
    }
    return out;
  }

  double radius, length, across;
  Vec3 along, from, to;
};

/// Columns of one x through a round core: what they share is found once.
class RoundSection {
 public:
  RoundSection() = default;
  RoundSection(const RoundCore& core, double x)
      : core_(&core),
        wx_(x - core.from.x()),
        room_from_(core.radius * core.radius - wx_ * wx_),
        room_to_(core.radius * core.radius - (x - core.to.x()) * (x - core.to.x())) {}

  Interval at(double y) const {
    Interval out;
    // Where both points of the side are between the ends, no ball reaches further.
    if (core_->across > 1e-12 && add_side(y, out)) return out;
    add_ball(room_from_, core_->from, y, out);
    add_ball(room_to_, core_->to, y, out);
    return out;
  }

 private:
  static void add_ball(double room_at_x, const Vec3& centre, double y, Interval& out) {
    const double dy = y - centre.y(), room = room_at_x - dy * dy;
    if (room < 0) return;
    const double half = std::sqrt(room);
    out.add(centre.z() - half);
    out.add(centre.z() + half);
  }

  /// Points at distance r of the axis: |w|^2 - (w . u)^2 = r^2, w = w0 + z e_z. @returns true for both
  bool add_side(double y, Interval& out) const {
    const RoundCore& core = *core_;
    const Vec3& u = core.along;
    const double wy = y - core.from.y(), wz = -core.from.z();
    const double on = wx_ * u.x() + wy * u.y() + wz * u.z();
    const double b = wz - on * u.z();
    const double c = wx_ * wx_ + wy * wy + wz * wz - on * on - core.radius * core.radius;
    const double room = b * b - core.across * c;
    if (room < 0) return false;
    const double root = std::sqrt(room);
    const double low = (-b - root) / core.across, high = (-b + root) / core.across;
    const auto between_ends = [&](double z) {
      const double t = on + z * u.z();
      return t >= 0 && t <= core.length;
    };
    const bool first = between_ends(low), second = between_ends(high);
    if (first) out = {low, low};
    if (second) out = {first ? low : high, high};
    return first && second;
  }

  const RoundCore* core_ = nullptr;
  double wx_ = 0;                       ///< from the core's first end [m]
  double room_from_ = 0, room_to_ = 0;  ///< what x leaves of each ball's squared radius [m^2]
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

/// Extent along y of a box's section at x: of the points where it cuts the edges.
Interval box_along_y(const Shape& box, double x) {
  const Mat3 half = 0.5 * box.pose.q.toRotationMatrix() * box.edges.asDiagonal();
  Interval out;
  for (int k = 0; k < 3; ++k)
    for (const double i : {-1.0, 1.0})
      for (const double j : {-1.0, 1.0}) {
        const Vec3 middle = box.pose.p + i * half.col((k + 1) % 3) + j * half.col((k + 2) % 3);
        const Vec3 way = half.col(k);
        if (std::abs(x - middle.x()) > std::abs(way.x()) || way.x() == 0) continue;
        out.add(middle.y() + (x - middle.x()) / way.x() * way.y());
      }
  return out;
}

Interval along_x(const Shape& shape) {
  const Mat3 R = shape.pose.q.toRotationMatrix();
  double half;
  if (shape.kind == ShapeKind::box)
    half = 0.5 * R.row(0).cwiseAbs().dot(shape.edges);
  else
    half = (shape.kind == ShapeKind::capsule ? 0.5 * shape.length * std::abs(R(0, 2)) : 0) + shape.radius;
  return {shape.pose.p.x() - half, shape.pose.p.x() + half};
}

/// Calls `at(place, weight)` along a line through solids: sums of weight times a function are its integral. A
/// place in a gap between ends is the sine of an evenly spaced angle: chords beginning like roots are smooth.
template <class At>
void integrate(const std::vector<Interval>& solids, At at) {
  std::vector<double> ends;
  for (const Interval& solid : solids) {
    if (solid.empty()) continue;
    ends.push_back(solid.low);
    ends.push_back(solid.high);
  }
  if (ends.empty()) return;
  std::ranges::sort(ends);
  const double width = (ends.back() - ends.front()) / kPanels;
  for (std::size_t k = 0; k + 1 < ends.size(); ++k) {
    const double half = 0.5 * (ends[k + 1] - ends[k]), middle = ends[k] + half;
    if (half < 1e-9 * width) continue;
    const int panels = std::max(1, static_cast<int>(std::lround(2 * half / width)));
    for (const Arc::Point& point : arc(panels).points)
      at(middle + half * point.sine, point.weight * half * point.cosine);
  }
}

struct Moments {
  double volume = 0;
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();

  /// @param weight area of the column
  void add(double x, double y, const Interval& part, double weight) {
    const double h = part.length(), z = 0.5 * (part.low + part.high), zz = z * z + h * h / 12;
    const double v = weight * h;
    volume += v;
    first += v * Vec3(x, y, z);
    second(0, 0) += v * x * x;
    second(1, 1) += v * y * y;
    second(2, 2) += v * zz;
    second(0, 1) += v * x * y;
    second(0, 2) += v * x * z;
    second(1, 2) += v * y * z;
  }
};

/// Adds what a column has of the union; `cuts` become sorted.
void add_column(double x, double y, std::span<Interval> cuts, double weight, Moments& sums) {
  if (cuts.empty()) return;
  // A few, mostly in order.
  for (std::size_t i = 1; i < cuts.size(); ++i)
    for (std::size_t k = i; k > 0 && cuts[k].low < cuts[k - 1].low; --k) std::swap(cuts[k], cuts[k - 1]);
  Interval part = cuts.front();
  for (const Interval& cut : cuts) {
    if (cut.low > part.high) {
      sums.add(x, y, part, weight);
      part = cut;
    }
    part.high = std::max(part.high, cut.high);
  }
  sums.add(x, y, part, weight);
}

MassProperties properties(const Moments& sums) {
  MassProperties out;
  out.mass = sums.volume;
  out.centre = sums.first / sums.volume;
  Mat3 second = sums.second;
  second(1, 0) = second(0, 1);
  second(2, 0) = second(0, 2);
  second(2, 1) = second(1, 2);
  second = (second / sums.volume - out.centre * out.centre.transpose()).eval();
  out.inertia = out.mass * (second.trace() * Mat3::Identity() - second);
  return out;
}

}  // namespace

MassProperties union_properties(const std::vector<Shape>& shapes) {
  if (shapes.size() == 1) return solid_properties(shapes.front(), volume(shapes.front()));
  std::vector<std::optional<RoundCore>> round(shapes.size());
  std::vector<Interval> across, extents(shapes.size()), cuts(shapes.size());
  std::vector<RoundSection> sections(shapes.size());
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const ShapeKind kind = shapes[i].kind;
    if (kind == ShapeKind::capsule || kind == ShapeKind::sphere)
      round[i].emplace(shapes[i]);
    else if (kind != ShapeKind::box)
      throw input_error(shapes[i].name, "a shape of another kind", "boxes, capsules and spheres");
    across.push_back(along_x(shapes[i]));
  }
  Moments sums;
  integrate(across, [&](double x, double width) {
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      extents[i] = x < across[i].low || x > across[i].high ? Interval{}
                   : round[i]                              ? round[i]->along_y(x)
                                                           : box_along_y(shapes[i], x);
      if (round[i]) sections[i] = RoundSection(*round[i], x);
    }
    integrate(extents, [&](double y, double depth) {
      std::size_t found = 0;
      for (std::size_t i = 0; i < shapes.size(); ++i) {
        if (y < extents[i].low || y > extents[i].high) continue;
        const Interval cut = round[i] ? sections[i].at(y) : cut_box(shapes[i], x, y);
        if (!cut.empty()) cuts[found++] = cut;
      }
      add_column(x, y, std::span(cuts).first(found), width * depth, sums);
    });
  });
  return properties(sums);
}

}  // namespace handsim::model
