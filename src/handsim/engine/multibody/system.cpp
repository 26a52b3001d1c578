#include "handsim/engine/multibody/system.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Cholesky>

#include "handsim/model/kinematics.h"

namespace handsim::engine {

System::System(const model::Model& model, const Settings& settings, std::vector<int> bodies,
               std::vector<const model::Joint*> joints)
    : model_(model),
      settings_(settings),
      bodies_(std::move(bodies)),
      slot_of_(model.bodies.size()),
      joints_(std::move(joints)) {
  for (const int index : bodies_) {
    slot_of_[as_index(index)] = static_cast<Index>(mass_.size());
    const model::Body& each = model.bodies[as_index(index)];
    mass_.push_back(each.mass);
    inertia_.push_back(each.inertia);
    inverse_inertia_.push_back(each.inertia.inverse());
    const Mat3 lower = each.inertia.llt().matrixL();
    root_.push_back(lower.transpose().inverse());
  }
  for (const model::Joint* joint : joints_)
    joint_of_row_.insert(joint_of_row_.end(), as_index(engine::constraint_count(joint->kind)), joint);
  constraint_count_ = static_cast<Index>(joint_of_row_.size());
}

const model::BodyState& System::body(const model::State& state, Index slot) const {
  return state.bodies[as_index(bodies_[as_index(slot)])];
}

model::BodyState& System::body(model::State& state, Index slot) const {
  return state.bodies[as_index(bodies_[as_index(slot)])];
}

const std::string& System::body_name(Index slot) const {
  return model_.bodies[as_index(bodies_[as_index(slot)])].name;
}

void System::place_driven(double time, model::KeySide side, model::State& state) const {
  if (!settings_.effects.has(model::Effect::wrist_motion)) return;
  for (const model::Drive& drive : model_.drives) {
    const Pose x_WD = drive.motion.at(time), x_WB = x_WD * drive.frame.inverse();
    const model::PoseRate rate = drive.motion.rate(time, side);
    // The origin of the driven frame D is not the centre of mass.
    state.bodies[as_index(drive.body)] = {x_WB.p, x_WB.q, rate.v + rate.w.cross(x_WB.p - x_WD.p), rate.w};
  }
}

void System::set_driven_velocities(double end, double step, model::State& state) const {
  if (!settings_.effects.has(model::Effect::wrist_motion)) return;
  for (const model::Drive& drive : model_.drives) {
    model::BodyState& now = state.bodies[as_index(drive.body)];
    const Pose then = drive.motion.at(end) * drive.frame.inverse();
    now.v = (then.p - now.p) / step;
    now.w = rotation_vector(then.q * now.q.conjugate()) / step;
  }
}

double System::next_key(double time) const {
  double next = std::numeric_limits<double>::infinity();
  if (!settings_.effects.has(model::Effect::wrist_motion)) return next;
  for (const model::Drive& drive : model_.drives)
    for (const model::PoseKey& key : drive.motion.keys)
      if (key.time > time) next = std::min(next, key.time);
  return next;
}

Vector System::positions(const model::State& state) const {
  Vector x(kPoseSize * body_count());
  for (Index i = 0; i < body_count(); ++i) {
    x.segment<3>(kPoseSize * i) = body(state, i).p;
    x.segment<4>(kPoseSize * i + 3) = body(state, i).q.coeffs();
  }
  return x;
}

Vector System::velocities(const model::State& state) const {
  Vector u(kTwistSize * body_count());
  for (Index i = 0; i < body_count(); ++i) {
    u.segment<3>(kTwistSize * i) = body(state, i).v;
    u.segment<3>(kTwistSize * i + 3) = body(state, i).q.conjugate() * body(state, i).w;
  }
  return u;
}

void System::set_positions(const Vector& x, model::State& state) const {
  for (Index i = 0; i < body_count(); ++i) {
    body(state, i).p = x.segment<3>(kPoseSize * i);
    body(state, i).q.coeffs() = x.segment<4>(kPoseSize * i + 3).normalized();
  }
}

void System::set_velocities(const Vector& u, model::State& state) const {
  for (Index i = 0; i < body_count(); ++i) {
    body(state, i).v = u.segment<3>(kTwistSize * i);
    body(state, i).w = body(state, i).q * Vec3(u.segment<3>(kTwistSize * i + 3));
  }
}

void System::displace(const Vector& displacement, model::State& state) const {
  for (Index i = 0; i < body_count(); ++i) {
    model::BodyState& each = body(state, i);
    each.p += displacement.segment<3>(kTwistSize * i);
    each.q = (each.q * rotation_quaternion(displacement.segment<3>(kTwistSize * i + 3))).normalized();
  }
}

void System::displace_by_impulse(const Vector& displacement, const model::State& before, double step,
                                 model::State& after) const {
  for (Index i = 0; i < body_count(); ++i) {
    model::BodyState& each = body(after, i);
    const Vec3 shift = displacement.segment<3>(kTwistSize * i);
    const Vec3 turn = body(before, i).q * Vec3(displacement.segment<3>(kTwistSize * i + 3));
    each.p += shift;
    each.q = (rotation_quaternion(turn) * each.q).normalized();
    each.v += shift / step;
    each.w += turn / step;
  }
}

void System::copy_bodies(const model::State& from, model::State& to) const {
  for (Index i = 0; i < body_count(); ++i) body(to, i) = body(from, i);
}

Vector System::position_rates(const Vector& x, const Vector& u) const {
  Vector rates(x.size());
  for (Index i = 0; i < body_count(); ++i) {
    rates.segment<3>(kPoseSize * i) = u.segment<3>(kTwistSize * i);
    // q' = q (0, w) / 2 with w in body axes.
    const Vec3 w = u.segment<3>(kTwistSize * i + 3);
    const Quat q(Eigen::Vector4d(x.segment<4>(kPoseSize * i + 3)));
    rates.segment<4>(kPoseSize * i + 3) = 0.5 * (q * Quat(0, w.x(), w.y(), w.z())).coeffs();
  }
  return rates;
}

void System::constraints(const model::State& state, std::vector<ConstraintRow>& rows) const {
  rows.clear();
  for (const model::Joint* joint : joints_) append_constraints(*joint, state, rows);
}

Matrix System::jacobian(const std::vector<ConstraintRow>& rows, const model::State& state) const {
  Matrix out = Matrix::Zero(static_cast<Index>(rows.size()), kTwistSize * body_count());
  Vector row(out.cols());
  for (Index i = 0; i < out.rows(); ++i) {
    row.setZero();
    add_transposed(rows[as_index(i)], 1, state, row);
    out.row(i) = row.transpose();
  }
  return out;
}

void System::add_transposed(const ConstraintRow& row, double scale, const model::State& state,
                            Vector& out) const {
  const auto add = [&](int index, const Vec3& v, const Vec3& w) {
    const std::optional<Index> slot = slot_of_[as_index(index)];
    if (!slot) return;
    out.segment<3>(kTwistSize * *slot) += scale * v;
    out.segment<3>(kTwistSize * *slot + 3) += scale * (body(state, *slot).q.conjugate() * w);
  };
  add(row.parent, row.parent_v, row.parent_w);
  add(row.child, row.child_v, row.child_w);
}

double System::own_rate(const ConstraintRow& row, const Vector& u, const model::State& state) const {
  Vector transposed = Vector::Zero(u.size());
  add_transposed(row, 1, state, transposed);
  return transposed.dot(u);
}

Vector System::forces(const model::State& state, std::span<const double> torques) const {
  Vector out(kTwistSize * body_count());
  const Vec3 gravity = settings_.effects.has(model::Effect::gravity) ? model_.gravity : Vec3::Zero();
  for (Index i = 0; i < body_count(); ++i) {
    const Vec3 w = body(state, i).q.conjugate() * body(state, i).w;
    out.segment<3>(kTwistSize * i) = mass_[as_index(i)] * gravity;
    out.segment<3>(kTwistSize * i + 3) = -w.cross(inertia(i) * w);
  }
  if (torques.empty()) return out;
  for (const model::Joint* joint : joints_)
    for (int k = 0; k < dof_count(joint->kind); ++k) {
      const double torque = torques[as_index(joint->first_dof) + as_index(k)];
      if (torque != 0) add_transposed(coordinate_row(*joint, k, state), torque, state, out);
    }
  return out;
}

std::vector<TissueRow> System::tissue(const model::State& state) const {
  std::vector<TissueRow> out;
  const bool with_tissue = settings_.effects.has(model::Effect::passive_tissue);
  if (!with_tissue && drag_.empty()) return out;
  for (const model::Joint* joint : joints_) {
    double q[3] = {};
    bool known = false;
    for (std::size_t k = 0; k < joint->axes.size(); ++k) {
      model::Tissue each;
      if (with_tissue && joint->axes[k].tissue) each = *joint->axes[k].tissue;
      if (!drag_.empty()) each.damping += drag_[as_index(joint->first_dof) + k];
      if (each.stiffness == 0 && each.damping == 0) continue;
      if (!known) model::joint_coordinates(*joint, state, q);
      known = true;
      out.push_back({coordinate_row(*joint, static_cast<int>(k), state), q[k] - each.rest, each});
    }
  }
  return out;
}

Vector System::all_forces(const model::State& state, std::span<const double> torques) const {
  Vector out = forces(state, torques);
  for (const TissueRow& each : tissue(state)) {
    const double pull = each.tissue.stiffness * each.deviation + each.tissue.damping * rate(each.row, state);
    add_transposed(each.row, -pull, state, out);
  }
  return out;
}

Matrix System::mass_matrix() const {
  Matrix out = Matrix::Zero(kTwistSize * body_count(), kTwistSize * body_count());
  for (Index i = 0; i < body_count(); ++i) {
    out.block<3, 3>(kTwistSize * i, kTwistSize * i) = mass_[as_index(i)] * Mat3::Identity();
    out.block<3, 3>(kTwistSize * i + 3, kTwistSize * i + 3) = inertia(i);
  }
  return out;
}

Vector System::times_mass(const Vector& u) const {
  Vector out(u.size());
  for (Index i = 0; i < body_count(); ++i) {
    out.segment<3>(kTwistSize * i) = mass_[as_index(i)] * u.segment<3>(kTwistSize * i);
    out.segment<3>(kTwistSize * i + 3) = inertia(i) * u.segment<3>(kTwistSize * i + 3);
  }
  return out;
}

Vector System::over_mass(const Vector& force) const {
  Vector out(force.size());
  for (Index i = 0; i < body_count(); ++i) {
    out.segment<3>(kTwistSize * i) = force.segment<3>(kTwistSize * i) / mass_[as_index(i)];
    out.segment<3>(kTwistSize * i + 3) = inverse_inertia_[as_index(i)] * force.segment<3>(kTwistSize * i + 3);
  }
  return out;
}

Vector System::from_scaled(const Vector& z) const {
  Vector out(z.size());
  for (Index i = 0; i < body_count(); ++i) {
    out.segment<3>(kTwistSize * i) = z.segment<3>(kTwistSize * i) / std::sqrt(mass_[as_index(i)]);
    out.segment<3>(kTwistSize * i + 3) = root_[as_index(i)] * z.segment<3>(kTwistSize * i + 3);
  }
  return out;
}

Matrix System::scaled(const Matrix& jacobian) const {
  Matrix out(jacobian.rows(), jacobian.cols());
  for (Index i = 0; i < body_count(); ++i) {
    out.middleCols<3>(kTwistSize * i) =
        jacobian.middleCols<3>(kTwistSize * i) / std::sqrt(mass_[as_index(i)]);
    out.middleCols<3>(kTwistSize * i + 3) = jacobian.middleCols<3>(kTwistSize * i + 3) * root_[as_index(i)];
  }
  return out;
}

std::vector<System> islands(const model::Model& model, const Settings& settings) {
  const auto moves = [&](int body) {
    return !model.bodies[as_index(body)].kinematic && body != model::kWorld;
  };
  // Disjoint sets: each body refers to another of its island; a joint between moving bodies merges theirs.
  std::vector<int> root(model.bodies.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](int body) {
    while (root[as_index(body)] != body) body = root[as_index(body)];
    return body;
  };
  for (const model::Joint& joint : model.joints)
    if (moves(joint.parent) && moves(joint.child)) root[as_index(find(joint.child))] = find(joint.parent);
  std::vector<System> out;
  const int bodies = static_cast<int>(model.bodies.size());
  for (int island = 1; island < bodies; ++island) {
    if (!moves(island) || find(island) != island) continue;
    std::vector<int> members;
    for (int i = 1; i < bodies; ++i)
      if (moves(i) && find(i) == island) members.push_back(i);
    std::vector<const model::Joint*> joints;
    for (const model::Joint& joint : model.joints) {
      const int mover = moves(joint.child) ? joint.child : joint.parent;
      if (moves(mover) && find(mover) == island) joints.push_back(&joint);
    }
    out.emplace_back(model, settings, std::move(members), std::move(joints));
  }
  return out;
}

}  // namespace handsim::engine
