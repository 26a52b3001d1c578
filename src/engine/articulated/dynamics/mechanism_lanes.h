// How a mechanism's own code reaches into its lanes, whatever their width. Included by mechanism*.cpp only.
#pragma once

#include <cstddef>
#include <type_traits>

#include "handsim/engine/articulated/dynamics/mechanism.h"

namespace handsim::engine::articulated {

inline bool single(NodeKind kind) { return kind == NodeKind::revolute || kind == NodeKind::prismatic; }

template <int W>
void put3(Lane<W>* to, int lane, const Vec3& v) {
  for (int i = 0; i < 3; ++i) to[i][lane] = v[i];
}
template <int W>
void put4(Lane<W>* to, int lane, const Quat& q) {
  for (int i = 0; i < 4; ++i) to[i][lane] = q.coeffs()[i];
}
template <int W>
Vec3 get3(const Lane<W>* from, int lane) {
  return {from[0][lane], from[1][lane], from[2][lane]};
}
template <int W>
Quat get4(const Lane<W>* from, int lane) {
  return {from[3][lane], from[0][lane], from[1][lane], from[2][lane]};
}

/// Calls f with the width as a compile-time number.
template <class F>
decltype(auto) of_width(int width, F&& f) {
  switch (width) {
    case 2:
      return f(std::integral_constant<int, 2>());
    case 4:
      return f(std::integral_constant<int, 4>());
    case 8:
      return f(std::integral_constant<int, 8>());
    default:
      return f(std::integral_constant<int, 1>());
  }
}

/// Typed views of a mechanism of width W.
template <int W>
struct Mechanism::In {
  explicit In(const Mechanism& m)
      : batch(static_cast<Batch<W>*>(m.tree_.batch)),
        axis(static_cast<Axis<W>*>(m.tree_.axis)),
        joint3(static_cast<Joint3<W>*>(m.tree_.joint3)),
        base(static_cast<Frame<W>*>(m.tree_.base)) {}
  static constexpr int kWidth = W;
  Batch<W>* batch;
  Axis<W>* axis;
  Joint3<W>* joint3;
  Frame<W>* base;

  static void empty(Batch<W>& b) {
    for (int lane = 0; lane < W; ++lane) {
      put4<W>(b.before, lane, Quat::Identity());
      put4<W>(b.turned, lane, Quat(0, 0, 0, 1));
      put3<W>(b.direction, lane, Vec3::UnitZ());
      b.mass[lane] = 1;
      put3<W>(b.inertia, lane, Vec3::Ones());
    }
  }
  static void fill(Batch<W>& b, int lane, const Node& node) {
    put4<W>(b.before, lane, node.before);
    put4<W>(b.turned, lane, node.turned);
    put3<W>(b.direction, lane, node.axis);
    put3<W>(b.anchor, lane, node.anchor);
    put3<W>(b.arm, lane, node.arm);
    b.mass[lane] = node.mass;
    put3<W>(b.inertia, lane, node.inertia);
  }
  static void fill(Axis<W>& a, int lane, const model::JointAxis& axis, const model::Effects& effects) {
    a.present[lane] = 1;
    if (axis.stop && effects.has(model::Effect::joint_stops)) {
      a.low[lane] = axis.stop->low;
      a.high[lane] = axis.stop->high;
      a.restitution[lane] = axis.stop->restitution;
    }
    if (axis.tissue && effects.has(model::Effect::passive_tissue)) {
      a.stiffness[lane] = axis.tissue->stiffness;
      a.damping[lane] = axis.tissue->damping;
      a.rest[lane] = axis.tissue->rest;
    }
  }
};

template <class F>
decltype(auto) Mechanism::in_lanes(const F& f) const {
  return of_width(kernel_->width, [&](auto w) { return f(In<w>(*this)); });
}

}  // namespace handsim::engine::articulated
