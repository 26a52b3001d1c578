#include "handsim/engine/articulated/fast_spin.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace handsim::engine::articulated {

namespace {

/// Squares of turns that may add up before energy and momentum are compared [rad^2]: a step gains at most
/// about this share of the kinetic energy.
constexpr double kTurned = 2e-4;
/// Share of energy that is let be. Chosen: energies stay within 1e-3, also while kTurned adds up.
constexpr double kEnergyTolerance = 2e-4;

/// What is left of a speed when its energy is cut down to a bound.
double share_left(double energy, double bound) {
  bound = std::max(0.0, bound);
  return energy > bound ? std::sqrt(bound / energy) : 1;
}

}  // namespace

FastSpin::FastSpin(const model::Model& model, Mechanism& mechanism, bool muscles)
    : mechanism_(mechanism), space_(mechanism, JointSpace::Inertia::none) {
  const Topology& topology = mechanism.topology();
  std::vector<int> tree_of(topology.nodes.size());
  const std::span<const NodeView> views = mechanism.views();
  for (std::size_t i = 0; i < topology.nodes.size(); ++i) {
    const Node& node = topology.nodes[i];
    if (!node.parent) {
      tree_of[i] = static_cast<int>(trees_.size());
      SpinningTree& tree = trees_.emplace_back();
      tree.island = node.island;
      tree.free = node.kind == NodeKind::free;
      tree.base = node.kind == NodeKind::free ? model::kWorld : node.base;
      if (rate_count(node.kind) == 1) tree.stop = views[i].side;
    } else {
      tree_of[i] = tree_of[as_index(*node.parent)];
    }
    SpinningTree& tree = trees_[as_index(tree_of[i])];
    tree.nodes.push_back(static_cast<int>(i));
    if (node.body) tree.bodies.add(mechanism, static_cast<int>(i));
    for (int dof = space_.first_dof(static_cast<int>(i)); dof <= space_.last_dof(static_cast<int>(i)); ++dof)
      tree.dofs.push_back(dof);
    // Of bodies only: a node without one has a spin in some lanes and none in others.
    if (node.body) tree.spins.push_back(views[i].spin);
    if (views[i].work) tree.works.push_back(views[i].work);
    if (node.kind == NodeKind::ball) tree.balls.push_back(static_cast<int>(i));
    if (!node.joint) continue;
    const int first = model.joints[as_index(*node.joint)].first_dof + node.axis_index;
    for (int k = 0; k < rate_count(node.kind); ++k) tree.driven_by.push_back(as_index(first + k));
  }
  for (const Cut& cut : topology.cuts)
    for (const CutSide* side : {&cut.parent, &cut.child})
      if (side->node) trees_[as_index(tree_of[as_index(*side->node)])].looped = true;
  if (muscles)
    for (const model::Muscle& muscle : model.muscles)
      for (const model::MomentArm& arm : muscle.path.arms)
        for (SpinningTree& tree : trees_)
          tree.pulled = tree.pulled || std::ranges::count(tree.driven_by, as_index(arm.dof)) > 0;
  // A lone free body has spin.h; one axis that is fixed in its base has no velocity products to balance.
  std::erase_if(trees_, [&](const SpinningTree& tree) {
    return tree.nodes.size() == 1 && topology.nodes[as_index(tree.nodes[0])].kind != NodeKind::ball;
  });
  accelerations_.resize(as_index(space_.size()));
  forces_.resize(as_index(space_.size()));
}

void FastSpin::refresh() {
  forget();
  for (SpinningTree& tree : trees_) tree.bodies.refresh();
}

void FastSpin::forget() {
  for (SpinningTree& tree : trees_) tree.watched = false;
}

void FastSpin::save(ArchiveWriter& out) const {
  for (const SpinningTree& tree : trees_) {
    out(tree.watched, tree.turned, tree.energy, tree.credit);
  }
}

void FastSpin::restore(ArchiveReader& in) {
  for (SpinningTree& tree : trees_) {
    in(tree.watched, tree.turned, tree.energy, tree.credit);
    if (!(std::isfinite(tree.turned) && std::isfinite(tree.energy) && tree.credit >= 0))
      in.refuse(fmt::format("a tree's energy of {:g} J", tree.energy), "finite numbers");
  }
}

double FastSpin::turn_threshold(const SpinningTree& tree, const StepInput& input) const {
  if (tree.pulled) return kPulledTurn;
  for (const std::size_t dof : tree.driven_by)
    if ((!input.servos.empty() && input.servos[dof].limit != 0) ||
        (!input.torques.empty() && input.torques[dof] != 0))
      return kDrivenTurn;
  return kPassiveTurn;
}

/// Largest angular velocity of a node, squared [1/s^2].
double FastSpin::turn(const SpinningTree& tree) const {
  double out = 0;
  for (const double* spin : tree.spins) out = std::max(out, *spin);
  return out;
}

bool FastSpin::begin_step(const StepInput& input, double step) {
  const auto beyond = [&](double spin, double turn) { return spin * step * step > turn * turn; };
  step_ = step;
  const double most = mechanism_.spin();
  const bool may_be = beyond(most, kPassiveTurn) && input.forces.empty();
  bool any = false, found = false;
  for (SpinningTree& tree : trees_) {
    tree.fast = false;
    double spin = 0;
    if (const double threshold = may_be ? turn_threshold(tree, input) : 0;
        may_be && beyond(most, threshold)) {
      spin = turn(tree);
      const BaseMotion& base = mechanism_.base(tree.base);
      tree.fast = beyond(spin, threshold) && base.v.isZero(0) && base.w.isZero(0);
    }
    if (tree.fast && !tree.watched) {
      if (!found) mechanism_.kernel().momenta(mechanism_.tree());
      found = true;
      tree.turned = tree.credit = 0;
      tree.energy = tree.bodies.kinetic() + potential(tree);
    }
    tree.watched = tree.fast;
    if (tree.fast) tree.turned += spin * step * step;
    any = any || tree.fast;
  }
  return any;
}

double FastSpin::potential(const SpinningTree& tree) const {
  return -mechanism_.gravity().dot(tree.bodies.moment() +
                                   tree.bodies.mass() * mechanism_.origin(tree.island));
}

void FastSpin::add_work(bool constrained) {
  const std::span<const double> u = mechanism_.u(), du = mechanism_.du();
  if (constrained) {
    for (std::size_t i = 0; i < accelerations_.size(); ++i)
      accelerations_[i] = du[space_.rate_index(static_cast<int>(i))];
    space_.inverse_dynamics(accelerations_, forces_);
  } else {
    mechanism_.kernel().work(mechanism_.tree(), step_);
  }
  for (SpinningTree& tree : trees_) {
    if (!tree.fast) continue;
    const auto mean = [&](int dof) {
      return u[space_.rate_index(dof)] + 0.5 * step_ * du[space_.rate_index(dof)];
    };
    if (constrained) {
      for (const int dof : tree.dofs) tree.energy += step_ * forces_[as_index(dof)] * mean(dof);
    } else {
      for (const double* work : tree.works) tree.energy += *work;
      for (const int node : tree.balls)
        for (int k = 0; k < 3; ++k)
          tree.energy += step_ * mechanism_.view(as_index(node)).tau[as_index(k) * mechanism_.stride()] *
                         mean(space_.first_dof(node) + k);
    }
  }
}

bool FastSpin::correct(bool sound) {
  const auto due = [&](const SpinningTree& tree) { return tree.fast && (tree.turned >= kTurned || !sound); };
  if (!std::ranges::any_of(trees_, due)) return sound;
  mechanism_.kernel().momenta(mechanism_.tree());
  bool changed = false;
  for (SpinningTree& tree : trees_)
    if (due(tree)) changed = project(tree) || changed;
  return changed ? mechanism_.kernel().velocities(mechanism_.tree()) : sound;
}

/// The root's rates, padded with zeros, at which the tree has its momentum along the root's axes when all its
/// other joints are locked. Zero for a root that rests on its stop, and where a loop could not follow it.
Spatial FastSpin::as_one_body(const SpinningTree& tree, const Spatial& momentum) const {
  const Vec3 h = tree.bodies.moment();
  const Mat3 I = tree.bodies.inertia();
  if (tree.free) return tree.bodies.rigid_velocity(h, I, momentum);
  Spatial out = Spatial::Zero();
  if (tree.looped) return out;
  if (tree.stop && *tree.stop != 0 && mechanism_.u()[space_.rate_index(tree.dofs[0])] == 0) return out;
  const int root = tree.nodes[0], first = space_.first_dof(root), count = space_.last_dof(root) - first + 1;
  Mat3 H = Mat3::Identity();
  Vec3 p = Vec3::Zero();
  for (int j = 0; j < count; ++j) {
    const Spatial S = space_.axis(first + j);
    const Vec3 turn = S.head<3>(), shift = S.tail<3>();
    Spatial F;
    F << I * turn + h.cross(shift), tree.bodies.mass() * shift - h.cross(turn);
    for (int i = 0; i < count; ++i) H(i, j) = space_.axis(first + i).dot(F);
    p[j] = S.dot(momentum);
  }
  out.head<3>() = H.inverse() * p;
  return out;
}

/// Returns true where rates changed.
bool FastSpin::project(SpinningTree& tree) {
  tree.turned = 0;
  const double kinetic = tree.bodies.kinetic(), allowed = tree.energy - potential(tree);
  if (!std::isfinite(kinetic)) return false;
  if (kinetic - allowed > kEnergyTolerance * kinetic) {
    reduce_energy(tree, kinetic, allowed);
    return true;
  }
  const double lost = std::max(0.0, allowed - kinetic);
  tree.credit += lost;
  tree.energy -= lost;
  return false;
}

/// Scales the rates down to the energy allowed, first those of the joints against each other.
void FastSpin::reduce_energy(SpinningTree& tree, double kinetic, double allowed) {
  const std::span<double> u = mechanism_.u();
  const int root = tree.nodes[0];
  const Spatial momentum = tree.bodies.momentum();
  Spatial rates = as_one_body(tree, momentum);
  double least = 0;
  const int count = space_.last_dof(root) - space_.first_dof(root) + 1;
  for (int k = 0; k < count; ++k)
    least += 0.5 * rates[k] * space_.axis(space_.first_dof(root) + k).dot(momentum);
  // The inertia of a loop gains and loses by turns as it goes round.
  const double lent = std::clamp((tree.looped ? kinetic : least) - allowed, 0.0, tree.credit);
  tree.credit -= lent;
  tree.energy += lent;
  allowed += lent;
  const double share = share_left(kinetic - least, allowed - least);
  if (least > allowed && !tree.free) rates *= share_left(least, allowed);
  for (std::size_t i = 0; i < tree.dofs.size(); ++i) {
    double& rate = u[space_.rate_index(tree.dofs[i])];
    const double one = static_cast<int>(i) < count ? rates[static_cast<Eigen::Index>(i)] : 0;
    rate = one + share * (rate - one);
  }
}

}  // namespace handsim::engine::articulated
