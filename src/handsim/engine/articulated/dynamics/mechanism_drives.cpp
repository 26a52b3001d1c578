// What acts on a mechanism's coordinates from step to step: torques, servos, stops in force; and its archive.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "handsim/engine/articulated/dynamics/mechanism.h"
#include "handsim/engine/articulated/dynamics/mechanism_lanes.h"
#include "handsim/engine/articulated/dynamics/spin.h"
#include "handsim/engine/spring.h"

namespace handsim::engine::articulated {

void Mechanism::set_torques(std::span<const double> torques) {
  if (torques.empty() && torques_at_rest_ && balls_.empty()) return;
  torques_at_rest_ = torques.empty();
  in_lanes([&](const auto& in) {
    for (const int single : singles_) {
      const LaneSlot& slot = slots_[as_index(single)];
      in.axis[slot.axis].tau[slot.lane] = torques.empty() ? 0 : torques[slot.dof];
    }
    for (const int ball : balls_) {
      const Node& node = topology_.nodes[as_index(ball)];
      const LaneSlot& slot = slots_[as_index(ball)];
      Vec3 tau = Vec3::Zero();
      if (!torques.empty()) {
        tau = {torques[slot.dof], torques[slot.dof + 1], torques[slot.dof + 2]};
      }
      for (std::size_t k = 0; k < 3; ++k)
        tree_->tau[slot.u + k * stride()] = tau[static_cast<Eigen::Index>(k)];
      // The model's torque acts on its child, in its F.
      if (node.reversed) {
        const double* q = tree_->q + slot.q;
        const std::size_t n = stride();
        tau = -(Quat(q[3 * n], q[0], q[n], q[2 * n]) * tau);
      }
      put3(in.joint3[slot.axis].tau, slot.lane, tau);
    }
  });
}

void Mechanism::set_servos(std::span<const model::Servo> servos, std::optional<double> step) {
  if (servos.empty() && servos_at_rest_) return;
  servos_at_rest_ = servos.empty();
  const double h = step.value_or(0);
  const model::Servo none;
  in_lanes([&](const auto& in) {
    for (const int single : singles_) {
      const LaneSlot& slot = slots_[as_index(single)];
      auto& a = in.axis[slot.axis];
      const int lane = slot.lane;
      const model::Servo& given = servos.empty() ? none : servos[slot.dof];
      const model::Servo& servo = given.limit != 0 ? given : none;
      a.servo_stiffness[lane] = servo.stiffness;
      a.servo_damping[lane] = damping_beside(servo.stiffness, servo.damping, h);
      a.servo_error[lane] = servo.error;
      if (!step && servo.limit != 0) a.servo_error[lane] += tree_->q[slot.q];
      a.servo_feed[lane] = servo.feed;
      a.servo_limit[lane] = servo.limit;
      if (servo.limit == 0) a.saturated[lane] = 0;
    }
  });
}

/// As bias forces: the wrench about the island's origin, taken from the velocity products'.
void Mechanism::add_forces(std::span<const BodyForce> forces) {
  in_lanes([&](const auto& in) {
    for (const BodyForce& each : forces) {
      const LaneSlot& slot = slots_[as_index(topology_.node_of_body[as_index(each.body)])];
      auto& b = in.batch[slot.batch];
      const Vec3 p = get3(b.frame.p, slot.lane);
      const Vec3 moment = each.moment + p.cross(each.force);
      put3(b.pv, slot.lane, get3(b.pv, slot.lane) - moment);
      put3(b.pv + 3, slot.lane, get3(b.pv + 3, slot.lane) - each.force);
    }
  });
}

void Mechanism::update_gyroscopic_torques(double step) {
  const std::size_t n = stride();
  for (const int index : single_bodies_) {
    const Node& node = topology_.nodes[as_index(index)];
    const LaneSlot& slot = slots_[as_index(index)];
    const double *q = tree_->q + slot.q + 3 * n, *u = tree_->u + slot.u;
    const Quat q_WL(q[3 * n], q[0], q[n], q[2 * n]);
    const std::optional<Vec3> torque = gyroscopic_torque(node.inertia, q_WL, {u[0], u[n], u[2 * n]}, step);
    if (!torque) continue;
    in_lanes([&](const auto& in) { put3(in.batch[slot.batch].pv, slot.lane, *torque); });
  }
}

int Mechanism::stops_in_force() const {
  return in_lanes([]<int W>(const LaneTreeOf<W>& tree) {
    Lane<W> in_force{};
    for (int i = 0; i < tree.batches; ++i)
      if (single(tree.batch[i].kind))
        for (int lane = 0; lane < W; ++lane) {
          const double side = tree.axis[tree.batch[i].axis].side[lane];
          in_force[lane] += side * side;
        }
    return static_cast<int>(std::accumulate(in_force, in_force + W, 0.0));
  });
}

void Mechanism::forget_limits() {
  in_lanes([&]<int W>(const LaneTreeOf<W>& tree) {
    for (const int single : singles_)
      Axis<W>::each_kept([&](auto field) {
        (tree.axis[slots_[as_index(single)].axis].*field)[slots_[as_index(single)].lane] = 0;
      });
  });
}

template <class Archive, class Self>
void Mechanism::serialize(Archive& archive, Self& self) {
  const std::size_t n = self.stride();
  for (std::size_t i = 0; i < self.slots_.size(); ++i) {
    const LaneSlot& slot = self.slots_[i];
    const NodeKind kind = self.topology_.nodes[i].kind;
    for (std::size_t k = 0; k < as_index(position_count(kind)); ++k) archive(self.tree_->q[slot.q + k * n]);
    for (std::size_t k = 0; k < as_index(rate_count(kind)); ++k) archive(self.tree_->u[slot.u + k * n]);
  }
  for (auto& base : self.bases_) {
    archive(base.pose.p, base.pose.q);
    for (auto* v : {&base.v, &base.w, &base.dv, &base.dw}) archive(*v);
  }
  self.in_lanes([&]<int W>(const LaneTreeOf<W>& tree) {
    for (const int single : self.singles_)
      Axis<W>::each_kept([&](auto field) {
        archive((tree.axis[self.slots_[as_index(single)].axis].*field)[self.slots_[as_index(single)].lane]);
      });
  });
}

void Mechanism::save(ArchiveWriter& out) const { serialize(out, *this); }

void Mechanism::restore(ArchiveReader& in) {
  serialize(in, *this);
  // Values that no solution leaves would never be put right.
  in_lanes([&]<int W>(const LaneTreeOf<W>& tree) {
    for (const int single : singles_)
      Axis<W>::each_kept([&](auto field) {
        const double value = (tree.axis[slots_[as_index(single)].axis].*field)[slots_[as_index(single)].lane];
        if (value != 0 && std::abs(value) != 1) in.refuse("a stop that is in force by half", "-1, 0 or 1");
      });
  });
  update_bases();
  // The tree has the torques and servos of another state's last step.
  torques_at_rest_ = servos_at_rest_ = false;
}

}  // namespace handsim::engine::articulated
