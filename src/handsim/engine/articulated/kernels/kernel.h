// The kernel of a number type: one for each instruction set. Included by the kernel_*.cpp files only.
#pragma once

#include "handsim/engine/articulated/kernels/kernel_motion.h"
#include "handsim/engine/articulated/kernels/kernel_solve.h"

namespace handsim::engine::articulated {

template <class V>
constexpr Kernel make_kernel(const char* name) {
  using M = TreeMotion<V>;
  using F = Forces<V>;
  using S = ArticulatedBodies<V>;
  return {.name = name,
          .width = static_cast<int>(Lanes<V>::W),
          .kinematics = M::kinematics,
          .velocities = M::velocities,
          .prepare = F::prepare,
          .compute_torques = F::compute_torques,
          .prepare_smooth = F::prepare_smooth,
          .solve = S::solve,
          .inertia = S::template inertia<false>,
          .paired_inertia = S::template inertia<true>,
          .update_active_set = F::update_active_set,
          .bodies = M::bodies,
          .momenta = M::momenta,
          .work = F::work,
          .integrate = M::integrate,
          .position_rates = M::position_rates,
          .normalise = M::normalise,
          .accelerate = S::accelerate,
          .advance = M::advance};
}

}  // namespace handsim::engine::articulated
