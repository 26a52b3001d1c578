// One name for what a double and a register of doubles do differently. Always inlined: calls use memory.
#pragma once

#include <cmath>
#include <experimental/simd>

namespace handsim::model {

namespace stdx = std::experimental;

template <class V>
[[gnu::always_inline]] inline V select(const typename V::mask_type& mask, const V& yes, const V& no) {
  V out = no;
  stdx::where(mask, out) = yes;
  return out;
}
[[gnu::always_inline]] inline double select(bool mask, double yes, double no) { return mask ? yes : no; }
template <class T, class A>
[[gnu::always_inline]] inline bool any(const stdx::simd_mask<T, A>& mask) {
  return stdx::any_of(mask);
}
[[gnu::always_inline]] inline bool any(bool mask) { return mask; }
template <class V>
[[gnu::always_inline]] inline V square_root(const V& x) {
  using std::sqrt;
  return sqrt(x);
}
template <class V>
[[gnu::always_inline]] inline V greater(const V& a, const V& b) {
  return select(a < b, b, a);
}
template <class V>
[[gnu::always_inline]] inline V smaller(const V& a, const V& b) {
  return select(b < a, b, a);
}

/// exp(y), |y| up to 5, to 2e-14 of it: Taylor's series at y / 32, squared five times. Equal bits everywhere.
template <class V>
[[gnu::always_inline]] inline V exponential(const V& y) {
  const V x = y * (1.0 / 32), s = x * x;
  V even = 1.0 / 3628800, odd = 1.0 / 362880;
  even = even * s + 1.0 / 40320;
  odd = odd * s + 1.0 / 5040;
  even = even * s + 1.0 / 720;
  odd = odd * s + 1.0 / 120;
  even = even * s + 1.0 / 24;
  odd = odd * s + 1.0 / 6;
  even = even * s + 0.5;
  odd = odd * s + 1.0;
  V out = 1.0 + (odd * x + even * s);
  for (int i = 0; i < 5; ++i) out = out * out;
  return out;
}

}  // namespace handsim::model
