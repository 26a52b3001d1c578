// Mechanisms of equal topology side by side: batch i is node i of each, lane l the mechanism in lane l. Nodes
// and sums are in the order of Topology, so that the bits are those of each mechanism alone.
#pragma once

#include <vector>

#include "handsim/engine/articulated/dynamics/mechanism_lanes.h"
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
  void update_control() {
    control.bodies = static_cast<int>(bodies.size());
    control.weights = static_cast<int>(weights.size());
    control.servos = static_cast<int>(servos.size());
    control.body = bodies.data();
    control.weight = weights.data();
    control.servo = servos.data();
    control.origin = data(origins);
    control.gravity = data(gravity);
    control.load = data(loads);
  }
  double* data(std::vector<Numbers>& numbers) { return numbers.empty() ? nullptr : numbers[0].x; }
};

template <int W>
LaneTree<W>::LaneTree(const Topology& topology, std::size_t body_count, std::size_t dofs)
    : batches(topology.nodes.size()), bodies(body_count) {
  std::size_t positions = 0, rates = 0;
  for (std::size_t i = 0; i < batches.size(); ++i) {
    const Node& node = topology.nodes[i];
    Batch<W>& b = batches[i];
    b.kind = node.kind;
    b.link = node.parent ? ParentLink::aligned : ParentLink::base;
    b.parent = node.parent ? *node.parent : static_cast<int>(bases.size());
    b.massless = !node.body;
    b.used = W;
    b.q = static_cast<int>(positions) * W;
    b.u = static_cast<int>(rates) * W;
    b.axis = static_cast<int>(single(node.kind) ? axes.size() : joints3.size());
    positions += at(position_count(node.kind));
    rates += at(rate_count(node.kind));
    if (single(node.kind))
      axes.emplace_back();
    else
      joints3.emplace_back();
    if (node.parent)
      batches[at(*node.parent)].has_children = true;
    else
      bases.emplace_back();
    for (int lane = 0; lane < W; ++lane) {
      b.parent_batch[lane] = b.parent;
      b.parent_lane[lane] = lane;
    }
    if (!node.body) continue;
    LaneBody<W>& body = bodies[at(*node.body)];
    body.batch = static_cast<int>(i);
    body.island = node.island;
    body.of_node = true;
  }
  std::vector<bool> given(batches.size(), false);
  for (std::size_t i = batches.size(); i-- > 0;) {
    if (batches[i].link == ParentLink::base) continue;
    const auto parent = at(batches[i].parent);
    batches[i].adds_first = !given[parent];
    given[parent] = true;
  }
  for (auto* numbers : {&u, &du, &tau, &tau_servo}) numbers->resize(rates);
  q.resize(positions);
  spin.resize(1);
  origins.resize(3 * at(topology.islands));
  gravity.resize(3);
  loads.resize(dofs);
  tree.batches = static_cast<int>(batches.size());
  tree.batch = batches.data();
  tree.axis = axes.data();
  tree.joint3 = joints3.data();
  tree.base = bases.data();
  tree.positions = static_cast<int>(positions) * W;
  tree.rates = static_cast<int>(rates) * W;
  tree.q = data(q);
  tree.u = data(u);
  tree.du = data(du);
  tree.tau = data(tau);
  tree.tau_servo = data(tau_servo);
  tree.spin = data(spin);
  tree.max_speed = kMaxSpeed;
  tree.max_turn = kMaxAngularSpeed;
}

}  // namespace handsim::engine::articulated
