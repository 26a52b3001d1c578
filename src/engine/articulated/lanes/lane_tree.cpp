#include "handsim/engine/articulated/lanes/lane_tree.h"

#include "handsim/core/index.h"
#include "handsim/engine/articulated/dynamics/mechanism_lanes.h"

namespace handsim::engine::articulated {

template <int W>
LaneTree<W>::LaneTree(const Topology& topology, std::size_t body_count, std::size_t dofs)
    : batches(topology.nodes.size()), bodies(body_count) {
  std::size_t positions = 0, rates = 0;
  std::vector<int> axis_of;
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
    positions += handsim::at(position_count(node.kind));
    rates += handsim::at(rate_count(node.kind));
    if (single(node.kind))
      axes.emplace_back();
    else
      joints3.emplace_back();
    if (node.parent)
      batches[handsim::at(*node.parent)].has_children = true;
    else
      bases.emplace_back();
    for (int lane = 0; lane < W; ++lane) {
      b.parent_batch[lane] = b.parent;
      b.parent_lane[lane] = lane;
    }
    if (!node.body) continue;
    LaneBody<W>& body = bodies[handsim::at(*node.body)];
    body.batch = static_cast<int>(i);
    body.island = node.island;
    body.of_node = true;
  }
  std::vector<bool> given(batches.size(), false);
  for (std::size_t i = batches.size(); i-- > 0;) {
    if (batches[i].link == ParentLink::base) continue;
    const auto parent = handsim::at(batches[i].parent);
    batches[i].adds_first = !given[parent];
    given[parent] = true;
  }
  for (auto* numbers : {&u, &du, &tau, &tau_servo}) numbers->resize(rates);
  q.resize(positions);
  spin.resize(1);
  origins.resize(3 * handsim::at(topology.islands));
  gravity.resize(3);
  loads.resize(dofs);
  tree.batches = static_cast<int>(batches.size());
  tree.batch = batches.data();
  tree.axis = axes.data();
  tree.joint3 = joints3.data();
  tree.base = bases.data();
  tree.positions = static_cast<int>(positions) * W;
  tree.rates = static_cast<int>(rates) * W;
  tree.q = at(q);
  tree.u = at(u);
  tree.du = at(du);
  tree.tau = at(tau);
  tree.tau_servo = at(tau_servo);
  tree.spin = at(spin);
  tree.max_speed = kMaxSpeed;
  tree.max_turn = kMaxAngularSpeed;
}

template <int W>
void LaneTree<W>::update_control() {
  control.bodies = static_cast<int>(bodies.size());
  control.weights = static_cast<int>(weights.size());
  control.servos = static_cast<int>(servos.size());
  control.body = bodies.data();
  control.weight = weights.data();
  control.servo = servos.data();
  control.origin = at(origins);
  control.gravity = at(gravity);
  control.load = at(loads);
}

template struct LaneTree<2>;
template struct LaneTree<4>;
template struct LaneTree<8>;

}  // namespace handsim::engine::articulated
