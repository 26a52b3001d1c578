// How a mechanism's own code reaches into its lanes, whatever their width. Included by mechanism*.cpp only.
#pragma once

#include <cstddef>
#include <type_traits>
#include <vector>

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

/// Sizes of a tree's arrays, all lanes of positions and rates counted.
struct TreeSizes {
  std::size_t batches = 0, axes = 0, joints3 = 0, bases = 0, positions = 0, rates = 0;
};

/// A tree with its memory, all zero.
template <int W>
struct LaneTreeMemory : LaneTreeOf<W> {
  explicit LaneTreeMemory(const TreeSizes& of)
      : batches_(of.batches), axes_(of.axes), joints3_(of.joints3), bases_(of.bases) {
    this->batches = static_cast<int>(of.batches);
    this->positions = static_cast<int>(of.positions);
    this->rates = static_cast<int>(of.rates);
    this->batch = batches_.data();
    this->axis = axes_.data();
    this->joint3 = joints3_.data();
    this->base = bases_.data();
    double** const arrays[] = {&this->q, &this->u, &this->du, &this->tau, &this->spin};
    const std::size_t sizes[] = {of.positions, of.rates, of.rates, 2 * of.rates, W};
    for (std::size_t i = 0; i < std::size(sizes); ++i) {
      numbers_[i].resize((sizes[i] + 7) / 8);
      *arrays[i] = numbers_[i].empty() ? nullptr : numbers_[i][0].x;
    }
    this->tau_servo = this->tau + of.rates;
  }

 private:
  struct alignas(64) Line {
    double x[8];
  };
  std::vector<NodeBatch<W>> batches_;
  std::vector<Axis<W>> axes_;
  std::vector<Joint3<W>> joints3_;
  std::vector<Frame<W>> bases_;
  std::vector<Line> numbers_[5];
};

template <class F>
decltype(auto) Mechanism::in_lanes(const F& f) const {
  return of_width(kernel_->width, [&](auto w) { return f(lanes_of<w>(*tree_)); });
}

}  // namespace handsim::engine::articulated
