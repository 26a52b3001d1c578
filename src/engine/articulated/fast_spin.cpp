#include "handsim/engine/articulated/fast_spin.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/index.h"

namespace handsim::engine::articulated {

namespace {

Vec3 read3(const double* x, std::size_t stride) { return {x[0], x[stride], x[2 * stride]}; }

Mat3 read_symmetric(const double* x, std::size_t s) {
  Mat3 out;
  out(0, 0) = x[0];
  out(1, 1) = x[3 * s];
  out(2, 2) = x[5 * s];
  out(0, 1) = out(1, 0) = x[s];
  out(0, 2) = out(2, 0) = x[2 * s];
  out(1, 2) = out(2, 1) = x[4 * s];
  return out;
}

/// A momentum about a point that is `shift` further on.
Spatial about(const Spatial& momentum, const Vec3& shift) {
  Spatial out = momentum;
  out.head<3>() -= shift.cross(Vec3(momentum.tail<3>()));
  return out;
}

/// What is left of a speed when its energy is cut down to a bound.
double share_left(double energy, double bound) {
  bound = std::max(0.0, bound);
  return energy > bound ? std::sqrt(bound / energy) : 1;
}

}  // namespace

FastSpin::FastSpin(const model::Model& model, Mechanism& mechanism)
    : mechanism_(mechanism), space_(mechanism) {
  const Topology& topology = mechanism.topology();
  std::vector<int> tree_of(topology.nodes.size());
  for (std::size_t i = 0; i < topology.nodes.size(); ++i) {
    const Node& node = topology.nodes[i];
    views_.push_back(mechanism.view(i));
    if (!node.parent) {
      tree_of[i] = static_cast<int>(trees_.size());
      Tree& tree = trees_.emplace_back();
      tree.island = node.island;
      tree.base = node.kind == NodeKind::free ? model::kWorld : node.base;
      if (rate_count(node.kind) == 1) tree.stop = mechanism.axis_view(i).side;
    } else {
      tree_of[i] = tree_of[at(*node.parent)];
    }
    Tree& tree = trees_[at(tree_of[i])];
    tree.nodes.push_back(static_cast<int>(i));
    for (int dof = space_.first_dof(static_cast<int>(i)); dof <= space_.last_dof(static_cast<int>(i)); ++dof)
      tree.dofs.push_back(dof);
    if (!node.joint) continue;
    const int first = model.joints[at(*node.joint)].first_dof + node.axis_index;
    for (int k = 0; k < rate_count(node.kind); ++k) tree.driven_by.push_back(at(first + k));
  }
  // A lone free body has spin.h; one axis that is fixed in its base has no velocity products to balance.
  std::erase_if(trees_, [&](const Tree& tree) {
    return tree.nodes.size() == 1 && topology.nodes[at(tree.nodes[0])].kind != NodeKind::ball;
  });
  const std::size_t n = at(space_.size());
  start_.resize(topology.nodes.size());
  end_.resize(topology.nodes.size());
  axes_.resize(n);
  rates_.resize(n);
  impulses_.resize(n);
  accelerations_.resize(n);
  residuals_.resize(mechanism.u().size());
}

void FastSpin::forget() {
  for (Tree& tree : trees_) tree.credit = 0;
}

void FastSpin::save(ArchiveWriter& out) const {
  for (const Tree& tree : trees_) out(tree.credit);
}

void FastSpin::restore(ArchiveReader& in) {
  for (Tree& tree : trees_) {
    in(tree.credit);
    if (!(tree.credit >= 0 && std::isfinite(tree.credit)))
      in.refuse(fmt::format("{:g} J lost by inertia", tree.credit), "0 or more");
  }
}

bool FastSpin::driven(const Tree& tree, const StepInput& input) const {
  for (const std::size_t dof : tree.driven_by)
    if ((!input.servos.empty() && input.servos[dof].limit != 0) ||
        (!input.torques.empty() && input.torques[dof] != 0))
      return true;
  const BaseMotion& base = mechanism_.base(tree.base);
  return !base.v.isZero(0) || !base.w.isZero(0);
}

bool FastSpin::begin(const StepInput& input, double step) {
  const auto beyond = [&](double spin, double turn) { return spin * step * step > turn * turn; };
  const double most = mechanism_.spin();
  if (!beyond(most, kPassiveTurn)) return false;
  step_ = step;
  bool any = false;
  for (Tree& tree : trees_) {
    const double turn = driven(tree, input) ? kDrivenTurn : kPassiveTurn;
    tree.fast = beyond(most, turn) && std::any_of(tree.nodes.begin(), tree.nodes.end(), [&](int node) {
                  return beyond(*views_[at(node)].spin, turn);
                });
    if (tree.fast) keep_start(tree);
    any = any || tree.fast;
  }
  return any;
}

/// Of a node alone, about its island's origin.
Spatial FastSpin::momentum(int node) const {
  const NodeView& b = views_[at(node)];
  const std::size_t s = mechanism_.stride();
  Spatial out = Spatial::Zero();
  if (!mechanism_.topology().nodes[at(node)].body) return out;
  const Vec3 w = read3(b.v, s), v = read3(b.v + 3 * s, s), h = read3(b.h, s);
  out.head<3>() = read_symmetric(b.I, s) * w + h.cross(v);
  out.tail<3>() = *b.mass * v - h.cross(w);
  return out;
}

void FastSpin::keep_start(Tree& tree) {
  const Topology& topology = mechanism_.topology();
  const BaseMotion& base = mechanism_.base(tree.base);
  tree.carried = !base.v.isZero(0) || !base.w.isZero(0);
  tree.origin = mechanism_.origin(tree.island);
  tree.energy = 0;
  tree.momentum = Vec3::Zero();
  tree.centre = Vec3::Zero();
  tree.mass = 0;
  const Vec3 gravity = step_ * mechanism_.gravity();
  for (const int node : tree.nodes) {
    Spatial& L = start_[at(node)];
    L = momentum(node);
    tree.energy += 0.5 * L.dot(space_.velocity(node));
    tree.momentum += L.tail<3>();
    if (!topology.nodes[at(node)].body) continue;
    // Gravity's impulse goes with what the step starts from.
    const NodeView& b = views_[at(node)];
    const Vec3 h = read3(b.h, mechanism_.stride());
    L.head<3>() += h.cross(gravity);
    L.tail<3>() += *b.mass * gravity;
    tree.centre += h;
    tree.mass += *b.mass;
  }
  tree.centre /= tree.mass;
  for (std::size_t i = tree.nodes.size(); i-- > 1;)
    start_[at(*topology.nodes[at(tree.nodes[i])].parent)] += start_[at(tree.nodes[i])];
  for (const int dof : tree.dofs) {
    axes_[at(dof)] = space_.axis(dof);
    rates_[at(dof)] = mechanism_.u()[space_.rate_index(dof)];
  }
}

void FastSpin::keep_impulses() {
  const std::span<const double> du = mechanism_.du();
  for (std::size_t i = 0; i < accelerations_.size(); ++i)
    accelerations_[i] = du[space_.rate_index(static_cast<int>(i))];
  space_.inverse_dynamics(accelerations_, impulses_);
  for (double& impulse : impulses_) impulse *= step_;
}

void FastSpin::place() {
  const std::size_t stride = mechanism_.stride();
  for (const Tree& tree : trees_) {
    const std::size_t root = at(tree.nodes[0]);
    if (!tree.fast || mechanism_.topology().nodes[root].kind != NodeKind::free) continue;
    const Vec3 turn = step_ * read3(views_[root].u, stride);
    const Vec3 before = tree.centre, after = rotation_quaternion(turn) * before;
    const Vec3 shift = before - after + turn.cross(after);
    double* p = mechanism_.q().data() + mechanism_.seat(root).q;
    for (int k = 0; k < 3; ++k) p[at(k) * stride] += shift[k];
  }
}

/// What is left of equation (1), by rates.
void FastSpin::find_residuals(const Tree& tree) {
  const Topology& topology = mechanism_.topology();
  const Vec3 shift = mechanism_.origin(tree.island) - tree.origin;
  for (const int node : tree.nodes) end_[at(node)] = momentum(node);
  for (std::size_t i = tree.nodes.size(); i-- > 0;) {
    const int index = tree.nodes[i];
    const Node& node = topology.nodes[at(index)];
    if (node.parent) end_[at(*node.parent)] += end_[at(index)];
    const Spatial change = end_[at(index)] - about(start_[at(index)], shift);
    const int first = space_.first_dof(index);
    if (node.kind == NodeKind::free) {
      Spatial impulse;
      for (int k = 0; k < 6; ++k) impulse[k] = impulses_[at(first + k)];
      impulse = about(impulse, shift) - change;
      for (int k = 0; k < 6; ++k) residuals_[space_.rate_index(first + k)] = impulse[k];
      continue;
    }
    for (int dof = first; dof <= space_.last_dof(index); ++dof) {
      Spatial axis = axes_[at(dof)];
      axis.tail<3>() += Vec3(axis.head<3>()).cross(shift);
      residuals_[space_.rate_index(dof)] = impulses_[at(dof)] - 0.5 * (axis + space_.axis(dof)).dot(change);
    }
  }
}

bool FastSpin::correct() {
  std::fill(residuals_.begin(), residuals_.end(), 0.0);
  for (const Tree& tree : trees_)
    if (tree.fast) find_residuals(tree);
  mechanism_.respond(residuals_);
  const std::span<double> u = mechanism_.u(), du = mechanism_.du();
  for (const Tree& tree : trees_)
    for (const int dof : tree.dofs)
      if (tree.fast) u[space_.rate_index(dof)] += du[space_.rate_index(dof)];
  mechanism_.settle_bases();
  bool sound = mechanism_.kernel().velocities(mechanism_.tree());
  bool slowed = false;
  for (Tree& tree : trees_)
    if (tree.fast && !tree.carried) slowed = keep_energy(tree) || slowed;
  if (slowed) sound = mechanism_.kernel().velocities(mechanism_.tree());
  return sound;
}

/// Momentum and kinetic energy of a tree.
std::pair<Spatial, double> FastSpin::motion(const Tree& tree) const {
  std::pair<Spatial, double> out = {Spatial::Zero(), 0};
  for (const int node : tree.nodes) {
    const Spatial own = momentum(node);
    out.first += own;
    out.second += 0.5 * own.dot(space_.velocity(node));
  }
  return out;
}

/// The root's rates, padded with zeros, at which the tree has its momentum along the root's axes when all its
/// other joints are locked, and the energy it then has. A root that rests on its stop stays.
std::pair<Spatial, double> FastSpin::as_one_body(const Tree& tree, const Spatial& momentum) const {
  if (tree.stop && *tree.stop != 0 && mechanism_.u()[space_.rate_index(tree.dofs[0])] == 0)
    return {Spatial::Zero(), 0};
  double mass = 0;
  Vec3 h = Vec3::Zero();
  Mat3 I = Mat3::Zero();
  for (const int node : tree.nodes) {
    if (!mechanism_.topology().nodes[at(node)].body) continue;
    const NodeView& b = views_[at(node)];
    mass += *b.mass;
    h += read3(b.h, mechanism_.stride());
    I += read_symmetric(b.I, mechanism_.stride());
  }
  const int root = tree.nodes[0], first = space_.first_dof(root), count = space_.last_dof(root) - first + 1;
  Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Identity();
  Spatial p = Spatial::Zero();
  for (int j = 0; j < count; ++j) {
    const Spatial S = space_.axis(first + j);
    const Vec3 turn = S.head<3>(), shift = S.tail<3>();
    Spatial F;
    F.head<3>() = I * turn + h.cross(shift);
    F.tail<3>() = mass * shift - h.cross(turn);
    for (int i = 0; i < count; ++i) H(i, j) = space_.axis(first + i).dot(F);
    p[j] = S.dot(momentum);
  }
  const Spatial rates = H.llt().solve(p);
  return {rates, 0.5 * p.dot(rates)};
}

/// Takes energy that inertia alone has gained from the motion of the joints against each other: at rates u,
/// with u_1 those as one body, u_1 + s (u - u_1) has the same momentum and the energy T_1 + s^2 (T - T_1).
/// What that cannot give is lent from what the steps before have lost: a body that tumbles gains and loses by
/// turns. The rest is taken from the rotation as one body, with its momentum. Returns true where rates
/// changed.
bool FastSpin::keep_energy(Tree& tree) {
  const std::span<double> u = mechanism_.u();
  const auto [momentum, energy] = motion(tree);
  const Vec3 P = momentum.tail<3>();
  double allowed = tree.energy + 0.5 * step_ * mechanism_.gravity().dot(tree.momentum + P);
  for (const int dof : tree.dofs)
    allowed += 0.5 * impulses_[at(dof)] * (rates_[at(dof)] + u[space_.rate_index(dof)]);
  if (!std::isfinite(energy)) return false;
  if (energy <= allowed) {
    tree.credit += allowed - energy;
    return false;
  }

  auto [rates, least] = as_one_body(tree, momentum);
  const double lent = std::clamp(least - allowed, 0.0, tree.credit);
  tree.credit -= lent;
  allowed += lent;
  const double share = share_left(energy - least, allowed - least);
  if (least > allowed) {
    // A free tree's centre of mass flies on.
    Spatial flight = Spatial::Zero();
    if (mechanism_.topology().nodes[at(tree.nodes[0])].kind == NodeKind::free)
      flight.tail<3>() = P / tree.mass;
    const double flying = 0.5 * P.dot(Vec3(flight.tail<3>()));
    rates = flight + share_left(least - flying, allowed - flying) * (rates - flight);
  }
  const auto own = at(space_.last_dof(tree.nodes[0]) - space_.first_dof(tree.nodes[0]) + 1);
  for (std::size_t i = 0; i < tree.dofs.size(); ++i) {
    double& rate = u[space_.rate_index(tree.dofs[i])];
    const double one = i < own ? rates[static_cast<Eigen::Index>(i)] : 0;
    rate = one + share * (rate - one);
  }
  return true;
}

}  // namespace handsim::engine::articulated
