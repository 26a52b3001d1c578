// Vectors and 3 x 3 blocks of any number type: a double, or a vector register with one double a lane.
#pragma once

#include <cmath>
#include <type_traits>

#include "handsim/model/lane_math.h"

// Inlined always: GCC passes registers of numbers through memory where it calls a function.

namespace handsim::engine::articulated {

using model::any, model::select, model::square_root;
namespace stdx = model::stdx;

template <class V>
struct V3 {
  V x, y, z;
};

template <class V>
[[gnu::always_inline]] inline V3<V> operator+(const V3<V>& a, const V3<V>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class V>
[[gnu::always_inline]] inline V3<V> operator-(const V3<V>& a, const V3<V>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class V>
[[gnu::always_inline]] inline V3<V> operator*(const V& s, const V3<V>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class V>
[[gnu::always_inline]] inline V dot(const V3<V>& a, const V3<V>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class V>
[[gnu::always_inline]] inline V3<V> cross(const V3<V>& a, const V3<V>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Spatial vector: angular part n, linear part f.
template <class V>
struct V6 {
  V3<V> n, f;
};

template <class V>
[[gnu::always_inline]] inline V6<V> operator+(const V6<V>& a, const V6<V>& b) {
  return {a.n + b.n, a.f + b.f};
}
template <class V>
[[gnu::always_inline]] inline V6<V> operator*(const V& s, const V6<V>& a) {
  return {s * a.n, s * a.f};
}
template <class V>
[[gnu::always_inline]] inline V dot(const V6<V>& a, const V6<V>& b) {
  return dot(a.n, b.n) + dot(a.f, b.f);
}

/// Symmetric 3 x 3.
template <class V>
struct Sym3 {
  V xx, xy, xz, yy, yz, zz;
};
template <class V>
[[gnu::always_inline]] inline V3<V> operator*(const Sym3<V>& m, const V3<V>& a) {
  return {m.xx * a.x + m.xy * a.y + m.xz * a.z, m.xy * a.x + m.yy * a.y + m.yz * a.z,
          m.xz * a.x + m.yz * a.y + m.zz * a.z};
}
template <class V>
[[gnu::always_inline]] inline Sym3<V> operator+(const Sym3<V>& a, const Sym3<V>& b) {
  return {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz};
}
/// m - s a a^T.
template <class V>
[[gnu::always_inline]] inline Sym3<V> less(const Sym3<V>& m, const V& s, const V3<V>& a) {
  const V3<V> b = s * a;
  return {m.xx - b.x * a.x, m.xy - b.x * a.y, m.xz - b.x * a.z,
          m.yy - b.y * a.y, m.yz - b.y * a.z, m.zz - b.z * a.z};
}

/// Any 3 x 3, by rows.
template <class V>
struct Mat {
  V3<V> r0, r1, r2;
};
template <class V>
[[gnu::always_inline]] inline V3<V> operator*(const Mat<V>& m, const V3<V>& a) {
  return {dot(m.r0, a), dot(m.r1, a), dot(m.r2, a)};
}
template <class V>
[[gnu::always_inline]] inline V3<V> transposed_times(const Mat<V>& m, const V3<V>& a) {
  return a.x * m.r0 + a.y * m.r1 + a.z * m.r2;
}
/// m - s a b^T.
template <class V>
[[gnu::always_inline]] inline Mat<V> less(const Mat<V>& m, const V& s, const V3<V>& a, const V3<V>& b) {
  const V3<V> c = s * a;
  return {m.r0 - c.x * b, m.r1 - c.y * b, m.r2 - c.z * b};
}

template <class V>
struct Q4 {
  V x, y, z, w;
};
template <class V>
[[gnu::always_inline]] inline Q4<V> operator*(const Q4<V>& a, const Q4<V>& b) {
  return {a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
          a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}
template <class V>
[[gnu::always_inline]] inline Mat<V> rotation(const Q4<V>& q) {
  const V x2 = q.x + q.x, y2 = q.y + q.y, z2 = q.z + q.z, one = 1.0;
  const V xx = x2 * q.x, yy = y2 * q.y, zz = z2 * q.z, xy = x2 * q.y, xz = x2 * q.z, yz = y2 * q.z;
  const V wx = x2 * q.w, wy = y2 * q.w, wz = z2 * q.w;
  return {{one - (yy + zz), xy - wz, xz + wy},
          {xy + wz, one - (xx + zz), yz - wx},
          {xz - wy, yz + wx, one - (xx + yy)}};
}

/// Inertia (Featherstone 2008, eq. 2.63, p. 33; section 7.1, p. 119): n = A w + B v, f = B^T w + C v.
template <class V>
struct Inertia {
  Sym3<V> A;
  Mat<V> B;
  Sym3<V> C;
};
template <class V>
[[gnu::always_inline]] inline V6<V> operator*(const Inertia<V>& I, const V6<V>& v) {
  return {I.A * v.n + I.B * v.f, transposed_times(I.B, v.n) + I.C * v.f};
}

/// Nearest whole number, for numbers far below 2^51.
template <class V>
[[gnu::always_inline]] inline V rounded(const V& x) {
  const V magic = 6755399441055744.0;
  return (x + magic) - magic;
}

/// Sine and cosine, to 3e-16 for |x| up to 1e5: x less the nearest multiple of pi (in three parts, Cody &
/// Waite 1980), then Taylor's series to below half a last place. The same bits on every machine.
template <class V>
[[gnu::always_inline]] inline void sine_cosine(const V& x, V& sine, V& cosine) {
  const V n = rounded(V(x * 0.31830988618379067154));
  V r = x - n * (4 * 7.85398125648498535156e-1);
  r = r - n * (4 * 3.77489470793079817668e-8);
  r = r - n * (4 * 2.69515142907905952645e-15);
  const V half = n * 0.5;
  const V odd = half - rounded(half);
  const V sign = V(1.0) - 8.0 * odd * odd;
  const V z = r * r;
  V s = 1.9572941063391261e-20;
  s = s * z - 8.2206352466243297e-18;
  s = s * z + 2.8114572543455206e-15;
  s = s * z - 7.6471637318198165e-13;
  s = s * z + 1.6059043836821613e-10;
  s = s * z - 2.5052108385441719e-08;
  s = s * z + 2.7557319223985893e-06;
  s = s * z - 1.9841269841269841e-04;
  s = s * z + 8.3333333333333333e-03;
  s = s * z - 1.6666666666666667e-01;
  V c = 4.1103176233121649e-19;
  c = c * z - 1.5619206968586226e-16;
  c = c * z + 4.7794773323873853e-14;
  c = c * z - 1.1470745597729725e-11;
  c = c * z + 2.0876756987868099e-09;
  c = c * z - 2.7557319223985891e-07;
  c = c * z + 2.4801587301587302e-05;
  c = c * z - 1.3888888888888889e-03;
  c = c * z + 4.1666666666666667e-02;
  c = c * z - 0.5;
  sine = sign * (r + r * z * s);
  cosine = sign * (1.0 + z * c);
}

}  // namespace handsim::engine::articulated
