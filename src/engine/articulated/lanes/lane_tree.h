// Mechanisms of equal topology side by side: batch i of the tree is node i of each of them, lane l is the
// mechanism in lane l. The order of the nodes is Topology's, and so is the order of all sums: the bits are
// those that each mechanism finds alone.
#pragma once

#include <vector>

#include "handsim/engine/articulated/dynamics/topology.h"
#include "handsim/engine/articulated/kernels/batch.h"

namespace handsim::engine::articulated {

template <int W>
struct LaneTree {
  /// @param islands of the mechanisms, @param bodies and dofs of their models
  LaneTree(const Topology& topology, std::size_t bodies, std::size_t dofs);

  std::vector<Batch<W>> batches;
  std::vector<Axis<W>> axes;
  std::vector<Joint3<W>> joints3;
  std::vector<Frame<W>> bases;
  std::vector<LaneBody<W>> bodies;  ///< as Model::bodies
  std::vector<LaneWeight<W>> weights;
  std::vector<LaneServo<W>> servos;
  struct alignas(sizeof(Lane<W>)) Numbers {
    Lane<W> x;
  };
  std::vector<Numbers> q, u, du, tau, tau_servo, spin, origins, gravity, loads;
  Tree tree;
  LaneControl control;

  /// After weights or servos have changed in number.
  void update_control();
  double* at(std::vector<Numbers>& numbers) { return numbers.empty() ? nullptr : numbers[0].x; }
};

}  // namespace handsim::engine::articulated
