// The recursive algorithms in lanes: written for any number type V, built for each instruction set in a file
// of its own. Notation of Featherstone 2008; body-fixed steps in world axes about O, so that X is the
// identity. Included by the kernel_*.cpp files only; kernel.h has the algorithms.
#pragma once

#include <cstddef>
#include <type_traits>

#include "handsim/engine/articulated/kernels/lane_tree.h"
#include "handsim/engine/articulated/kernels/spatial.h"
#include "handsim/model/actuation.h"

namespace handsim::engine::articulated {

template <class V>
struct Lanes {
  // Wide, as it multiplies pointer offsets; named as in lane_tree.h.
  // NOLINTNEXTLINE(readability-identifier-naming)
  static constexpr std::ptrdiff_t W = [] {
    if constexpr (std::is_same_v<V, double>)
      return 1;
    else
      return static_cast<int>(V::size());
  }();
  using Batches = NodeBatch<W>;
  using Axes = Axis<W>;
  using Joints3 = Joint3<W>;
  using Frames = Frame<W>;

  [[gnu::always_inline]] static V load(const double* x) {
    if constexpr (std::is_same_v<V, double>)
      return *x;
    else
      return V(x, stdx::vector_aligned);
  }
  [[gnu::always_inline]] static void store(double* x, const V& v) {
    if constexpr (std::is_same_v<V, double>)
      *x = v;
    else
      v.copy_to(x, stdx::vector_aligned);
  }
  /// Loads numbers of any alignment.
  [[gnu::always_inline]] static void store_loose(double* x, const V& v) {
    if constexpr (std::is_same_v<V, double>)
      *x = v;
    else
      v.copy_to(x, stdx::element_aligned);
  }
  [[gnu::always_inline]] static V3<V> load3(const Lane<W>* x) { return {load(x[0]), load(x[1]), load(x[2])}; }
  [[gnu::always_inline]] static V6<V> load6(const Lane<W>* x) { return {load3(x), load3(x + 3)}; }
  [[gnu::always_inline]] static Q4<V> load4(const Lane<W>* x) {
    return {load(x[0]), load(x[1]), load(x[2]), load(x[3])};
  }
  [[gnu::always_inline]] static Sym3<V> load_sym(const Lane<W>* x) {
    return {load(x[0]), load(x[1]), load(x[2]), load(x[3]), load(x[4]), load(x[5])};
  }
  [[gnu::always_inline]] static Mat<V> load_mat(const Lane<W>* x) {
    return {load3(x), load3(x + 3), load3(x + 6)};
  }
  [[gnu::always_inline]] static void store3(Lane<W>* x, const V3<V>& v) {
    store(x[0], v.x);
    store(x[1], v.y);
    store(x[2], v.z);
  }
  [[gnu::always_inline]] static void store6(Lane<W>* x, const V6<V>& v) {
    store3(x, v.n);
    store3(x + 3, v.f);
  }
  [[gnu::always_inline]] static void store4(Lane<W>* x, const Q4<V>& v) {
    store(x[0], v.x);
    store(x[1], v.y);
    store(x[2], v.z);
    store(x[3], v.w);
  }
  [[gnu::always_inline]] static void store_sym(Lane<W>* x, const Sym3<V>& v) {
    store3(x, {v.xx, v.xy, v.xz});
    store3(x + 3, {v.yy, v.yz, v.zz});
  }
  [[gnu::always_inline]] static void store_mat(Lane<W>* x, const Mat<V>& v) {
    store3(x, v.r0);
    store3(x + 3, v.r1);
    store3(x + 6, v.r2);
  }
  [[gnu::always_inline]] static void add(double* x, const V& v) { store(x, load(x) + v); }

  static Batches* batches(const LaneTree& tree) { return lanes_of<W>(tree).batch; }
  static Axes& axis(const LaneTree& tree, const Batches& b) { return lanes_of<W>(tree).axis[b.axis]; }
  static Joints3& joint3(const LaneTree& tree, const Batches& b) { return lanes_of<W>(tree).joint3[b.axis]; }
  static model::ServoOf<V> servo(const Axes& a) {
    return {load(a.servo_stiffness), load(a.servo_damping), load(a.servo_error), load(a.servo_feed),
            load(a.servo_limit)};
  }
  static bool single(const Batches& b) {
    return b.kind == NodeKind::revolute || b.kind == NodeKind::prismatic;
  }

  /// The parents' frame; `scratch` is filled where each lane has its own.
  static const Frames& parent(const LaneTree& tree, const Batches& b, Frames& scratch) {
    if (b.link == ParentLink::base) return lanes_of<W>(tree).base[b.parent];
    if (b.link == ParentLink::aligned) return batches(tree)[b.parent].frame;
    gather(tree, b, scratch);
    return scratch;
  }
  static void gather(const LaneTree& tree, const Batches& b, Frames& scratch) {
    for (int lane = 0; lane < W; ++lane) {
      const Frames& from = batches(tree)[b.parent_batch[lane]].frame;
      const int from_lane = b.parent_lane[lane];
      Frames::each_field([&](auto field) {
        auto& out = scratch.*field;
        const auto& in = from.*field;
        for (std::size_t i = 0; i < std::extent_v<std::remove_reference_t<decltype(out)>>; ++i)
          out[i][lane] = in[i][from_lane];
      });
    }
  }

  /// Spatial inertia times S: equal to the bit to the product of 6 x 6 blocks, without their zeros.
  [[gnu::always_inline]] static V6<V> times_rigid(const Batches& b, const Sym3<V>& I, const V6<V>& S) {
    const V3<V> h = load3(b.h);
    return {I * S.n + cross(h, S.f), cross(S.n, h) + load(b.mass) * S.f};
  }
};

}  // namespace handsim::engine::articulated
