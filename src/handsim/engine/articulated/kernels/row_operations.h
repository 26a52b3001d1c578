// The inner loops of the contact solver (row_kernel.h), four or two numbers at a time. Included by the
// kernel_*.cpp files only; `Number`, the widest of the instruction set, keeps what each builds apart.
#pragma once

#include <cmath>

#include "handsim/engine/articulated/kernels/row_kernel.h"
#include "handsim/engine/articulated/kernels/spatial.h"

namespace handsim::engine::articulated {

template <class Number>
struct RowOperations {
  static constexpr int W = Number::size() >= 4 ? 4 : 2;
  using V = stdx::resize_simd_t<W, Number>;
  using Two = stdx::resize_simd_t<2, Number>;

  template <class T = V>
  static T load(const double* x) {
    return T(x, stdx::element_aligned);
  }
  template <class T>
  static void store(double* to, const T& x) {
    x.copy_to(to, stdx::element_aligned);
  }
  /// Calls f with the type of the numbers taken at a time, and the first of them.
  template <class F>
  static void each(int n, const F& f) {
    int i = 0;
    for (; i + W <= n; i += W) f(V(), i);
    if constexpr (W > 2)
      if (i + 2 <= n) {
        f(Two(), i);
        i += 2;
      }
    if (i < n) f(double(), i);
  }
  template <class T>
  static T get(const double* x) {
    if constexpr (std::is_same_v<T, double>)
      return *x;
    else
      return load<T>(x);
  }
  template <class T>
  static void put(double* to, const T& x) {
    if constexpr (std::is_same_v<T, double>)
      *to = x;
    else
      store(to, x);
  }

  /// to -= s x.
  static void subtract(double* to, const double* x, double s, int n) {
    each(n, [&](auto kind, int i) {
      using T = decltype(kind);
      put<T>(to + i, get<T>(to + i) - T(s) * get<T>(x + i));
    });
  }
  /// Even and odd terms are summed apart.
  static double dot(const double* x, const double* y, int n) {
    Two sum = 0;
    int i = 0;
    if constexpr (W > 2)
      for (; i + W <= n; i += W) {
        const auto [low, high] = stdx::split<2, 2>(load(x + i) * load(y + i));
        sum += low;
        sum += high;
      }
    for (; i + 2 <= n; i += 2) sum += load<Two>(x + i) * load<Two>(y + i);
    const double both = sum[0] + sum[1];
    return i < n ? both + x[i] * y[i] : both;
  }

  static void factor(const Factor& f) {
    for (std::size_t c = 0; c < f.chain_count; ++c) {
      const Run own = f.chains[c].own;
      const Run *later = f.runs + f.chains[c].first_run, *end = later + f.chains[c].run_count;
      for (int k = own.first; k < own.end; ++k) {
        double* row = f.M.row(k);
        const double inverse = 1 / std::sqrt(row[k]);
        row[k] = inverse;
        const auto scale = [&](int first, int count) {
          each(count, [&](auto kind, int i) {
            using T = decltype(kind);
            put<T>(row + first + i, get<T>(row + first + i) * T(inverse));
          });
        };
        scale(k + 1, own.end - k - 1);
        for (const Run* run = later; run != end; ++run) scale(run->first, run->size());
        for (int i = k + 1; i < own.end; ++i) {
          double* to = f.M.row(i);
          subtract(to + i, row + i, row[i], own.end - i);
          for (const Run* run = later; run != end; ++run)
            subtract(to + run->first, row + run->first, row[i], run->size());
        }
        for (const Run* of = later; of != end; ++of)
          for (int i = of->first; i < of->end; ++i) {
            double* to = f.M.row(i);
            subtract(to + i, row + i, row[i], of->end - i);
            for (const Run* run = of + 1; run != end; ++run)
              subtract(to + run->first, row + run->first, row[i], run->size());
          }
      }
    }
  }

  static void eliminate(const Factor& f, double* x, std::size_t first_chain, std::size_t end) {
    for (std::size_t c = first_chain; c < end; ++c) {
      const Chain& chain = f.chains[c];
      for (int k = chain.own.first; k < chain.own.end; ++k) {
        const double* row = f.M.row(k);
        x[k] *= row[k];
        if (x[k] == 0) continue;
        subtract(x + k + 1, row + k + 1, x[k], chain.own.end - k - 1);
        const Run* run = f.runs + chain.first_run;
        for (std::size_t r = 0; r < chain.run_count; ++r, ++run)
          subtract(x + run->first, row + run->first, x[k], run->size());
      }
    }
  }

  static void substitute_back(const Factor& f, double* x, std::size_t first_chain, std::size_t end) {
    for (std::size_t c = end; c-- > first_chain;) {
      const Chain& chain = f.chains[c];
      for (int k = chain.own.end - 1; k >= chain.own.first; --k) {
        const double* row = f.M.row(k);
        double sum = dot(row + k + 1, x + k + 1, chain.own.end - k - 1);
        const Run* run = f.runs + chain.first_run;
        for (std::size_t r = 0; r < chain.run_count; ++r, ++run)
          sum += dot(row + run->first, x + run->first, run->size());
        x[k] = (x[k] - sum) * row[k];
      }
    }
  }

  static void eliminate_coupling(const Factor& f, const Coupling& coupling) {
    const std::size_t m = coupling.columns;
    for (std::size_t c = 0; c < f.chain_count; ++c) {
      const Run range = coupling.ranges[c];
      if (range.size() == 0) continue;
      const Chain& chain = f.chains[c];
      double *C = coupling.C + range.first, *G = coupling.G + range.first;
      for (int k = chain.own.first; k < chain.own.end; ++k) {
        const double* row = f.M.row(k);
        const std::size_t from = static_cast<std::size_t>(k) * m;
        each(range.size(), [&](auto kind, int i) {
          using T = decltype(kind);
          for (double* x : {C + from + i, G + from + i}) put<T>(x, get<T>(x) * T(row[k]));
        });
        const auto subtract_run = [&](int first, int end) {
          for (int j = first; j < end; ++j) {
            const std::size_t to = static_cast<std::size_t>(j) * m;
            subtract(C + to, C + from, row[j], range.size());
            subtract(G + to, G + from, row[j], range.size());
          }
        };
        subtract_run(k + 1, chain.own.end);
        const Run* run = f.runs + chain.first_run;
        for (std::size_t r = 0; r < chain.run_count; ++r, ++run) subtract_run(run->first, run->end);
      }
    }
  }

  /// Calls f with each row that has entries of C and G, and the range of these.
  template <class F>
  static void each_coupled(const Factor& f, const Coupling& coupling, const F& use) {
    for (std::size_t c = 0; c < f.chain_count; ++c) {
      const Run range = coupling.ranges[c], own = f.chains[c].own;
      if (range.size() > 0)
        for (int k = own.first; k < own.end; ++k) use(k, range);
    }
  }

  static void factor_coupling(const Factor& f, const Coupling& coupling) {
    const std::size_t m = coupling.columns;
    const auto row = [&](std::size_t i) { return coupling.K + i * m; };
    for (std::size_t i = 0; i < m * m; ++i) coupling.K[i] = 0;
    for (std::size_t i = 0; i < m; ++i) row(i)[i] = 1;
    each_coupled(f, coupling, [&](int k, const Run& range) {
      const std::size_t from = static_cast<std::size_t>(k) * m;
      const double *C = coupling.C + from, *G = coupling.G + from;
      for (int i = range.first; i < range.end; ++i)
        subtract(row(static_cast<std::size_t>(i)) + range.first, C + range.first, G[i], range.size());
    });
    // Gaussian elimination with row exchanges.
    for (std::size_t k = 0; k < m; ++k) {
      std::size_t pivot = k;
      for (std::size_t i = k + 1; i < m; ++i)
        if (std::abs(row(i)[k]) > std::abs(row(pivot)[k])) pivot = i;
      coupling.pivots[k] = pivot;
      double* from = row(k);
      if (pivot != k)
        for (std::size_t j = 0; j < m; ++j) exchange(from[j], row(pivot)[j]);
      const double inverse = 1 / from[k];
      for (std::size_t i = k + 1; i < m; ++i) {
        double* to = row(i);
        to[k] *= inverse;
        subtract(to + k + 1, from + k + 1, to[k], static_cast<int>(m - k) - 1);
      }
    }
  }
  static void exchange(double& a, double& b) {
    const double kept = a;
    a = b;
    b = kept;
  }

  static void apply_coupling(const Factor& f, const Coupling& coupling, double* d) {
    const std::size_t m = coupling.columns;
    double* h = coupling.h;
    for (std::size_t i = 0; i < m; ++i) h[i] = 0;
    each_coupled(f, coupling, [&](int k, const Run& range) {
      const double* G = coupling.G + static_cast<std::size_t>(k) * m;
      subtract(h + range.first, G + range.first, -d[k], range.size());
    });
    for (std::size_t k = 0; k < m; ++k) exchange(h[k], h[coupling.pivots[k]]);
    for (std::size_t k = 1; k < m; ++k) h[k] -= dot(coupling.K + k * m, h, static_cast<int>(k));
    for (std::size_t k = m; k-- > 0;) {
      const double* row = coupling.K + k * m;
      h[k] = (h[k] - dot(row + k + 1, h + k + 1, static_cast<int>(m - k) - 1)) / row[k];
    }
    each_coupled(f, coupling, [&](int k, const Run& range) {
      const double* C = coupling.C + static_cast<std::size_t>(k) * m;
      d[k] += dot(C + range.first, h + range.first, range.size());
    });
  }

  template <std::size_t N>
  static void add_rows(const Triangle& M, const RowBlock& block, double normal,
                       const std::array<double, 3>& D) {
    const Run* end = block.runs + block.run_count;
    std::array<const double*, N> J;
    for (std::size_t k = 0; k < N; ++k) J[k] = block.J + k * block.stride;
    std::size_t own = 0;
    for (const Run* of = block.runs; of != end; ++of)
      for (int i = of->first; i < of->end; ++i, ++own) {
        std::array<double, N> s;
        if constexpr (N == 1) {
          s[0] = D[0] * J[0][own];
        } else {
          const double x = J[N - 2][own], y = J[N - 1][own];
          s[N - 2] = D[0] * x + D[1] * y;
          s[N - 1] = D[1] * x + D[2] * y;
          if constexpr (N == 3) s[0] = normal * J[0][own];
        }
        const auto add = [&](double* to, std::size_t from, int count) {
          each(count, [&](auto kind, int j) {
            using T = decltype(kind);
            T sum = T(s[0]) * get<T>(J[0] + from + j);
            for (std::size_t k = 1; k < N; ++k) sum += T(s[k]) * get<T>(J[k] + from + j);
            put<T>(to + j, get<T>(to + j) + sum);
          });
        };
        double* to = M.row(i);
        add(to + i, own, of->end - i);
        std::size_t from = own + static_cast<std::size_t>(of->end - i);
        for (const Run* run = of + 1; run != end; ++run) {
          add(to + run->first, from, run->size());
          from += static_cast<std::size_t>(run->size());
        }
      }
  }
  static void add_stiffness(const Triangle& M, const RowBlock& block, double normal,
                            const std::array<double, 3>& D) {
    if (block.rows == 1) return add_rows<1>(M, block, normal, D);
    if (block.rows == 2) return add_rows<2>(M, block, normal, D);
    add_rows<3>(M, block, normal, D);
  }

  static void multiply(const RowBlock& block, const double* x, double* out) {
    for (std::size_t k = 0; k < block.rows; ++k) out[k] = 0;
    const double* J = block.J;
    for (const Run* run = block.runs; run != block.runs + block.run_count; ++run) {
      for (std::size_t k = 0; k < block.rows; ++k)
        out[k] += dot(J + k * block.stride, x + run->first, run->size());
      J += run->size();
    }
  }

  static void subtract_transposed(const RowBlock& block, const double* p, double* to) {
    const double* J = block.J;
    for (const Run* run = block.runs; run != block.runs + block.run_count; ++run) {
      const double *x = J, *y = J + block.stride, *z = y + block.stride;
      if (block.rows == 3)
        each(run->size(), [&](auto kind, int i) {
          using T = decltype(kind);
          double* at = to + run->first + i;
          put<T>(at,
                 get<T>(at) - (T(p[0]) * get<T>(x + i) + T(p[1]) * get<T>(y + i) + T(p[2]) * get<T>(z + i)));
        });
      else
        for (std::size_t k = 0; k < block.rows; ++k)
          subtract(to + run->first, J + k * block.stride, p[k], run->size());
      J += run->size();
    }
  }

  static void add_product(const Triangle& A, const int* last, int n, const double* x, double* to) {
    for (int i = 0; i < n; ++i) {
      const double* row = A.row(i);
      const int rest = last[i] - i;
      to[i] += row[i] * x[i] + dot(row + i + 1, x + i + 1, rest);
      subtract(to + i + 1, row + i + 1, -x[i], rest);
    }
  }

  /// Calls f with the type of the numbers taken at a time and each place in a motion or wrench.
  template <class F>
  static void each_of_spatial(const F& f) {
    for (std::size_t i = 0; i < kSpatial; i += W) f(V(), i);
  }
  /// The halves are added, then even and odd places.
  static double dot_spatial(const double* x, const double* y) {
    if constexpr (W > 2) {
      const auto [low, high] = stdx::split<2, 2>(load(x) * load(y) + load(x + 4) * load(y + 4));
      const Two sum = low + high;
      return sum[0] + sum[1];
    } else {
      const auto term = [&](std::size_t i) { return load(x + i) * load(y + i); };
      const V sum = (term(0) + term(4)) + (term(2) + term(6));
      return sum[0] + sum[1];
    }
  }
  static double* spatial(double* all, int i) { return all + kSpatial * static_cast<std::size_t>(i); }
  static const double* spatial(const double* all, int i) {
    return all + kSpatial * static_cast<std::size_t>(i);
  }

  static void compute_motions(const double* S, const int* parent, int n, const double* x, double* motions) {
    each_of_spatial([&](auto kind, std::size_t k) { store(spatial(motions, n) + k, decltype(kind)(0)); });
    for (int i = n - 1; i >= 0; --i)
      each_of_spatial([&](auto kind, std::size_t k) {
        using T = decltype(kind);
        store(spatial(motions, i) + k,
              load(spatial(motions, parent[i]) + k) + T(x[i]) * load(spatial(S, i) + k));
      });
  }
  static void subtract_wrenches(const double* S, const int* parent, int n, double* wrenches, double* to) {
    for (int i = 0; i < n; ++i) {
      to[i] -= dot_spatial(spatial(S, i), spatial(wrenches, i));
      double* up = spatial(wrenches, parent[i]);
      each_of_spatial(
          [&](auto, std::size_t k) { store(up + k, load(up + k) + load(spatial(wrenches, i) + k)); });
    }
  }
  static void project(const double* G, std::size_t rows, const double* motion, double* out) {
    for (std::size_t k = 0; k < rows; ++k) out[k] = dot_spatial(G + kSpatial * k, motion);
  }
  static void add_wrenches(const double* G, std::size_t rows, const double* p, double* wrench) {
    for (std::size_t k = 0; k < rows; ++k)
      each_of_spatial([&](auto kind, std::size_t i) {
        using T = decltype(kind);
        store(wrench + i, load(wrench + i) + T(p[k]) * load(G + kSpatial * k + i));
      });
  }

  static constexpr RowKernel kernel() {
    return {factor,          eliminate,         substitute_back, eliminate_coupling,  factor_coupling,
            apply_coupling,  add_stiffness,     multiply,        subtract_transposed, add_product,
            compute_motions, subtract_wrenches, project,         add_wrenches};
  }
};

}  // namespace handsim::engine::articulated
