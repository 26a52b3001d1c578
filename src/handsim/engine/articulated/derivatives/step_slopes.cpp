#include "handsim/engine/articulated/derivatives/step_slopes.h"

#include <algorithm>
#include <cmath>

#include "handsim/engine/articulated/dynamics/spin.h"
#include "handsim/model/kinematics.h"

namespace handsim::engine::articulated {

namespace {

/// A servo whose distance to its limit is this small a share of it is at its edge.
constexpr double kEdge = 1e-6;
constexpr double kOnStop = 1e-9;  ///< Nearer to its stop, a coordinate is on it [rad], [m].

}  // namespace

StepSlopes::StepSlopes(const model::Model& model, const Settings& settings, Mechanism& mechanism,
                       MuscleCoupling* muscles, ContactDynamics* contact)
    : model_(model), settings_(settings), mechanism_(mechanism), muscles_(muscles), tree_(mechanism) {
  if (contact) contacts_.emplace(model, mechanism, *contact, tree_);
  order();
  du_.resize(as_index(tree_.size()));
  q_.resize(as_index(model.dof_count()));
  u_.resize(as_index(model.dof_count()));
}

/// Coordinates: joints as in the model, then free bodies.
void StepSlopes::order() {
  const std::vector<Node>& nodes = mechanism_.topology().nodes;
  dof_of_.assign(as_index(model_.dof_count()), kNoDof);
  rate_.resize(as_index(tree_.size()));
  for (int i = 0; i < static_cast<int>(nodes.size()); ++i) {
    const Node& node = nodes[as_index(i)];
    for (int k = 0; k < rate_count(node.kind); ++k)
      rate_[as_index(tree_.first_dof(i) + k)] =
          mechanism_.slot(as_index(i)).u + as_index(k) * mechanism_.stride();
    if (!node.joint) continue;
    const model::Joint& joint = model_.joints[as_index(*node.joint)];
    const std::size_t first = as_index(joint.first_dof + node.axis_index);
    for (int k = 0; k < rate_count(node.kind); ++k) dof_of_[first + as_index(k)] = tree_.first_dof(i) + k;
    if (node.kind == NodeKind::ball) continue;
    singles_.push_back({tree_.first_dof(i), first, mechanism_.view(as_index(i))});
    const model::JointAxis& axis = joint.axes[as_index(node.axis_index)];
    if (!axis.tissue || !settings_.effects.has(model::Effect::passive_tissue)) continue;
    singles_.back().stiffness = axis.tissue->stiffness;
    singles_.back().damping = axis.tissue->damping;
  }
  free_bodies_ = model::free_bodies(model_);
  for (const int body : free_bodies_)
    for (int k = 0; k < 6; ++k)
      dof_of_.push_back(tree_.first_dof(mechanism_.topology().node_of_body[as_index(body)]) + k);
}

/// As `Scene.coordinates` of the package has it.
std::string StepSlopes::name_of(const Single& each) const {
  for (const model::Joint& joint : model_.joints)
    if (const std::size_t first = as_index(joint.first_dof);
        each.coordinate >= first && each.coordinate < first + joint.axes.size())
      return joint.name + "." + joint.axes[each.coordinate - first].name;
  return {};
}

/// K without servos and contacts.
void StepSlopes::compute_inertia() {
  const double h = settings_.step;
  for (std::size_t i = 0; i < du_.size(); ++i) du_[i] = mechanism_.du()[rate_[i]];
  tree_.find(du_);
  K_ = tree_.inertia();
  for (const Single& each : singles_) K_(each.dof, each.dof) += h * (h * each.stiffness + each.damping);
  if (muscles_)
    muscles_->each_slope([&](int i, int j, double slope) {
      K_(i, j) += h * slope;
      if (i != j) K_(j, i) += h * slope;
    });
}

bool StepSlopes::refine() {
  compute_inertia();
  return contacts_->refine(K_, settings_.step);
}

void StepSlopes::find(const StepInput& input, const model::State& start, bool contacts,
                      StepDerivatives& out) {
  out.coordinates = tree_.size();
  out.free_bodies = free_bodies_;
  out.notes.clear();
  const double h = settings_.step;
  Eigen::MatrixXd load;
  if (!out.feedback.compensated.empty()) {
    tree_.find(du_, false, out.feedback.gravity);
    load = tree_.by_position();
  }
  compute_inertia();
  by_q_ = h * tree_.by_position();
  by_u_ = h * tree_.by_rate();
  for (int node = 0; node < static_cast<int>(mechanism_.topology().nodes.size()); ++node)
    if (mechanism_.is_single_body(as_index(node))) add_lone(node);
  add_singles(out);
  for (const Single& each : singles_)
    if (load.size() > 0 && out.feedback.compensated[each.coordinate] && out.driven[each.coordinate])
      by_q_.row(each.dof) -= h * load.row(each.dof);
  if (!input.forces.empty()) add_forces(input);
  if (muscles_) add_muscles(input, start, out);
  // Rates change F as x does but for this: large stiffness cancels out.
  by_u_ = K_ - by_u_;
  if (contacts) {
    Eigen::MatrixXd bounces = Eigen::MatrixXd::Zero(by_u_.rows(), by_u_.cols());
    contacts_->add_stiffness(K_);
    contacts_->add_slopes(start, h, by_q_, bounces);
    by_u_ -= bounces;
    out.notes.insert(out.notes.end(), contacts_->notes().begin(), contacts_->notes().end());
  }
  solve(out);
}

/// Springs, dampers and drives of single coordinates.
void StepSlopes::add_singles(StepDerivatives& out) {
  const double h = settings_.step;
  out.driven.assign(dof_of_.size(), 1);
  for (const Single& each : singles_) {
    const int i = each.dof;
    by_q_(i, i) += h * each.stiffness;
    by_u_(i, i) += h * (h * each.stiffness + each.damping);
    const double rate = *each.view.u + h * du_[as_index(i)];
    if (std::abs(each.room(*each.view.q)) <= kOnStop &&
        (each.held() || each.room(*each.view.q + h * rate) <= kOnStop))
      out.notes.push_back(name_of(each) + ": on its stop: one-sided, for positions within the range");
    if (const model::Servo servo = each.view.servo(); servo.limit > 0) {
      out.driven[each.coordinate] = each.in_range();
      const double pull = servo.pull(h * rate, rate);
      if (std::abs(std::abs(pull) - servo.limit) <= kEdge * servo.limit)
        out.notes.push_back(name_of(each) + ": its servo is at its limit: one-sided");
      if (!each.in_range()) continue;
      K_(i, i) += h * servo.slope(h);
      by_u_(i, i) += h * servo.slope(h);
    }
    if (!out.feedback.by_q.empty()) by_q_(i, i) -= h * out.feedback.by_q[each.coordinate];
  }
}

/// A free body that carries nothing has the gyroscopic torque of an implicit step (spin.h): with w in its
/// axes, F = R (I x + I (w - W(w))).
void StepSlopes::add_lone(int node) {
  const Node& of = mechanism_.topology().nodes[as_index(node)];
  const NodeView& view = mechanism_.view(as_index(node));
  const std::size_t s = mechanism_.stride();
  const Mat3 R = Quat(view.q[6 * s], view.q[3 * s], view.q[4 * s], view.q[5 * s]).toRotationMatrix();
  const Mat3 I = of.inertia.asDiagonal();
  const Vec3 w = read3(view.u, s), spin = R.transpose() * w;
  const int first = tree_.first_dof(node);
  const Vec3 x = settings_.step * Vec3::Map(&du_[as_index(first)]);
  Vec3 y = Vec3::Zero();
  Mat3 slope = Mat3::Zero();
  const std::optional<Vec3> end = spin.isZero(0) ? spin : spun(of.inertia, spin, settings_.step);
  if (end) {
    y = I * (spin - *end);
    slope = I * (Mat3::Identity() - spun_slope(of.inertia, *end, settings_.step));
  }
  const Mat3 inertia = R * I * R.transpose();
  for (auto* each : {&by_q_, &by_u_})
    each->middleCols(first, 6).setZero(), each->middleRows(first, 6).setZero();
  by_q_.block<3, 3>(first, first) = inertia * cross_matrix(x) - cross_matrix(inertia * x + R * y) +
                                    R * slope * R.transpose() * cross_matrix(w);
  by_u_.block<3, 3>(first, first) = R * slope * R.transpose();
}

/// Forces at mass centres, which move.
void StepSlopes::add_forces(const StepInput& input) {
  for (const BodyForce& each : input.forces) {
    const int node = mechanism_.topology().node_of_body[as_index(each.body)];
    const Vec3 p = read3(mechanism_.view(as_index(node)).p, mechanism_.stride());
    Spatial wrench;
    wrench << each.moment + p.cross(each.force), each.force;
    for (int i = tree_.last_dof(node); i != kNoDof; i = tree_.parent_dof(i))
      for (int j = tree_.last_dof(node); j != kNoDof; j = tree_.parent_dof(j)) {
        const Vec3 turn = tree_.axis(i).head<3>();
        double change = turn.dot(Vec3(at_point(tree_.axis(j), p).tail<3>()).cross(each.force));
        if (tree_.moves_axis(j, i)) change += cross_motion(tree_.axis(j), tree_.axis(i)).dot(wrench);
        by_q_(i, j) -= settings_.step * change;
      }
  }
}

/// The row of a coordinate on its stop: x = bound(q, u).
void StepSlopes::hold(const Single& each) {
  const NodeView& a = each.view;
  const double h = settings_.step, side = *a.side,
               room = side < 0 ? *each.view.q - *a.low : *a.high - *each.view.q;
  const double share = room < -kOnStop ? settings_.erp() : 1, target = share * room / h,
               speed = side * *each.view.u;
  // A rebound ends on the opposite stop at the latest.
  const double across = (room - (*a.high - *a.low)) / h, rebound = -*a.restitution * speed;
  const bool bounces = speed > 0 && *a.restitution > 0 && rebound < target,
             free = bounces && rebound > across;
  const int i = each.dof;
  K_.row(i).setZero();
  by_q_.row(i).setZero();
  by_u_.row(i).setZero();
  K_(i, i) = 1;
  by_q_(i, i) = free ? 0 : (bounces ? 1 : share) / h;
  by_u_(i, i) = free ? -*a.restitution : 0;
  held_[each.coordinate] = 1;
}

/// How positions turn with the step: dq' = exp(h w') dq + h J(h w') du'.
void StepSlopes::compute_turns() {
  turns_.clear();
  for (std::size_t c = 0; c < dof_of_.size(); ++c) {
    const int node = tree_.node(dof_of_[c]);
    if (tree_.kind(node) == NodeKind::revolute || tree_.kind(node) == NodeKind::prismatic ||
        dof_of_[c] != tree_.first_dof(node))
      continue;
    Vec3 turn;
    for (int k = 0; k < 3; ++k)
      turn[k] =
          mechanism_.u()[rate_[as_index(dof_of_[c] + k)]] + settings_.step * du_[as_index(dof_of_[c] + k)];
    turn *= settings_.step;
    turns_.push_back(
        {c, {rotation_quaternion(turn).toRotationMatrix(), settings_.step * left_jacobian(turn)}});
  }
}

/// Coordinates that K or dF/dq join: each group is a system of its own.
void StepSlopes::collect_groups() {
  const std::size_t n = dof_of_.size();
  group_.resize(n);
  for (std::size_t i = 0; i < n; ++i) group_[i] = i;
  const auto find = [&](std::size_t i) {
    while (group_[i] != i) i = group_[i] = group_[group_[i]];
    return i;
  };
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = 0; i < n; ++i) {
      const int a = dof_of_[i], b = dof_of_[j];
      if (i != j && group_[i] != group_[j] && (K_(a, b) != 0 || by_q_(a, b) != 0)) group_[find(i)] = find(j);
    }
  groups_.assign(n, {});
  for (std::size_t i = 0; i < n; ++i) groups_[find(i)].push_back(static_cast<int>(i));
  std::erase_if(groups_, [](const std::vector<int>& each) { return each.empty(); });
}

/// dF by gravity, and by forces and moments on bodies: a row of each coordinate.
void StepSlopes::compute_loads(StepDerivatives& out) {
  const auto n = static_cast<Eigen::Index>(dof_of_.size());
  const double h = settings_.step;
  loads_.setZero(n, 3 + 6 * static_cast<Eigen::Index>(out.forced.size()));
  for (Eigen::Index c = 0; c < n && settings_.effects.has(model::Effect::gravity); ++c)
    loads_.block<1, 3>(c, 0) = h * tree_.carried(dof_of_[as_index(c)]);
  for (std::size_t k = 0; k < out.forced.size(); ++k) {
    const int node = mechanism_.topology().node_of_body[as_index(out.forced[k])];
    const Vec3 p = read3(mechanism_.view(as_index(node)).p, mechanism_.stride());
    for (int i = tree_.last_dof(node); i != kNoDof; i = tree_.parent_dof(i)) {
      const Eigen::Index c = std::ranges::find(dof_of_, i) - dof_of_.begin();
      const Spatial v = at_point(tree_.axis(i), p);
      loads_.block<1, 6>(c, 3 + 6 * static_cast<Eigen::Index>(k)) << h * v.tail<3>().transpose(),
          h * v.head<3>().transpose();
    }
  }
}

/// Changes of rates, u' in the lower half of the rows, of one group.
void StepSlopes::solve_group(const std::vector<int>& group, StepDerivatives& out) {
  const auto n = static_cast<Eigen::Index>(dof_of_.size()), m = static_cast<Eigen::Index>(group.size());
  const auto coordinate = [&](Eigen::Index i) { return static_cast<Eigen::Index>(group[as_index(i)]); };
  const auto dof = [&](Eigen::Index i) { return dof_of_[as_index(group[as_index(i)])]; };
  Eigen::MatrixXd K(m, m), Q(m, m), U(m, m);
  for (Eigen::Index j = 0; j < m; ++j)
    for (Eigen::Index i = 0; i < m; ++i) {
      K(i, j) = K_(dof(i), dof(j));
      Q(i, j) = by_q_(dof(i), dof(j));
      U(i, j) = by_u_(dof(i), dof(j));
    }
  const Eigen::MatrixXd inverse = K.partialPivLu().inverse();
  // The library's large product has a start-up that small ones need not pay.
  const auto put = [&](const Eigen::MatrixXd& by, Eigen::MatrixXd& to, double sign, auto column) {
    const Eigen::MatrixXd found =
        m < 12 ? Eigen::MatrixXd(inverse.lazyProduct(by)) : Eigen::MatrixXd(inverse * by);
    for (Eigen::Index j = 0; j < by.cols(); ++j)
      for (Eigen::Index i = 0; i < m; ++i) to(n + coordinate(i), column(j)) = sign * found(i, j);
  };
  put(Q, out.by_state, -1, coordinate);
  put(U, out.by_state, 1, [&](Eigen::Index j) { return n + coordinate(j); });
  const auto same = [](Eigen::Index j) { return j; };
  Eigen::MatrixXd loads(m, loads_.cols()), pulls(m, by_activation_.cols());
  for (Eigen::Index i = 0; i < m; ++i) {
    // Nothing moves what a stop holds.
    const double free = held_[as_index(group[as_index(i)])] ? 0 : 1;
    loads.row(i) = free * loads_.row(coordinate(i));
    if (pulls.cols() > 0) pulls.row(i) = free * by_activation_.row(dof(i));
    for (Eigen::Index k = 0; k < m; ++k)
      out.by_torque(n + coordinate(k), coordinate(i)) = free * settings_.step * inverse(k, i);
  }
  put(loads.leftCols(3), out.by_gravity, 1, same);
  if (out.by_force.cols() > 0) put(loads.rightCols(loads.cols() - 3), out.by_force, 1, same);
  // Activations at the end pull.
  if (pulls.cols() > 0) put(pulls, out.by_activation, -1, same);
}

/// q' from u', in the upper half of the rows.
void StepSlopes::move(Eigen::MatrixXd& of, bool of_state) const {
  const auto n = static_cast<Eigen::Index>(dof_of_.size());
  of.topRows(n) = settings_.step * of.bottomRows(n);
  if (of_state) of.topLeftCorner(n, n).diagonal().array() += 1;
  for (const auto& [first, turn] : turns_) {
    const auto c = static_cast<Eigen::Index>(first);
    of.middleRows<3>(c) = turn[1] * of.middleRows<3>(n + c);
    if (of_state) of.block<3, 3>(c, c) += turn[0];
  }
}

void StepSlopes::solve(StepDerivatives& out) {
  held_.assign(dof_of_.size(), 0);
  for (const Single& each : singles_)
    if (each.held()) hold(each);
  compute_turns();
  collect_groups();
  compute_loads(out);
  const Eigen::Index rows = 2 * static_cast<Eigen::Index>(dof_of_.size());
  out.by_state.setZero(rows, rows);
  out.by_torque.setZero(rows, rows / 2);
  out.by_gravity.setZero(rows, 3);
  out.by_force.setZero(rows, loads_.cols() - 3);
  out.by_activation.setZero(rows, by_activation_.cols());
  for (const std::vector<int>& group : groups_) solve_group(group, out);
  move(out.by_state, true);
  for (Eigen::MatrixXd* each : {&out.by_torque, &out.by_gravity, &out.by_force, &out.by_activation})
    move(*each, false);
  if (by_activation_.cols() == 0) return;
  out.by_excitation = out.by_activation * out.activation_by_excitation.asDiagonal();
  out.by_activation *= out.activation_by_activation.asDiagonal();
}

}  // namespace handsim::engine::articulated
