#include "handsim/engine/articulated/dynamics/mechanism.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <utility>

#include "handsim/engine/articulated/dynamics/mechanism_lanes.h"
#include "handsim/model/kinematics.h"

namespace handsim::engine::articulated {

namespace {

/// Lanes without a node: a unit inertia at rest.
template <int W>
void empty(NodeBatch<W>& b) {
  for (int lane = 0; lane < W; ++lane) {
    put4<W>(b.before, lane, Quat::Identity());
    put4<W>(b.turned, lane, Quat(0, 0, 0, 1));
    put3<W>(b.direction, lane, Vec3::UnitZ());
    put4<W>(b.body_turn, lane, Quat::Identity());
    b.mass[lane] = 1;
    put3<W>(b.inertia, lane, Vec3::Ones());
  }
}

template <int W>
void fill(NodeBatch<W>& b, int lane, const Node& node) {
  put4<W>(b.before, lane, node.before);
  put4<W>(b.turned, lane, node.turned);
  put3<W>(b.direction, lane, node.axis);
  put4<W>(b.body_turn, lane, node.q_LB);
  put3<W>(b.anchor, lane, node.anchor);
  put3<W>(b.arm, lane, node.arm);
  b.mass[lane] = node.mass;
  put3<W>(b.inertia, lane, node.inertia);
}

template <int W>
void fill(Axis<W>& a, int lane, const model::JointAxis& axis, const model::Effects& effects) {
  a.present[lane] = 1;
  if (axis.stop && effects.has(model::Effect::joint_stops)) {
    a.low[lane] = axis.stop->low;
    a.high[lane] = axis.stop->high;
    a.restitution[lane] = axis.stop->restitution;
  }
  if (axis.tissue && effects.has(model::Effect::passive_tissue)) {
    a.stiffness[lane] = axis.tissue->stiffness;
    a.damping[lane] = axis.tissue->damping;
    a.rest[lane] = axis.tissue->rest;
  }
}

/// Nodes of one depth and kind, in their order.
std::vector<std::vector<int>> levels(const Topology& topology) {
  std::map<std::pair<int, int>, std::vector<int>> groups;
  for (std::size_t i = 0; i < topology.nodes.size(); ++i)
    groups[{topology.nodes[i].depth, static_cast<int>(topology.nodes[i].kind)}].push_back(
        static_cast<int>(i));
  std::vector<std::vector<int>> out;
  for (auto& [key, nodes] : groups) out.push_back(std::move(nodes));
  return out;
}

const Kernel& fitting(const Topology& topology) {
  // Loops are held by algorithms of one lane.
  if (!topology.cuts.empty()) return *kernels().front();
  std::vector<int> sizes;
  for (const auto& level : levels(topology)) sizes.push_back(static_cast<int>(level.size()));
  return choose_kernel(sizes);
}

}  // namespace

NodeView Mechanism::find_view(std::size_t node) const {
  return in_lanes([&]<int W>(const LaneTreeOf<W>& tree) {
    const LaneSlot& slot = slots_[node];
    const NodeBatch<W>& b = tree.batch[slot.batch];
    const auto lane = [&](auto& first) { return &first[0] + slot.lane; };
    NodeView out;
    out.h = lane(b.h[0]);
    out.I = lane(b.I[0]);
    out.mass = lane(b.mass);
    out.c = lane(b.c[0]);
    out.pv = lane(b.pv[0]);
    out.R = lane(b.frame.R[0]);
    out.p = lane(b.frame.p[0]);
    out.v = lane(b.frame.v[0]);
    out.spin = lane(b.spin);
    out.momentum = lane(b.momentum[0]);
    out.energy = lane(b.energy);
    if (b.link == ParentLink::base) out.base_a = lane(tree.base[b.parent].a[0]);
    out.q = tree.q + slot.q;
    out.u = tree.u + slot.u;
    out.du = tree.du + slot.u;
    if (!single(b.kind)) {
      out.S = lane(tree.joint3[slot.axis].S[0][0]);
      out.tau = lane(tree.joint3[slot.axis].tau[0]);
      return out;
    }
    Axis<W>& a = tree.axis[slot.axis];
    out.S = lane(b.S[0]);
    out.low = lane(a.low);
    out.high = lane(a.high);
    out.restitution = lane(a.restitution);
    out.weight = lane(a.weight);
    out.work = lane(a.work);
    out.servo_stiffness = lane(a.servo_stiffness);
    out.servo_damping = lane(a.servo_damping);
    out.servo_error = lane(a.servo_error);
    out.servo_feed = lane(a.servo_feed);
    out.servo_limit = lane(a.servo_limit);
    out.side = lane(a.side);
    out.saturated = lane(a.saturated);
    out.force = lane(a.force);
    out.reaction = lane(a.reaction);
    return out;
  });
}

Mechanism::Mechanism(const model::Model& model, const Settings& settings, const Kernel* kernel)
    : model_(model),
      gravity_(settings.effects.has(model::Effect::gravity) ? model.gravity : Vec3::Zero()),
      topology_(make_topology(model)),
      kernel_(kernel && topology_.cuts.empty() ? kernel : &fitting(topology_)),
      bases_(model.bodies.size()) {
  place_nodes();
  of_width(kernel_->width, [&](auto w) { make_tree<w>(settings); });
  views_.reserve(slots_.size());
  for (std::size_t i = 0; i < slots_.size(); ++i) views_.push_back(find_view(i));
  std::vector<bool> parents(topology_.nodes.size(), false);
  for (const Node& node : topology_.nodes)
    if (node.parent) parents[as_index(*node.parent)] = true;
  // A ball's gyroscopic torque is zero.
  for (std::size_t i = 0; i < topology_.nodes.size(); ++i)
    if (const Node& node = topology_.nodes[i];
        node.kind == NodeKind::free && !parents[i] && node.inertia.maxCoeff() != node.inertia.minCoeff())
      single_bodies_.push_back(static_cast<int>(i));
  std::vector<bool> inside(model.joints.size(), false);
  for (const Node& node : topology_.nodes)
    if (node.joint) inside[as_index(*node.joint)] = true;
  for (std::size_t j = 0; j < inside.size(); ++j)
    if (!inside[j]) outside_.push_back(static_cast<int>(j));
  origins_.resize(topology_.reference.size());
  for (std::size_t i = 0; i < topology_.nodes.size(); ++i) {
    if (!topology_.nodes[i].body) continue;
    const std::size_t island = as_index(topology_.nodes[i].island);
    const std::size_t reference = as_index(topology_.reference[island]);
    const bool free = topology_.nodes[reference].kind == NodeKind::free;
    carried_.push_back({*topology_.nodes[i].body, slots_[i].batch, slots_[i].lane,
                        free ? tree_->q + slots_[reference].q : origins_[island].data(),
                        free ? stride() : 1});
  }
}

void Mechanism::place_nodes() {
  const std::size_t width = stride();
  for (const std::vector<int>& level : levels(topology_))
    for (std::size_t begin = 0; begin < level.size(); begin += width)
      chunks_.emplace_back(
          level.begin() + static_cast<std::ptrdiff_t>(begin),
          level.begin() + static_cast<std::ptrdiff_t>(std::min(level.size(), begin + width)));
  slots_.resize(topology_.nodes.size());
  std::size_t positions = 0, rates = 0;
  int axes = 0, joints3 = 0;
  for (std::size_t b = 0; b < chunks_.size(); ++b) {
    const NodeKind kind = topology_.nodes[as_index(chunks_[b][0])].kind;
    const int axis = single(kind) ? axes++ : joints3++;
    for (std::size_t lane = 0; lane < chunks_[b].size(); ++lane) {
      const Node& node = topology_.nodes[as_index(chunks_[b][lane])];
      const int dof = node.joint ? model_.joints[as_index(*node.joint)].first_dof + node.axis_index : 0;
      slots_[as_index(chunks_[b][lane])] = {
          static_cast<int>(b), static_cast<int>(lane), positions + lane, rates + lane, axis, as_index(dof)};
    }
    positions += as_index(position_count(kind)) * width;
    rates += as_index(rate_count(kind)) * width;
  }
}

template <int W>
void Mechanism::make_tree(const Settings& settings) {
  TreeSizes sizes{.batches = chunks_.size()};
  for (const std::vector<int>& chunk : chunks_) {
    const Node& first = topology_.nodes[as_index(chunk[0])];
    ++(single(first.kind) ? sizes.axes : sizes.joints3);
    if (!first.parent) ++sizes.bases;
    sizes.positions += as_index(position_count(first.kind)) * W;
    sizes.rates += as_index(rate_count(first.kind)) * W;
  }
  auto tree = std::make_shared<LaneTreeMemory<W>>(sizes);
  tree->erp = settings.erp();
  tree->max_speed = kMaxSpeed;
  tree->max_turn = kMaxAngularSpeed;
  tree_ = tree;
  int base = 0;
  for (std::size_t i = 0; i < chunks_.size(); ++i) {
    NodeBatch<W>& b = tree->batch[i];
    const LaneSlot& slot = slots_[as_index(chunks_[i][0])];
    empty(b);
    b.kind = topology_.nodes[as_index(chunks_[i][0])].kind;
    b.q = static_cast<int>(slot.q);
    b.u = static_cast<int>(slot.u);
    b.axis = slot.axis;
    if (!topology_.nodes[as_index(chunks_[i][0])].parent) b.parent = base++;
    make_batch(*tree, b, chunks_[i]);
    for (const int node : chunks_[i]) fill_lane(*tree, node, settings);
  }
  // Batches hand down to their parents from the last to the first.
  std::vector<bool> handed(chunks_.size(), false);
  for (std::size_t i = chunks_.size(); i-- > 0;) {
    NodeBatch<W>& b = tree->batch[i];
    if (b.link == ParentLink::base) continue;
    b.adds_first = b.link == ParentLink::aligned && !handed[as_index(b.parent)];
    if (b.adds_first) tree->batch[b.parent].cleared = false;
    for (int lane = 0; lane < b.used; ++lane) handed[as_index(b.parent_batch[lane])] = true;
  }
}

/// A batch of the given nodes, but for what differs from lane to lane.
template <int W>
void Mechanism::make_batch(const LaneTreeOf<W>& tree, NodeBatch<W>& b, const std::vector<int>& nodes) {
  const Node& first = topology_.nodes[as_index(nodes[0])];
  b.used = static_cast<int>(nodes.size());
  b.massless =
      std::ranges::none_of(nodes, [&](int node) { return topology_.nodes[as_index(node)].body.has_value(); });
  if (single(b.kind)) {
    Axis<W>& a = tree.axis[b.axis];
    std::fill_n(a.low, W, -std::numeric_limits<double>::infinity());
    std::fill_n(a.high, W, std::numeric_limits<double>::infinity());
  } else {
    // Empty lanes have the identity as pose.
    std::fill_n(tree.q + b.q + (b.kind == NodeKind::ball ? 3 : 6) * W, W, 1.0);
    std::fill_n(tree.joint3[b.axis].after[3], W, 1.0);
  }
  if (!first.parent) {
    b.link = ParentLink::base;
    Frame<W>& frame = tree.base[b.parent];
    for (int lane = 0; lane < W; ++lane) {
      put4<W>(frame.quat, lane, Quat::Identity());
      for (const int k : {0, 4, 8}) frame.R[k][lane] = 1;
    }
    return;
  }
  b.link = ParentLink::aligned;
  b.parent = slots_[as_index(*first.parent)].batch;
  for (int lane = 0; lane < W; ++lane) {
    const bool present = lane < b.used;
    const LaneSlot& slot =
        slots_[as_index(*topology_.nodes[as_index(nodes[present ? as_index(lane) : 0])].parent)];
    b.parent_batch[lane] = slot.batch;
    b.parent_lane[lane] = slot.lane;
    tree.batch[slot.batch].has_children = tree.batch[slot.batch].cleared = true;
    if (present && (slot.batch != b.parent || slot.lane != lane)) b.link = ParentLink::gathered;
    // The contents of an empty lane must not be added to a node.
    if (!present && lane < tree.batch[b.parent].used) b.link = ParentLink::gathered;
  }
}

template <int W>
void Mechanism::fill_lane(const LaneTreeOf<W>& tree, int index, const Settings& settings) {
  const Node& node = topology_.nodes[as_index(index)];
  const LaneSlot& slot = slots_[as_index(index)];
  fill(tree.batch[slot.batch], slot.lane, node);
  if (node.kind == NodeKind::ball) {
    put4<W>(tree.joint3[slot.axis].after, slot.lane, node.after);
    balls_.push_back(index);
  }
  if (!single(node.kind)) return;
  fill(tree.axis[slot.axis], slot.lane, model_.joints[as_index(*node.joint)].axes[as_index(node.axis_index)],
       settings.effects);
  singles_.push_back(index);
}

Vec3 Mechanism::origin(int island) const {
  const std::size_t reference = as_index(topology_.reference[as_index(island)]);
  if (topology_.nodes[reference].kind != NodeKind::free) return origins_[as_index(island)];
  const double* q = tree_->q + slots_[reference].q;
  return {q[0], q[stride()], q[2 * stride()]};
}

void Mechanism::update_bases() {
  for (std::size_t i = 0; i < origins_.size(); ++i)
    if (const Node& node = topology_.nodes[as_index(topology_.reference[i])]; node.kind != NodeKind::free)
      origins_[i] = bases_[as_index(node.base)].pose * node.anchor;
  in_lanes([&](const auto& in) {
    for (std::size_t i = 0; i < chunks_.size(); ++i) {
      const auto& b = in.batch[i];
      if (b.link != ParentLink::base) continue;
      auto& frame = in.base[b.parent];
      for (int lane = 0; lane < b.used; ++lane) {
        const Node& node = topology_.nodes[as_index(chunks_[i][as_index(lane)])];
        put3(frame.a + 3, lane, -gravity_);
        if (node.kind == NodeKind::free) continue;
        const BaseMotion& base = bases_[as_index(node.base)];
        const Mat3 R = base.pose.q.toRotationMatrix();
        // The origin is `r` from the base's own.
        const Vec3 r = origin(node.island) - base.pose.p;
        put4(frame.quat, lane, base.pose.q);
        for (int k = 0; k < 9; ++k) frame.R[k][lane] = R(k / 3, k % 3);
        put3(frame.p, lane, -r);
        put3(frame.v, lane, base.w);
        put3(frame.v + 3, lane, base.v + base.w.cross(r));
        put3(frame.a, lane, base.dw);
        // Spatial acceleration: of the flow at a fixed point (Featherstone 2008, eq. 2.48, p. 28).
        put3(frame.a + 3, lane, base.dv + base.dw.cross(r) - base.w.cross(base.v) - gravity_);
      }
    }
  });
}

void Mechanism::refresh(const Settings& settings) {
  gravity_ = settings.effects.has(model::Effect::gravity) ? model_.gravity : Vec3::Zero();
  const Topology topology = make_topology(model_);
  in_lanes([&](const auto& in) {
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      Node& node = topology_.nodes[i];
      node.mass = topology.nodes[i].mass;
      node.inertia = topology.nodes[i].inertia;
      auto& b = in.batch[slots_[i].batch];
      b.mass[slots_[i].lane] = node.mass;
      put3(b.inertia, slots_[i].lane, node.inertia);
    }
  });
  update_bases();
}

void Mechanism::load_node(const Node& node, const LaneSlot& slot, const model::State& state) {
  const std::size_t n = stride();
  double *q = tree_->q + slot.q, *u = tree_->u + slot.u;
  if (node.kind == NodeKind::free) {
    const model::BodyState& body = state.bodies[as_index(*node.body)];
    const Quat q_WL = body.q * node.q_LB.conjugate();
    for (std::size_t k = 0; k < 3; ++k) {
      q[k * n] = body.p[static_cast<Eigen::Index>(k)];
      u[k * n] = body.w[static_cast<Eigen::Index>(k)];
      u[(k + 3) * n] = body.v[static_cast<Eigen::Index>(k)];
    }
    for (std::size_t k = 0; k < 4; ++k) q[(k + 3) * n] = q_WL.coeffs()[static_cast<Eigen::Index>(k)];
    return;
  }
  const model::Joint& joint = model_.joints[as_index(*node.joint)];
  if (node.kind != NodeKind::ball) {
    std::array<double, 4> value{};
    model::joint_coordinates(joint, state, value);
    q[0] = value[as_index(node.axis_index)];
    model::joint_rates(joint, state, value);
    u[0] = value[as_index(node.axis_index)];
    return;
  }
  const model::BodyState& parent = state.bodies[as_index(node.reversed ? joint.child : joint.parent)];
  const model::BodyState& child = state.bodies[as_index(node.reversed ? joint.parent : joint.child)];
  const Quat q_WF = parent.q * (node.reversed ? joint.child_frame : joint.parent_frame).q;
  const Quat q_FM = q_WF.conjugate() * child.q * (node.reversed ? joint.parent_frame : joint.child_frame).q;
  const Vec3 w = q_WF.conjugate() * (child.w - parent.w);
  for (std::size_t k = 0; k < 4; ++k) q[k * n] = q_FM.normalized().coeffs()[static_cast<Eigen::Index>(k)];
  for (std::size_t k = 0; k < 3; ++k) u[k * n] = w[static_cast<Eigen::Index>(k)];
}

void Mechanism::load_state(const model::State& state) {
  for (std::size_t i = 0; i < bases_.size(); ++i)
    if (model_.bodies[i].kinematic)
      bases_[i] = {state.bodies[i].pose(), state.bodies[i].v, state.bodies[i].w, Vec3::Zero(), Vec3::Zero()};
  for (std::size_t i = 0; i < topology_.nodes.size(); ++i) load_node(topology_.nodes[i], slots_[i], state);
  load_torques(state);
  update_bases();
}

void Mechanism::load_torques(const model::State& state) {
  for (const int single : singles_) {
    const LaneSlot& slot = slots_[as_index(single)];
    tree_->tau[slot.u] = state.tau[slot.dof];
    tree_->tau_servo[slot.u] = state.tau_servo[slot.dof];
  }
  for (const int ball : balls_) {
    const LaneSlot& slot = slots_[as_index(ball)];
    for (std::size_t k = 0; k < 3; ++k) tree_->tau[slot.u + k * stride()] = state.tau[slot.dof + k];
  }
}

void Mechanism::store_coordinates(model::State& state) const {
  state.q.resize(state.tau.size());
  state.u.resize(state.tau.size());
  for (const int single : singles_) {
    const LaneSlot& slot = slots_[as_index(single)];
    state.q[slot.dof] = tree_->q[slot.q];
    state.u[slot.dof] = tree_->u[slot.u];
    state.tau[slot.dof] = tree_->tau[slot.u];
    state.tau_servo[slot.dof] = tree_->tau_servo[slot.u];
  }
  const std::size_t n = stride();
  for (const int ball : balls_) {
    const Node& node = topology_.nodes[as_index(ball)];
    const LaneSlot& slot = slots_[as_index(ball)];
    const double *q = tree_->q + slot.q, *u = tree_->u + slot.u, *tau = tree_->tau + slot.u;
    Quat q_FM(q[3 * n], q[0], q[n], q[2 * n]);
    Vec3 w(u[0], u[n], u[2 * n]);
    if (node.reversed) {
      q_FM = q_FM.conjugate();
      w = -(q_FM * w);
    }
    const Vec3 turn = rotation_vector(q_FM);
    const std::size_t first = slot.dof;
    for (std::size_t k = 0; k < 3; ++k) {
      state.q[first + k] = turn[static_cast<Eigen::Index>(k)];
      state.u[first + k] = w[static_cast<Eigen::Index>(k)];
      state.tau[first + k] = tau[k * n];
    }
  }
  for (const int index : outside_) {
    const model::Joint& joint = model_.joints[as_index(index)];
    model::joint_coordinates(joint, state, std::span(state.q).subspan(as_index(joint.first_dof)));
    model::joint_rates(joint, state, std::span(state.u).subspan(as_index(joint.first_dof)));
  }
}

void Mechanism::store_state(model::State& state) const {
  kernel_->bodies(*tree_);
  in_lanes([&]<int W>(const LaneTreeOf<W>& tree) {
    const Work<W>* const works = thread_work<W>(as_index(tree.batches));
    for (const Carried& each : carried_) {
      const Frame<W>& frame = tree.batch[each.batch].frame;
      const Work<W>& found = works[each.batch];
      model::BodyState& body = state.bodies[as_index(each.body)];
      for (std::size_t k = 0; k < 3; ++k)
        body.p[static_cast<Eigen::Index>(k)] = each.origin[k * each.stride] + frame.p[k][each.lane];
      body.q = get4(found.A, each.lane);
      body.v = get3(found.p, each.lane);
      body.w = get3(frame.v, each.lane);
    }
  });
}

}  // namespace handsim::engine::articulated
