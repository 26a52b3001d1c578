#include "handsim/engine/articulated/lane_tree.h"

#include <algorithm>
#include <numeric>

#include "handsim/engine/articulated/mechanism_lanes.h"

namespace handsim::engine::articulated {

namespace {

/// Nodes of a part, unless one tree alone has more: some trees side by side, as the nodes of one wait for
/// each other.
constexpr std::size_t kPartNodes = 8;

}  // namespace

/// Finds the parts and where each node stands.
template <int W>
void LaneTree<W>::order(const Topology& topology) {
  const std::size_t count = topology.nodes.size();
  std::vector<std::size_t> root(count), nodes_of(count, 0);
  for (std::size_t i = 0; i < count; ++i) {
    root[i] = topology.nodes[i].parent ? root[handsim::at(*topology.nodes[i].parent)] : i;
    ++nodes_of[root[i]];
  }
  std::vector<std::size_t> part(count, 0);
  std::size_t parts_so_far = 0, filled = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (root[i] != i) continue;
    if (filled > 0 && filled + nodes_of[i] > kPartNodes) {
      ++parts_so_far;
      filled = 0;
    }
    part[i] = parts_so_far;
    filled += nodes_of[i];
  }
  part_of.resize(count);
  for (std::size_t i = 0; i < count; ++i) part_of[i] = part[root[i]];
  node_of_.resize(count);
  std::iota(node_of_.begin(), node_of_.end(), 0);
  std::stable_sort(node_of_.begin(), node_of_.end(),
                   [&](std::size_t a, std::size_t b) { return part_of[a] < part_of[b]; });
  batch_of.resize(count);
  for (std::size_t i = 0; i < count; ++i) batch_of[node_of_[i]] = i;
  parts.resize(count > 0 ? parts_so_far + 1 : 0);
}

template <int W>
LaneTree<W>::LaneTree(const Topology& topology, std::size_t body_count, std::size_t dofs)
    : batches(topology.nodes.size()), bodies(body_count), part_of_body_(body_count, 0) {
  order(topology);
  std::size_t positions = 0, rates = 0;
  for (std::size_t i = 0; i < batches.size(); ++i) {
    const Node& node = topology.nodes[node_of_[i]];
    Batch<W>& b = batches[i];
    b.kind = node.kind;
    b.link = node.parent ? ParentLink::aligned : ParentLink::base;
    b.parent = static_cast<int>(node.parent ? batch_of[handsim::at(*node.parent)] : bases.size());
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
      batches[handsim::at(b.parent)].has_children = true;
    else
      bases.emplace_back();
    for (int lane = 0; lane < W; ++lane) {
      b.parent_batch[lane] = b.parent;
      b.parent_lane[lane] = lane;
    }
    if (!node.body) continue;
    b.body = *node.body;
    LaneBody<W>& body = bodies[handsim::at(b.body)];
    body.island = node.island;
    body.of_node = true;
    part_of_body_[handsim::at(b.body)] = part_of[node_of_[i]];
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
  spin.resize(std::max<std::size_t>(parts.size(), 1));
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
  describe_parts();
}

template <int W>
void LaneTree<W>::describe_parts() {
  std::size_t next = 0;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    Part& part = parts[k];
    part.tree = tree;
    part.tree.spin = spin[k].x;
    part.tree.first = static_cast<int>(next);
    bool first_axis = true;
    part.q = next < batches.size() ? handsim::at(batches[next].q) : 0;
    part.u = next < batches.size() ? handsim::at(batches[next].u) : 0;
    for (; next < batches.size() && part_of[node_of_[next]] == k; ++next) {
      const Batch<W>& b = batches[next];
      part.positions += W * handsim::at(position_count(b.kind));
      part.rates += W * handsim::at(rate_count(b.kind));
      if (!single(b.kind)) continue;
      if (first_axis) part.axis = handsim::at(b.axis);
      first_axis = false;
      ++part.axes;
    }
    part.tree.batches = static_cast<int>(next);
  }
}

template <int W>
void LaneTree<W>::update_control() {
  std::size_t weight = 0, servo = 0;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    LaneControl& control = parts[k].control;
    control.first_weight = static_cast<int>(weight);
    while (weight < weights.size() && part_of_body(weights[weight].child) == k) ++weight;
    control.weights = static_cast<int>(weight);
    control.first_servo = static_cast<int>(servo);
    while (servo < servos.size() && part_of[node_of_[handsim::at(servos[servo].batch)]] == k) ++servo;
    control.servos = static_cast<int>(servo);
    control.body = bodies.data();
    control.weight = weights.data();
    control.servo = servos.data();
    control.origin = at(origins);
    control.gravity = at(gravity);
    control.load = at(loads);
  }
}

template struct LaneTree<2>;
template struct LaneTree<4>;
template struct LaneTree<8>;

}  // namespace handsim::engine::articulated
