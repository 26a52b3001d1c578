#include "handsim/model/compliance.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace handsim::model {

namespace {

/// An exponential goes on straight from here [rises]: a depth that no pad bears has a force that is a number.
constexpr double kStraightFrom = 40;
/// Force by which the depths of two surfaces in series are told apart [N]: logarithms above, sizes below.
constexpr double kSmallForce = 1e-2;
constexpr int kMostSteps = 60;
constexpr double kExact = 1e-15;

using Point = ForceCurve::Point;

/// The cubic through two points with their slopes.
Elastic between(const Point& a, const Point& b, double depth) {
  const double width = b.depth - a.depth, s = (depth - a.depth) / width, left = 1 - s;
  const double force = a.force * left * left * (1 + 2 * s) + b.force * s * s * (1 + 2 * left) +
                       width * s * left * (a.slope * left - b.slope * s);
  const double slope =
      6 * s * left * (b.force - a.force) / width + a.slope * left * (1 - 3 * s) + b.slope * s * (3 * s - 2);
  return {force, slope};
}

/// Of a surface alone, by its size.
Elastic scaled(const ForceCurve& curve, double size, double depth) {
  const Elastic unit = curve.at(depth / size);
  return {size * size * unit.force, size * unit.slope};
}

double scaled_depth(const ForceCurve& curve, double size, double force) {
  return size * curve.depth_of(force / (size * size));
}

/// Where a rising function is zero: Newton's method in a bracket. @param f value and slope
template <class F>
double zero_of(const F& f, double low, double high, double start) {
  double x = start;
  for (int i = 0; i < kMostSteps; ++i) {
    const Elastic here = f(x);
    (here.force > 0 ? high : low) = x;
    double next = x - here.force / here.slope;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    const double change = std::abs(next - x);
    x = next;
    if (change <= kExact * std::abs(x)) break;
  }
  return x;
}

/// Two surfaces with one force whose depths add up to `depth`.
template <class First, class Second>
Elastic together(const First& first, const Second& second, double depth) {
  const auto both = [](const Elastic& a, const Elastic& b) {
    return Elastic{a.force, a.slope * b.slope / (a.slope + b.slope)};
  };
  if (!(depth > 0)) {
    const Elastic sum = both(first(0), second(0));
    return {sum.slope * depth, sum.slope};
  }
  // In logarithms both sides are nearly straight.
  const auto difference = [&](double x) {
    const Elastic a = first(x), b = second(depth - x);
    return Elastic{std::log1p(a.force / kSmallForce) - std::log1p(b.force / kSmallForce),
                   a.slope / (kSmallForce + a.force) + b.slope / (kSmallForce + b.force)};
  };
  const double x = zero_of(difference, 0, depth, 0.5 * depth);
  return both(first(x), second(depth - x));
}

}  // namespace

ForceCurve ForceCurve::spring(double stiffness) {
  ForceCurve out;
  out.stiffness = stiffness;
  return out;
}

ForceCurve ForceCurve::exponential(double force, double depth) {
  ForceCurve out;
  out.kind = Kind::exponential;
  out.force = force;
  out.rise = depth;
  return out;
}

ForceCurve ForceCurve::table(std::vector<Point> points) {
  ForceCurve out;
  out.kind = Kind::table;
  points.insert(points.begin(), Point{});
  const std::size_t last = points.size() - 1;
  const auto width = [&](std::size_t i) { return points[i + 1].depth - points[i].depth; };
  const auto secant = [&](std::size_t i) { return (points[i + 1].force - points[i].force) / width(i); };
  points[0].slope = secant(0);
  points[last].slope = secant(last - 1);
  for (std::size_t i = 1; i < last; ++i) {
    // The harmonic mean, weighted by the widths, keeps each piece monotone.
    const double third = (width(i - 1) + 2 * width(i)) / (3 * (width(i - 1) + width(i)));
    points[i].slope = 1 / (third / secant(i) + (1 - third) / secant(i - 1));
  }
  for (std::size_t i = 0; i < last; ++i)
    if (points[i + 1].slope > points[i].slope)
      out.rise = std::min(out.rise, width(i) / std::log(points[i + 1].slope / points[i].slope));
  out.points = std::move(points);
  return out;
}

Elastic ForceCurve::at(double depth) const {
  switch (kind) {
    case Kind::spring:
      return {stiffness * depth, stiffness};
    case Kind::exponential: {
      const double first = force / rise, rises = depth / rise;
      if (rises < 0) return {first * depth, first};
      const double within = std::min(rises, kStraightFrom), grown = std::exp(within);
      return {force * (std::expm1(within) + grown * (rises - within)), first * grown};
    }
    case Kind::table: {
      const Point &first = points.front(), &last = points.back();
      if (depth < 0) return {first.slope * depth, first.slope};
      if (depth >= last.depth) return {last.force + last.slope * (depth - last.depth), last.slope};
      const auto next = std::ranges::upper_bound(points, depth, {}, &Point::depth);
      return between(*std::prev(next), *next, depth);
    }
  }
  return {};
}

double ForceCurve::depth_of(double wanted) const {
  switch (kind) {
    case Kind::spring:
      return wanted / stiffness;
    case Kind::exponential: {
      if (wanted < 0) return wanted * rise / force;
      const double grown = std::exp(kStraightFrom), straight = force * std::expm1(kStraightFrom);
      if (wanted > straight) return rise * (kStraightFrom + (wanted - straight) / (force * grown));
      return rise * std::log1p(wanted / force);
    }
    case Kind::table: {
      const Point &first = points.front(), &last = points.back();
      if (wanted < 0) return wanted / first.slope;
      if (wanted >= last.force) return last.depth + (wanted - last.force) / last.slope;
      const auto next = std::ranges::upper_bound(points, wanted, {}, &Point::force);
      const Point &a = *std::prev(next), &b = *next;
      const auto beyond = [&](double depth) {
        const Elastic here = between(a, b, depth);
        return Elastic{here.force - wanted, here.slope};
      };
      return zero_of(beyond, a.depth, b.depth, 0.5 * (a.depth + b.depth));
    }
  }
  return 0;
}

double PadLaw::lasting() const {
  double out = 1;
  for (const Relaxation& each : relaxations) out -= each.share;
  return out;
}

Elastic Compliance::elastic(double depth) const {
  if (!law) return {stiffness * depth, stiffness};
  const auto own = [&](double d) { return scaled(law->curve, size, d); };
  if (under)
    return together(
        own, [&](double d) { return scaled(under->curve, under_size, d); }, depth);
  if (stiffness > 0)
    return together(
        own,
        [&](double d) {
          return Elastic{stiffness * d, stiffness};
        },
        depth);
  return own(depth);
}

double Compliance::depth_of(double force) const {
  if (!law) return force / stiffness;
  double out = scaled_depth(law->curve, size, force);
  if (under) out += scaled_depth(under->curve, under_size, force);
  if (stiffness > 0) out += force / stiffness;
  return out;
}

double Compliance::secant(double force) const {
  return law ? force / depth_of(force / lasting()) : stiffness;
}

double Compliance::rise() const {
  if (!law) return std::numeric_limits<double>::infinity();
  return under ? std::max(size * law->curve.rise, under_size * under->curve.rise) : size * law->curve.rise;
}

double Compliance::contact_radius(double depth) const { return std::sqrt(2 * radius * std::max(depth, 0.0)); }

double in_series(double a, double b) { return a > 0 && b > 0 ? a * b / (a + b) : a + b; }

Compliance in_series(const Compliance& a, const Compliance& b) {
  if (!a.law && b.law) return in_series(b, a);
  Compliance out = a;
  out.damping = in_series(a.damping, b.damping);
  out.radius = in_series(a.radius, b.radius);
  if (b.law) {
    out.under = b.law;
    out.under_size = b.size;
  } else {
    out.stiffness = a.law ? b.stiffness : in_series(a.stiffness, b.stiffness);
  }
  return out;
}

}  // namespace handsim::model
