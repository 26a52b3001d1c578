// Short rows of numbers, two at a time: the inner loops of the contact solver. The order of each sum is
// fixed, so that every processor has the same bits.
#pragma once

#include <Eigen/Core>

namespace handsim::engine::articulated {

using Pair = Eigen::Vector2d;

inline Pair load(const double* x) { return Eigen::Map<const Pair>(x); }
inline void store(double* to, const Pair& x) { Eigen::Map<Pair>{to} = x; }

/// to -= s x.
inline void subtract(double* to, const double* x, double s, int n) {
  int i = 0;
  for (; i + 2 <= n; i += 2) store(to + i, load(to + i) - s * load(x + i));
  if (i < n) to[i] -= s * x[i];
}

/// to -= s[0] x + s[1] y + s[2] z.
inline void subtract(double* to, const double* x, const double* y, const double* z, const double* s, int n) {
  int i = 0;
  for (; i + 2 <= n; i += 2)
    store(to + i, load(to + i) - (s[0] * load(x + i) + s[1] * load(y + i) + s[2] * load(z + i)));
  if (i < n) to[i] -= s[0] * x[i] + s[1] * y[i] + s[2] * z[i];
}

/// The motions of n axes, by rows: three of angular velocities, then three of velocities at an origin.
struct AxisRows {
  const double* first = nullptr;
  std::size_t stride = 0;
  const double* row(std::size_t k, int i) const { return first + k * stride + i; }
};

/// Velocities of a point r from the origin along the three directions of `frame` (columns), into rows m
/// apart.
inline void point_rows(double* to, std::size_t m, const AxisRows& axes, const double* r, const double* frame,
                       int n) {
  const auto put = [&](int i, const auto& read, const auto& write) {
    const auto wx = read(axes.row(0, i)), wy = read(axes.row(1, i)), wz = read(axes.row(2, i));
    const decltype(wx) x = read(axes.row(3, i)) + (wy * r[2] - wz * r[1]),
                       y = read(axes.row(4, i)) + (wz * r[0] - wx * r[2]),
                       z = read(axes.row(5, i)) + (wx * r[1] - wy * r[0]);
    for (std::size_t k = 0; k < 3; ++k)
      write(to + k * m + i, decltype(wx)(x * frame[3 * k] + y * frame[3 * k + 1] + z * frame[3 * k + 2]));
  };
  int i = 0;
  for (; i + 2 <= n; i += 2) put(i, load, store);
  if (i < n)
    put(
        i, [](const double* x) { return *x; }, [](double* at, double x) { *at = x; });
}

inline double dot(const double* x, const double* y, int n) {
  Pair sum = Pair::Zero();
  int i = 0;
  for (; i + 2 <= n; i += 2) sum += load(x + i).cwiseProduct(load(y + i));
  const double both = sum[0] + sum[1];
  return i < n ? both + x[i] * y[i] : both;
}

}  // namespace handsim::engine::articulated
