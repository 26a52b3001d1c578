// The recursive algorithms in lanes: written once for any number type V, built for each instruction set in a
// file of its own. Notation of Featherstone 2008; body-fixed steps in world axes about O, so that X is the
// identity. Included by the kernel_*.cpp files only.
#pragma once

#include <cstddef>
#include <type_traits>

#include "handsim/engine/articulated/kernels/batch.h"
#include "handsim/engine/articulated/kernels/spatial.h"

namespace handsim::engine::articulated {

template <class V>
struct Lanes {
  // Wide, as it multiplies pointer offsets; named as in batch.h.
  // NOLINTNEXTLINE(readability-identifier-naming)
  static constexpr std::ptrdiff_t W = [] {
    if constexpr (std::is_same_v<V, double>)
      return 1;
    else
      return static_cast<int>(V::size());
  }();
  using Batches = Batch<W>;
  using Axes = Axis<W>;
  using Joints3 = Joint3<W>;
  using Frames = Frame<W>;

  static V load(const double* x) {
    if constexpr (std::is_same_v<V, double>)
      return *x;
    else
      return V(x, stdx::vector_aligned);
  }
  static void store(double* x, const V& v) {
    if constexpr (std::is_same_v<V, double>)
      *x = v;
    else
      v.copy_to(x, stdx::vector_aligned);
  }
  /// Where nothing is known of the alignment.
  static void store_loose(double* x, const V& v) {
    if constexpr (std::is_same_v<V, double>)
      *x = v;
    else
      v.copy_to(x, stdx::element_aligned);
  }
  static V3<V> load3(const Lane<W>* x) { return {load(x[0]), load(x[1]), load(x[2])}; }
  static V6<V> load6(const Lane<W>* x) { return {load3(x), load3(x + 3)}; }
  static Q4<V> load4(const Lane<W>* x) { return {load(x[0]), load(x[1]), load(x[2]), load(x[3])}; }
  static Sym3<V> load_sym(const Lane<W>* x) {
    return {load(x[0]), load(x[1]), load(x[2]), load(x[3]), load(x[4]), load(x[5])};
  }
  static Mat<V> load_mat(const Lane<W>* x) { return {load3(x), load3(x + 3), load3(x + 6)}; }
  static void store3(Lane<W>* x, const V3<V>& v) {
    store(x[0], v.x);
    store(x[1], v.y);
    store(x[2], v.z);
  }
  static void store6(Lane<W>* x, const V6<V>& v) {
    store3(x, v.n);
    store3(x + 3, v.f);
  }
  static void store4(Lane<W>* x, const Q4<V>& v) {
    store(x[0], v.x);
    store(x[1], v.y);
    store(x[2], v.z);
    store(x[3], v.w);
  }
  static void store_sym(Lane<W>* x, const Sym3<V>& v) {
    store3(x, {v.xx, v.xy, v.xz});
    store3(x + 3, {v.yy, v.yz, v.zz});
  }
  static void store_mat(Lane<W>* x, const Mat<V>& v) {
    store3(x, v.r0);
    store3(x + 3, v.r1);
    store3(x + 6, v.r2);
  }
  static void add(double* x, const V& v) { store(x, load(x) + v); }

  static Batches* batches(const Tree& tree) { return static_cast<Batches*>(tree.batch); }
  static Axes& axis(const Tree& tree, const Batches& b) { return static_cast<Axes*>(tree.axis)[b.axis]; }
  static Joints3& joint3(const Tree& tree, const Batches& b) {
    return static_cast<Joints3*>(tree.joint3)[b.axis];
  }
  static bool single(const Batches& b) {
    return b.kind == NodeKind::revolute || b.kind == NodeKind::prismatic;
  }

  /// The parents' frame; `scratch` is filled where each lane has its own.
  static const Frames& parent(const Tree& tree, const Batches& b, Frames& scratch) {
    if (b.link == ParentLink::base) return static_cast<Frames*>(tree.base)[b.parent];
    if (b.link == ParentLink::aligned) return batches(tree)[b.parent].frame;
    gather(tree, b, scratch);
    return scratch;
  }
  static void gather(const Tree& tree, const Batches& b, Frames& scratch) {
    constexpr int kNumbers = static_cast<int>(sizeof(Frames) / sizeof(Lane<W>));
    double* out = &scratch.quat[0][0];
    for (int lane = 0; lane < W; ++lane) {
      const double* in = &batches(tree)[b.parent_batch[lane]].frame.quat[0][0] + b.parent_lane[lane];
      for (int i = 0; i < kNumbers; ++i) out[i * W + lane] = in[i * W];
    }
  }

  // Poses, velocities and inertias of the links, and integration (kernel_motion.h).
  static void turn(const Tree& tree, Batches& b);
  static void place(const Tree& tree, Batches& b);
  static Q4<V> unit(const Q4<V>& q);
  static void set_pose(Batches& b, const Q4<V>& quat, const Mat<V>& R, const V3<V>& p);
  static bool update_velocity(const Tree& tree, Batches& b);
  static bool kinematics(const Tree& tree);
  static bool velocities(const Tree& tree);
  static void momenta(const Tree& tree);
  static void move(const Tree& tree, const Batches& b, double step);
  static void integrate(const Tree& tree, double step);
  static bool advance(const Tree& tree, double step);
  static V wrapped(const V& angle);
  static void rotate(double* q, const V3<V>& w, const V& h);
  static void position_rates(const Tree& tree, double* out);
  static void normalise(const Tree& tree);

  // Forces of a step, and the stops and limits in force in it (kernel_forces.h).
  static void prepare_axis(const Tree& tree, const Batches& b, double step);
  static void prepare(const Tree& tree, double step);
  static void find_torque(const Tree& tree, const Batches& b, double step);
  static void find_torques(const Tree& tree, double step);
  static void prepare_smooth(const Tree& tree);
  static bool correct(const Tree& tree, const Batches& b, double step, bool only_first);
  static bool update_active_set(const Tree& tree, double step, bool only_first);
  static void work(const Tree& tree, double step);
  static void correct_first(Axes& a, const V& now, const V& reached);
  static void lock_at_stops(const Tree& tree, const Batches& b, Axes& a, double step);

  // The articulated-body algorithm (kernel_solve.h).
  using Works = Work<W>*;  ///< of each batch of a tree
  /// The first call in a solution has the largest index.
  static Work3<W>& work3(const Batches& b) {
    const auto index = static_cast<std::size_t>(b.axis);
    return static_cast<Work3<W>*>(thread_work(WorkOf::joints3, sizeof(Work3<W>) * (index + 1)))[index];
  }
  static Inertia<V> inertia(const Batches& b, const Work<W>& w);
  static V6<V> bias(const Batches& b, const Work<W>& w);
  static constexpr int kArticulated = 27;  ///< numbers of A, B, C, p
  static void add_to_parent(const Batches& b, Works works, const Inertia<V>& I, const V6<V>& p);
  static void solve(const Tree& tree);
  static bool accelerate(const Tree& tree, double step);
  static Works works_of(const Tree& tree);
  static Works cleared(const Tree& tree);
  static Works find_composites(const Tree& tree);
  static void inertia(const Tree& tree, double* out);
  static V6<V> times_rigid(const Batches& b, const Sym3<V>& I, const V6<V>& S);
  static bool lone(const Batches& b) { return b.kind == NodeKind::free && !b.has_children; }
  static void inward_lone(const Tree& tree, Batches& b);
  static void outward_lone(const Tree& tree, Batches& b);
  static void inward_any(const Tree& tree, Works works, int batch);
  static void outward_any(const Tree& tree, Works works, int batch);
  static void inward(const Tree& tree, Batches& b, Works works, Work<W>& w);
  static void outward(const Tree& tree, Batches& b, const Work<W>& w);
  template <int N>
  static void factor(Lane<W> (*D)[6]);
  template <int N>
  static void solve_factored(const Lane<W> (*D)[6], V (&x)[N]);
  template <int N>
  static void inward_many(const Tree& tree, Batches& b, Works works, const Work<W>& w);
  template <int N>
  static void outward_many(const Tree& tree, Batches& b);

  // Bodies and controllers of environments (kernel_control.h).
  static void place_bodies(const Tree& tree, const LaneControl& control);
  static void find_loads(const LaneControl& control);
  static void command(const Tree& tree, const LaneControl& control, double step);
  static void observe(const Tree& tree, const LaneControl& control);

  static constexpr Kernel kernel(const char* name) {
    return {name,           static_cast<int>(W),
            kinematics,     velocities,
            prepare,        find_torques,
            prepare_smooth, solve,
            inertia,        update_active_set,
            momenta,        work,
            integrate,      position_rates,
            normalise,      accelerate,
            advance,        {place_bodies, command, observe}};
  }
};

}  // namespace handsim::engine::articulated

#include "handsim/engine/articulated/kernels/kernel_control.h"
#include "handsim/engine/articulated/kernels/kernel_forces.h"
#include "handsim/engine/articulated/kernels/kernel_motion.h"
#include "handsim/engine/articulated/kernels/kernel_solve.h"
