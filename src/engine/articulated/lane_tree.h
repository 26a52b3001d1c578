// Mechanisms of equal topology side by side: each batch of the tree is a node of each of them, lane l is the
// mechanism in lane l. Trees that have no joint with each other, such as the fingers of a still palm, stand
// one behind the other, and a step of one of them is over before the next one begins: its numbers stay in the
// processor's first cache. Within a tree the order of the nodes is Topology's, and so is the order of all
// sums: the bits are those that each mechanism finds alone.
#pragma once

#include <vector>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/batch.h"
#include "handsim/engine/articulated/topology.h"

namespace handsim::engine::articulated {

template <int W>
struct LaneTree {
  /// @param islands of the mechanisms, @param bodies and dofs of their models
  LaneTree(const Topology& topology, std::size_t bodies, std::size_t dofs);

  /// Trees that are stepped together: ranges of batches, of their numbers, of weights and servos.
  struct Part {
    Tree tree;
    LaneControl control;
    std::size_t q = 0, positions = 0, u = 0, rates = 0, axis = 0, axes = 0;
  };

  std::vector<Part> parts;
  std::vector<std::size_t> batch_of, part_of;  ///< of each node
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
  Tree tree;  ///< all of it

  /// After weights or servos have changed. Those of one part stand side by side.
  void update_control();
  std::size_t part_of_body(int body) const { return part_of_body_[handsim::at(body)]; }
  double* at(std::vector<Numbers>& numbers) { return numbers.empty() ? nullptr : numbers[0].x; }

 private:
  void order(const Topology& topology);
  void describe_parts();

  std::vector<std::size_t> node_of_, part_of_body_;
};

}  // namespace handsim::engine::articulated
