// Three numbers in registers, for inner loops. Eigen takes two of a Vec3's numbers at a time, and loading a
// pair that was stored one by one, as each cross product is, waits for memory; its rotation by a quaternion
// stays a call of its own.
#pragma once

#include "handsim/core/pose.h"

namespace handsim {

struct Triple {
  double x = 0, y = 0, z = 0;

  Triple() = default;
  Triple(double of_x, double of_y, double of_z) : x(of_x), y(of_y), z(of_z) {}
  Triple(const Vec3& v) : x(v.x()), y(v.y()), z(v.z()) {}
  explicit Triple(const double* first) : x(first[0]), y(first[1]), z(first[2]) {}
  operator Vec3() const { return {x, y, z}; }

  Triple operator+(const Triple& b) const { return {x + b.x, y + b.y, z + b.z}; }
  Triple operator-(const Triple& b) const { return {x - b.x, y - b.y, z - b.z}; }
  friend Triple operator*(double s, const Triple& a) { return {s * a.x, s * a.y, s * a.z}; }
  Triple cross(const Triple& b) const { return {y * b.z - z * b.y, z * b.x - x * b.z, x * b.y - y * b.x}; }
  void store(double* to) const {
    to[0] = x;
    to[1] = y;
    to[2] = z;
  }
};

/// q * v, to the bit.
[[gnu::always_inline]] inline Triple rotate(const Quat& q, const Triple& v) {
  const Triple vec(q.x(), q.y(), q.z()), once = vec.cross(v), twice = once + once;
  return v + q.w() * twice + vec.cross(twice);
}
/// q.conjugate() * v, to the bit.
[[gnu::always_inline]] inline Triple rotate_back(const Quat& q, const Triple& v) {
  return rotate(q.conjugate(), v);
}

}  // namespace handsim
