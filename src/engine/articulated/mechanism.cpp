#include "handsim/engine/articulated/mechanism.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <new>

#include "handsim/engine/articulated/spin.h"
#include "handsim/model/kinematics.h"

namespace handsim::engine::articulated {

namespace {

constexpr std::size_t kAlignment = 64;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

bool single(NodeKind kind) { return kind == NodeKind::revolute || kind == NodeKind::prismatic; }

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

template <int W>
void put3(Lane<W>* to, int lane, const Vec3& v) {
  for (int i = 0; i < 3; ++i) to[i][lane] = v[i];
}
template <int W>
void put4(Lane<W>* to, int lane, const Quat& q) {
  for (int i = 0; i < 4; ++i) to[i][lane] = q.coeffs()[i];
}
template <int W>
Vec3 get3(const Lane<W>* from, int lane) {
  return {from[0][lane], from[1][lane], from[2][lane]};
}
template <int W>
Quat get4(const Lane<W>* from, int lane) {
  return {from[3][lane], from[0][lane], from[1][lane], from[2][lane]};
}

/// Calls f with the width as a compile-time number.
template <class F>
decltype(auto) of_width(int width, F&& f) {
  switch (width) {
    case 2:
      return f(std::integral_constant<int, 2>());
    case 4:
      return f(std::integral_constant<int, 4>());
    case 8:
      return f(std::integral_constant<int, 8>());
    default:
      return f(std::integral_constant<int, 1>());
  }
}

}  // namespace

/// Typed views of a mechanism of width W.
template <int W>
struct Mechanism::In {
  explicit In(const Mechanism& m)
      : batch(static_cast<Batch<W>*>(m.tree_.batch)),
        axis(static_cast<Axis<W>*>(m.tree_.axis)),
        joint3(static_cast<Joint3<W>*>(m.tree_.joint3)),
        base(static_cast<Frame<W>*>(m.tree_.base)) {}
  Batch<W>* batch;
  Axis<W>* axis;
  Joint3<W>* joint3;
  Frame<W>* base;

  static void empty(Batch<W>& b) {
    for (int lane = 0; lane < W; ++lane) {
      put4<W>(b.before, lane, Quat::Identity());
      put4<W>(b.turned, lane, Quat(0, 0, 0, 1));
      put3<W>(b.direction, lane, Vec3::UnitZ());
      b.mass[lane] = 1;
      put3<W>(b.inertia, lane, Vec3::Ones());
    }
  }
  static void fill(Batch<W>& b, int lane, const Node& node) {
    put4<W>(b.before, lane, node.before);
    put4<W>(b.turned, lane, node.turned);
    put3<W>(b.direction, lane, node.axis);
    put3<W>(b.anchor, lane, node.anchor);
    put3<W>(b.arm, lane, node.arm);
    b.mass[lane] = node.mass;
    put3<W>(b.inertia, lane, node.inertia);
  }
  static void fill(Axis<W>& a, int lane, const model::JointAxis& axis, const model::Effects& effects) {
    a.present[lane] = 1;
    if (axis.stop && effects.has(model::Effect::joint_stops)) {
      a.low[lane] = axis.stop->low;
      a.high[lane] = axis.stop->high;
      a.bounce[lane] = axis.stop->bounce;
    }
    if (axis.tissue && effects.has(model::Effect::passive_tissue)) {
      a.stiffness[lane] = axis.tissue->stiffness;
      a.damping[lane] = axis.tissue->damping;
      a.rest[lane] = axis.tissue->rest;
    }
  }
};

NodeView Mechanism::view(std::size_t node) const {
  return of_width(kernel_->width, [&](auto w) {
    constexpr int W = w;
    const In<W> in(*this);
    const Seat& seat = seats_[node];
    const Batch<W>& b = in.batch[seat.batch];
    const auto lane = [&](const Lane<W>& first) { return &first[0] + seat.lane; };
    NodeView out;
    out.h = lane(b.h[0]);
    out.I = lane(b.I[0]);
    out.mass = lane(b.mass);
    out.c = lane(b.c[0]);
    out.pv = lane(b.pv[0]);
    out.R = lane(b.frame.R[0]);
    out.p = lane(b.frame.p[0]);
    out.v = lane(b.frame.v[0]);
    if (b.link == ParentLink::base) out.base_a = lane(in.base[b.parent].a[0]);
    out.S = single(b.kind) ? lane(b.S[0]) : lane(in.joint3[b.axis].S[0][0]);
    if (!single(b.kind)) out.tau = lane(in.joint3[b.axis].tau[0]);
    out.q = tree_.q + seat.q;
    out.u = tree_.u + seat.u;
    out.du = tree_.du + seat.u;
    return out;
  });
}

AxisView Mechanism::axis_view(std::size_t node) const {
  return of_width(kernel_->width, [&](auto w) {
    constexpr int W = w;
    const In<W> in(*this);
    const Seat& seat = seats_[node];
    Axis<W>& a = in.axis[in.batch[seat.batch].axis];
    const int i = seat.lane;
    return AxisView{
        a.low + i,           a.high + i,        a.bounce + i,     a.weight + i,      a.servo_stiffness + i,
        a.servo_damping + i, a.servo_error + i, a.servo_feed + i, a.servo_limit + i, a.side + i,
        a.saturated + i};
  });
}

void Mechanism::AlignedDelete::operator()(void* memory) const {
  ::operator delete(memory, std::align_val_t(kAlignment));
}

/// Zeros.
void* Mechanism::allocate(std::size_t bytes) {
  bytes = std::max(bytes, kAlignment);
  memory_.emplace_back(::operator new(bytes, std::align_val_t(kAlignment)));
  std::fill_n(static_cast<std::byte*>(memory_.back().get()), bytes, std::byte{0});
  return memory_.back().get();
}

Mechanism::Mechanism(const model::Model& model, const Settings& settings, const Kernel* kernel)
    : model_(model),
      gravity_(settings.effects.has(model::Effect::gravity) ? model.gravity : Vec3::Zero()),
      topology_(make_topology(model)),
      kernel_(kernel && topology_.cuts.empty() ? kernel : &fitting(topology_)),
      bases_(model.bodies.size()) {
  tree_.erp = settings.erp;
  tree_.max_speed = kMaxSpeed;
  tree_.max_turn = kMaxAngularSpeed;
  seat_nodes(settings);
  std::vector<bool> parents(topology_.nodes.size(), false);
  for (const Node& node : topology_.nodes)
    if (node.parent) parents[at(*node.parent)] = true;
  // A ball's gyroscopic torque is zero.
  for (std::size_t i = 0; i < topology_.nodes.size(); ++i)
    if (const Node& node = topology_.nodes[i];
        node.kind == NodeKind::free && !parents[i] && node.inertia.maxCoeff() != node.inertia.minCoeff())
      lone_.push_back(static_cast<int>(i));
  for (std::size_t i = 0; i < topology_.nodes.size(); ++i)
    if (topology_.nodes[i].body)
      carried_.push_back({*topology_.nodes[i].body, static_cast<int>(i), topology_.nodes[i].q_LB});
}

void Mechanism::seat_nodes(const Settings& settings) {
  const std::size_t width = stride();
  for (const std::vector<int>& level : levels(topology_))
    for (std::size_t begin = 0; begin < level.size(); begin += width)
      chunks_.emplace_back(
          level.begin() + static_cast<std::ptrdiff_t>(begin),
          level.begin() + static_cast<std::ptrdiff_t>(std::min(level.size(), begin + width)));
  seats_.resize(topology_.nodes.size());
  std::size_t positions = 0, rates = 0;
  for (std::size_t b = 0; b < chunks_.size(); ++b) {
    const NodeKind kind = topology_.nodes[at(chunks_[b][0])].kind;
    for (std::size_t lane = 0; lane < chunks_[b].size(); ++lane)
      seats_[at(chunks_[b][lane])] = {static_cast<int>(b), static_cast<int>(lane), positions + lane,
                                      rates + lane};
    positions += at(position_count(kind)) * width;
    rates += at(rate_count(kind)) * width;
    ++(single(kind) ? axes_ : joints3_);
    if (!topology_.nodes[at(chunks_[b][0])].parent) ++base_frames_;
  }
  tree_.batches = static_cast<int>(chunks_.size());
  tree_.positions = static_cast<int>(positions);
  tree_.rates = static_cast<int>(rates);
  tree_.q = static_cast<double*>(allocate(positions * sizeof(double)));
  tree_.u = static_cast<double*>(allocate(rates * sizeof(double)));
  tree_.du = static_cast<double*>(allocate(rates * sizeof(double)));
  of_width(kernel_->width, [&](auto w) {
    constexpr int W = w;
    tree_.batch = allocate(chunks_.size() * sizeof(Batch<W>));
    tree_.axis = allocate(at(axes_) * sizeof(Axis<W>));
    tree_.joint3 = allocate(at(joints3_) * sizeof(Joint3<W>));
    tree_.base = allocate(at(base_frames_) * sizeof(Frame<W>));
    const In<W> in(*this);
    int axes = 0, joints3 = 0, frames = 0;
    std::size_t q = 0, u = 0;
    for (std::size_t i = 0; i < chunks_.size(); ++i) {
      Batch<W>& b = in.batch[i];
      const std::vector<int>& nodes = chunks_[i];
      const Node& first = topology_.nodes[at(nodes[0])];
      In<W>::empty(b);
      b.kind = first.kind;
      b.used = static_cast<int>(nodes.size());
      b.massless = std::none_of(nodes.begin(), nodes.end(),
                                [&](int node) { return topology_.nodes[at(node)].body.has_value(); });
      b.q = static_cast<int>(q);
      b.u = static_cast<int>(u);
      q += at(position_count(b.kind)) * W;
      u += at(rate_count(b.kind)) * W;
      b.axis = single(b.kind) ? axes++ : joints3++;
      if (single(b.kind)) {
        Axis<W>& a = in.axis[b.axis];
        for (int lane = 0; lane < W; ++lane) {
          a.low[lane] = -std::numeric_limits<double>::infinity();
          a.high[lane] = std::numeric_limits<double>::infinity();
        }
      } else {
        // Empty lanes stand at the identity.
        const int w_at = b.kind == NodeKind::ball ? 3 : 6;
        for (int lane = 0; lane < W; ++lane) tree_.q[b.q + w_at * W + lane] = 1;
        for (int lane = 0; lane < W; ++lane) in.joint3[b.axis].after[3][lane] = 1;
      }
      b.link = first.parent ? ParentLink::aligned : ParentLink::base;
      b.parent = first.parent ? seats_[at(*first.parent)].batch : frames;
      if (!first.parent) {
        Frame<W>& frame = in.base[frames++];
        for (int lane = 0; lane < W; ++lane) {
          put4<W>(frame.quat, lane, Quat::Identity());
          for (const int k : {0, 4, 8}) frame.R[k][lane] = 1;
        }
      }
      for (int lane = 0; lane < W; ++lane) {
        const bool present = lane < b.used;
        const Node& node = topology_.nodes[at(nodes[present ? at(lane) : 0])];
        if (node.parent) {
          const Seat& seat = seats_[at(*node.parent)];
          b.parent_batch[lane] = seat.batch;
          b.parent_lane[lane] = seat.lane;
          in.batch[seat.batch].has_children = true;
          if (present && (seat.batch != b.parent || seat.lane != lane)) b.link = ParentLink::gathered;
          // What stands in an empty lane must not be handed down to a node.
          if (!present && lane < in.batch[b.parent].used) b.link = ParentLink::gathered;
        }
        if (!present) continue;
        In<W>::fill(b, lane, node);
        if (node.kind == NodeKind::ball) {
          put4<W>(in.joint3[b.axis].after, lane, node.after);
          balls_.push_back(nodes[at(lane)]);
        }
        if (!single(node.kind)) continue;
        const model::Joint& joint = model_.joints[at(*node.joint)];
        In<W>::fill(in.axis[b.axis], lane, joint.axes[at(node.axis_index)], settings.effects);
        driven_.push_back({at(joint.first_dof + node.axis_index), static_cast<int>(i), b.axis, lane});
      }
    }
  });
}

Vec3 Mechanism::origin(int island) const {
  const std::size_t reference = at(topology_.reference[at(island)]);
  const Node& node = topology_.nodes[reference];
  if (node.kind == NodeKind::free) {
    const double* q = tree_.q + seats_[reference].q;
    return {q[0], q[stride()], q[2 * stride()]};
  }
  return bases_[at(node.base)].pose * node.anchor;
}

void Mechanism::settle_bases() {
  of_width(kernel_->width, [&](auto w) {
    constexpr int W = w;
    const In<W> in(*this);
    for (std::size_t i = 0; i < chunks_.size(); ++i) {
      const Batch<W>& b = in.batch[i];
      if (b.link != ParentLink::base) continue;
      Frame<W>& frame = in.base[b.parent];
      for (int lane = 0; lane < b.used; ++lane) {
        const Node& node = topology_.nodes[at(chunks_[i][at(lane)])];
        put3<W>(frame.a + 3, lane, -gravity_);
        if (node.kind == NodeKind::free) continue;
        const BaseMotion& base = bases_[at(node.base)];
        const Mat3 R = base.pose.q.toRotationMatrix();
        // The origin is `r` from the base's own.
        const Vec3 r = origin(node.island) - base.pose.p;
        put4<W>(frame.quat, lane, base.pose.q);
        for (int k = 0; k < 9; ++k) frame.R[k][lane] = R(k / 3, k % 3);
        put3<W>(frame.p, lane, -r);
        put3<W>(frame.v, lane, base.w);
        put3<W>(frame.v + 3, lane, base.v + base.w.cross(r));
        put3<W>(frame.a, lane, base.dw);
        // Spatial acceleration: of the flow of velocity at a fixed point (Featherstone 2008, eq. 2.48, p.
        // 28).
        put3<W>(frame.a + 3, lane, base.dv + base.dw.cross(r) - base.w.cross(base.v) - gravity_);
      }
    }
  });
}

void Mechanism::settle_spins(double step) {
  const std::size_t n = stride();
  for (const int index : lone_) {
    const Node& node = topology_.nodes[at(index)];
    const Seat& seat = seats_[at(index)];
    const double *q = tree_.q + seat.q + 3 * n, *u = tree_.u + seat.u;
    const Quat q_WL(q[3 * n], q[0], q[n], q[2 * n]);
    const Vec3 spin = q_WL.conjugate() * Vec3(u[0], u[n], u[2 * n]);
    if (spin.isZero(0)) continue;
    const std::optional<Vec3> end = spun(node.inertia, spin, step);
    if (!end) continue;
    const Vec3 torque = q_WL * Vec3(node.inertia.cwiseProduct(spin - *end) / step);
    of_width(kernel_->width, [&](auto w) {
      constexpr int W = w;
      put3<W>(In<W>(*this).batch[seat.batch].pv, seat.lane, torque);
    });
  }
}

void Mechanism::take_node(const Node& node, const Seat& seat, const model::State& state) {
  const std::size_t n = stride();
  double *q = tree_.q + seat.q, *u = tree_.u + seat.u;
  if (node.kind == NodeKind::free) {
    const model::BodyState& body = state.bodies[at(*node.body)];
    const Quat q_WL = body.q * node.q_LB.conjugate();
    for (std::size_t k = 0; k < 3; ++k) {
      q[k * n] = body.p[static_cast<Eigen::Index>(k)];
      u[k * n] = body.w[static_cast<Eigen::Index>(k)];
      u[(k + 3) * n] = body.v[static_cast<Eigen::Index>(k)];
    }
    for (std::size_t k = 0; k < 4; ++k) q[(k + 3) * n] = q_WL.coeffs()[static_cast<Eigen::Index>(k)];
    return;
  }
  const model::Joint& joint = model_.joints[at(*node.joint)];
  if (node.kind != NodeKind::ball) {
    std::array<double, 3> value{};
    model::joint_coordinates(joint, state, value);
    q[0] = value[at(node.axis_index)];
    model::joint_rates(joint, state, value);
    u[0] = value[at(node.axis_index)];
    return;
  }
  const model::BodyState& parent = state.bodies[at(node.reversed ? joint.child : joint.parent)];
  const model::BodyState& child = state.bodies[at(node.reversed ? joint.parent : joint.child)];
  const Quat q_WF = parent.q * (node.reversed ? joint.child_frame : joint.parent_frame).q;
  const Quat q_FM = q_WF.conjugate() * child.q * (node.reversed ? joint.parent_frame : joint.child_frame).q;
  const Vec3 w = q_WF.conjugate() * (child.w - parent.w);
  for (std::size_t k = 0; k < 4; ++k) q[k * n] = q_FM.normalized().coeffs()[static_cast<Eigen::Index>(k)];
  for (std::size_t k = 0; k < 3; ++k) u[k * n] = w[static_cast<Eigen::Index>(k)];
}

void Mechanism::take(const model::State& state) {
  for (std::size_t i = 0; i < bases_.size(); ++i)
    if (model_.bodies[i].kinematic)
      bases_[i] = {state.bodies[i].pose(), state.bodies[i].v, state.bodies[i].w, Vec3::Zero(), Vec3::Zero()};
  for (std::size_t i = 0; i < topology_.nodes.size(); ++i) take_node(topology_.nodes[i], seats_[i], state);
  settle_bases();
}

void Mechanism::give(model::State& state) const {
  of_width(kernel_->width, [&](auto w) {
    constexpr int W = w;
    const In<W> in(*this);
    for (const Carried& each : carried_) {
      const Seat& seat = seats_[at(each.node)];
      const Frame<W>& frame = in.batch[seat.batch].frame;
      model::BodyState& body = state.bodies[at(each.body)];
      const Vec3 p = get3<W>(frame.p, seat.lane), turn = get3<W>(frame.v, seat.lane);
      body.p = origin(topology_.nodes[at(each.node)].island) + p;
      body.q = (get4<W>(frame.quat, seat.lane) * each.q_LB).normalized();
      body.v = get3<W>(frame.v + 3, seat.lane) + turn.cross(p);
      body.w = turn;
    }
  });
}

void Mechanism::set_torques(std::span<const double> torques) {
  of_width(kernel_->width, [&](auto w) {
    constexpr int W = w;
    const In<W> in(*this);
    for (const Driven& each : driven_)
      in.axis[each.axis].tau[each.lane] = torques.empty() ? 0 : torques[each.dof];
    for (const int ball : balls_) {
      const Node& node = topology_.nodes[at(ball)];
      const Seat& seat = seats_[at(ball)];
      Vec3 tau = Vec3::Zero();
      if (!torques.empty()) {
        const auto first = at(model_.joints[at(*node.joint)].first_dof);
        tau = {torques[first], torques[first + 1], torques[first + 2]};
      }
      // The model's torque acts on its child, in its F.
      if (node.reversed) {
        const double* q = tree_.q + seat.q;
        const std::size_t n = stride();
        tau = -(Quat(q[3 * n], q[0], q[n], q[2 * n]) * tau);
      }
      put3<W>(in.joint3[in.batch[seat.batch].axis].tau, seat.lane, tau);
    }
  });
}

bool Mechanism::set_servos(std::span<const model::Servo> servos, bool absolute) {
  if (servos.empty() && servos_at_rest_) return true;
  servos_at_rest_ = servos.empty();
  return of_width(kernel_->width, [&](auto w) {
    constexpr int W = w;
    const In<W> in(*this);
    bool sound = true;
    for (const Driven& each : driven_) {
      Axis<W>& a = in.axis[each.axis];
      const int lane = each.lane;
      const model::Servo servo = servos.empty() ? model::Servo{} : servos[each.dof];
      const bool on = servo.limit != 0;
      a.servo_stiffness[lane] = on ? servo.stiffness : 0;
      a.servo_damping[lane] = on ? servo.damping : 0;
      a.servo_error[lane] = on ? servo.error : 0;
      a.servo_feed[lane] = on ? servo.feed : 0;
      a.servo_limit[lane] = servo.limit;
      if (!on) a.saturated[lane] = 0;
      if (absolute && on) a.servo_error[lane] += tree_.q[in.batch[each.batch].q + lane];
      const double sum = servo.stiffness + servo.damping;
      // Written so that NaN fails.
      sound = sound && (!on || (servo.stiffness >= 0 && servo.damping >= 0 && sum > 0 && servo.limit > 0 &&
                                std::isfinite(sum) && std::isfinite(servo.error + servo.feed)));
    }
    return sound;
  });
}

int Mechanism::stops_in_force() const {
  return of_width(kernel_->width, [&](auto w) {
    constexpr int W = w;
    const In<W> in(*this);
    int count = 0;
    for (int i = 0; i < axes_; ++i)
      for (int lane = 0; lane < W; ++lane) count += in.axis[i].side[lane] != 0 ? 1 : 0;
    return count;
  });
}

void Mechanism::forget_contacts() {
  of_width(kernel_->width, [&](auto w) {
    constexpr int W = w;
    const In<W> in(*this);
    for (int i = 0; i < axes_; ++i)
      for (int lane = 0; lane < W; ++lane) in.axis[i].side[lane] = in.axis[i].saturated[lane] = 0;
  });
}

template <class Archive, class Self>
void Mechanism::carry(Archive& archive, Self& self) {
  const std::size_t n = self.stride();
  for (std::size_t i = 0; i < self.seats_.size(); ++i) {
    const Seat& seat = self.seats_[i];
    const NodeKind kind = self.topology_.nodes[i].kind;
    for (std::size_t k = 0; k < at(position_count(kind)); ++k) archive(self.tree_.q[seat.q + k * n]);
    for (std::size_t k = 0; k < at(rate_count(kind)); ++k) archive(self.tree_.u[seat.u + k * n]);
  }
  for (auto& base : self.bases_) {
    archive(base.pose.p);
    archive(base.pose.q);
    for (auto* v : {&base.v, &base.w, &base.dv, &base.dw}) archive(*v);
  }
  of_width(self.kernel_->width, [&](auto w) {
    const In<w> in(self);
    for (const Driven& each : self.driven_) {
      archive(in.axis[each.axis].side[each.lane]);
      archive(in.axis[each.axis].saturated[each.lane]);
    }
  });
}

void Mechanism::save(ArchiveWriter& out) const { carry(out, *this); }

void Mechanism::restore(ArchiveReader& in) {
  carry(in, *this);
  // Values that no solution leaves would never be put right.
  of_width(kernel_->width, [&](auto w) {
    const In<w> of(*this);
    for (const Driven& each : driven_)
      for (const double value : {of.axis[each.axis].side[each.lane], of.axis[each.axis].saturated[each.lane]})
        if (value != 0 && std::abs(value) != 1) in.refuse("a stop that is in force by half", "-1, 0 or 1");
  });
  settle_bases();
  // The tree holds what it was last told, not what the next step is told.
  servos_at_rest_ = false;
}

}  // namespace handsim::engine::articulated
