// What the torques of tendons at a step's end change in the accelerations that were found without them.
#pragma once

#include "handsim/engine/articulated/kernels/lanes.h"

namespace handsim::engine::articulated {

template <class V>
struct TendonCoupling : Lanes<V> {
  using L = Lanes<V>;
  using L::W, L::load, L::store;

  static auto locked(const CoupledDof& dof) {
    const V side = load(dof.side);
    return side * side > V(0.0);
  }
  static bool any_locked(const TendonRows& c) {
    bool out = false;
    for (int i = 0; i < c.dofs; ++i) out = out || any(locked(c.dof[i]));
    return out;
  }

  /// A = H + weights + h B, and b = h B du.
  static void assemble(const TendonRows& c, double step) {
    const V h = step, zero = 0.0;
    for (int k = 0; k < c.numbers; ++k) store(c.A + k * W, load(c.inertia + c.from[k] * W));
    for (int i = 0; i < c.dofs; ++i) {
      const CoupledDof& dof = c.dof[i];
      L::add(c.A + (dof.row + dof.depth) * W, load(dof.weight));
      store(c.b + i * W, zero);
    }
    for (int k = 0; k < c.entries; ++k) {
      const CoupledEntry& each = c.entry[k];
      const V value = h * load(c.slope + k * W);
      L::add(c.A + each.at * W, value);
      L::add(c.b + each.i * W, value * load(c.dof[each.j].du));
      if (each.i != each.j) L::add(c.b + each.j * W, value * load(c.dof[each.i].du));
    }
  }

  /// Rows and columns of locked coordinates are those of the unit matrix, and their x is 0.
  static void lock(const TendonRows& c) {
    const V zero = 0.0;
    for (int i = 0; i < c.dofs; ++i) {
      const CoupledDof& dof = c.dof[i];
      const auto own = locked(dof);
      for (int k = 0; k <= dof.depth; ++k) {
        double* to = c.L + (dof.row + k) * W;
        const auto off = own || locked(c.dof[c.carrier[dof.row + k]]);
        store(to, articulated::select(off, V(k == dof.depth ? 1.0 : 0.0), load(to)));
      }
      store(c.x + i * W, articulated::select(own, zero, load(c.x + i * W)));
    }
  }

  /// x = A^-1 b: L^T L as in joint_space.h, by rows of H.
  static void solve(const TendonRows& c, bool locks) {
    for (int k = 0; k < c.numbers; ++k) store(c.L + k * W, load(c.A + k * W));
    for (int i = 0; i < c.dofs; ++i) store(c.x + i * W, load(c.b + i * W));
    if (locks) lock(c);
    for (int k = c.dofs; k-- > 0;) {
      const CoupledDof& own = c.dof[k];
      const double* row = c.L + own.row * W;
      const int* carrier = c.carrier + own.row;
      const V inverse = V(1.0) / load(row + own.depth * W), x = load(c.x + k * W);
      store(c.inverse + k * W, inverse);
      for (int i = own.depth; i-- > 0;) {
        const V share = load(row + i * W) * inverse;
        double *to = c.L + c.dof[carrier[i]].row * W, *of = c.x + carrier[i] * W;
        store(of, load(of) - share * x);
        for (int j = 0; j <= i; ++j) store(to + j * W, load(to + j * W) - share * load(row + j * W));
      }
    }
    for (int i = 0; i < c.dofs; ++i) {
      const double* row = c.L + c.dof[i].row * W;
      const int* carrier = c.carrier + c.dof[i].row;
      V sum = load(c.x + i * W);
      for (int j = 0; j < c.dof[i].depth; ++j) sum = sum - load(row + j * W) * load(c.x + carrier[j] * W);
      store(c.x + i * W, sum * load(c.inverse + i * W));
    }
  }

  static void accelerate(const TendonRows& c, double step) {
    const bool locks = any_locked(c);
    const V zero = 0.0;
    assemble(c, step);
    solve(c, locks);
    for (int i = 0; i < c.dofs; ++i) store(c.dof[i].du, load(c.dof[i].du) - load(c.x + i * W));
    if (!locks) return;
    // What the equation of a locked coordinate lacks is its stop's: b - A x.
    for (int i = 0; i < c.dofs; ++i) {
      const CoupledDof& own = c.dof[i];
      L::add(own.reaction, articulated::select(locked(own), load(c.b + i * W), zero));
      for (int k = 0; k < own.depth; ++k) {
        const int j = c.carrier[own.row + k];
        const CoupledDof& other = c.dof[j];
        const V entry = load(c.A + (own.row + k) * W);
        store(own.reaction,
              load(own.reaction) - articulated::select(locked(own), V(entry * load(c.x + j * W)), zero));
        store(other.reaction,
              load(other.reaction) - articulated::select(locked(other), V(entry * load(c.x + i * W)), zero));
      }
    }
  }

  static void compute_torques(const TendonRows& c, double step) {
    const auto take = [](const CoupledDof& from, const V& torque) {
      store(from.tau, load(from.tau) - torque);
      store(from.force, load(from.force) - torque);
    };
    for (int k = 0; k < c.entries; ++k) {
      const CoupledDof &a = c.dof[c.entry[k].i], &b = c.dof[c.entry[k].j];
      const V value = V(step) * load(c.slope + k * W);
      take(a, value * load(b.du));
      if (&a != &b) take(b, value * load(a.du));
    }
  }
};

}  // namespace handsim::engine::articulated
