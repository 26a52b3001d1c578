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

inline double dot(const double* x, const double* y, int n) {
  Pair sum = Pair::Zero();
  int i = 0;
  for (; i + 2 <= n; i += 2) sum += load(x + i).cwiseProduct(load(y + i));
  const double both = sum[0] + sum[1];
  return i < n ? both + x[i] * y[i] : both;
}

}  // namespace handsim::engine::articulated
