#include "handsim/engine/articulated/contact/contact_dynamics.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "handsim/engine/articulated/contact/tuning.h"
#include "handsim/engine/collision/ode_library.h"

namespace handsim::engine::articulated {

namespace {

constexpr std::size_t kUsualPairs = 8;  ///< So many pairs touch at a time, usually.

/// Makes ODE ready before anything of its is built.
const model::Model& entered(const model::Model& model) {
  enter_ode();
  return model;
}

}  // namespace

/// One for each thread: thousands of engines that take turns need one.
Workspace& ContactDynamics::workspace() {
  thread_local Workspace own;
  return own;
}

ContactDynamics::ContactDynamics(const model::Model& model, const Settings& settings, Mechanism& mechanism,
                                 Loops* loops)
    : model_(entered(model)),
      mechanism_(mechanism),
      loops_(loops),
      collider_(model, settings.effects, settings.articulated().speculative),
      crossed_(model),
      space_(mechanism, JointSpace::Inertia::of_thread),
      friction_(settings.effects.has(model::Effect::friction)),
      with_forces_(settings.contact_forces),
      erp_(settings.erp()) {
  if (PadMemory::needed(model)) pads_.emplace();
  refresh();
  order_dofs();
  frames_.reserve(kUsualContacts);
  light_.reserve(kUsualContacts);
  memory_.points.reserve(kUsualContacts);
  memory_.change.reserve(as_index(space_.size()));
  std::size_t most = 0;
  for (const std::vector<int>& each : carriers_) most = std::max(most, 2 * each.size());
  moving_dofs_.resize(kUsualPairs);
  for (MovingDofs& each : moving_dofs_) reserve_each(most, each.dofs, each.signs);
  reserve_each(as_index(space_.size()), loop_dofs_, loop_entries_);
  const Topology& topology = mechanism.topology();
  for (std::size_t i = 0; i < topology.nodes.size(); ++i)
    if (rate_count(topology.nodes[i].kind) == 1) singles_.push_back(static_cast<int>(i));
  sides_.assign(singles_.size(), LimitSide::within);
}

void ContactDynamics::refresh() {
  heaviest_ = 0;
  for (const model::Body& body : model_.bodies)
    if (!body.kinematic) heaviest_ = std::max(heaviest_, body.mass);
}

/// Children before parents, trees on a base before free ones: fill-in only where contacts couple branches.
void ContactDynamics::order_dofs() {
  const int n = space_.size();
  place_.assign(as_index(n), kNoDof);
  const auto visit = [&](auto&& self, int dof) -> void {
    for (int child = dof + 1; child < n; ++child)
      if (space_.parent_dof(child) == dof) self(self, child);
    place_[as_index(dof)] = static_cast<int>(order_.size());
    order_.push_back(dof);
  };
  const Topology& topology = mechanism_.topology();
  for (const bool free : {false, true})
    for (std::size_t i = 0; i < topology.nodes.size(); ++i)
      if (!topology.nodes[i].parent && (topology.nodes[i].kind == NodeKind::free) == free)
        visit(visit, space_.first_dof(static_cast<int>(i)));
  std::vector<int> first(as_index(n));
  for (int i = 0; i < n; ++i) first[as_index(i)] = i;
  for (int dof = 0; dof < n; ++dof)
    for (int j = space_.parent_dof(dof); j != kNoDof; j = space_.parent_dof(j))
      first[as_index(place_[as_index(j)])] =
          std::min(first[as_index(place_[as_index(j)])], place_[as_index(dof)]);
  system_.assign(first, workspace());
  inverse_inertia_.resize(as_index(n));
  change_.resize(as_index(n));
  constrained_.resize(as_index(n));
  for (int dof = 0; dof < n; ++dof)
    root_of_.push_back(space_.parent_dof(dof) == kNoDof ? dof : root_of_[as_index(space_.parent_dof(dof))]);
  carriers_.resize(topology.nodes.size());
  for (std::size_t i = 0; i < topology.nodes.size(); ++i)
    for (int dof = space_.last_dof(static_cast<int>(i)); dof != kNoDof; dof = space_.parent_dof(dof))
      carriers_[i].push_back(place_[as_index(dof)]);
  dof_of_ = order_;
  chosen_.reserve(as_index(n));
}

void ContactDynamics::select_dofs() {
  chosen_.clear();
  for (int i = 0; i < space_.size(); ++i)
    if (is_constrained(order_[as_index(i)])) chosen_.push_back(i);
  if (!system_.chosen.choose(system_.all, chosen_)) return;
  dof_of_.clear();
  std::ranges::fill(place_, kNoDof);
  for (const int i : chosen_) {
    place_[as_index(order_[as_index(i)])] = static_cast<int>(dof_of_.size());
    dof_of_.push_back(order_[as_index(i)]);
  }
  for (std::size_t i = 0; i < carriers_.size(); ++i) {
    int dof = space_.last_dof(static_cast<int>(i));
    for (int& each : carriers_[i]) each = place_[as_index(std::exchange(dof, space_.parent_dof(dof)))];
  }
  for (MovingDofs& each : moving_dofs_) each.node_a = each.node_b = kNoNode;
}

template <class Archive, class T>
void ContactDynamics::serialize(Archive& archive, T& point) {
  archive(point.shape_a, point.shape_b, point.index, point.impulse, point.moment, point.open);
  for (auto& tangent_stiffness : point.tangent_stiffness) archive(tangent_stiffness);
}

void ContactDynamics::save(ArchiveWriter& out) const {
  collider_.save(out);
  out(memory_.points.size());
  for (const ContactMemory::Point& each : memory_.points) serialize(out, each);
  out(memory_.change);
  system_.save(out);
}

void ContactDynamics::restore(ArchiveReader& in) {
  collider_.restore(in);
  memory_.points.resize(in.size());
  for (ContactMemory::Point& each : memory_.points) {
    serialize(in, each);
    for (const double tangent_stiffness : each.tangent_stiffness)
      if (!(tangent_stiffness >= 0))
        in.refuse(fmt::format("a friction of {:g} over its speed", tangent_stiffness), "0 or more");
  }
  in(memory_.change);
  if (!memory_.change.empty() && memory_.change.size() != as_index(space_.size()))
    in.refuse(fmt::format("{} changes of rates", memory_.change.size()), fmt::format("{}", space_.size()));
  system_.restore(in);
}

int ContactDynamics::collide(const model::State& state, const StepForecast& prospect) {
  enter_ode();
  collider_.place(state);
  return collider_.collide(state, prospect);
}

/// How a body moves; a base during the step.
ContactDynamics::BodyVelocity ContactDynamics::velocity_of(int shape) const {
  const int node = node_of(shape);
  if (node == kNoNode) {
    const BaseMotion& base = mechanism_.base(body_of(shape));
    return {base.pose.p, base.v, base.w};
  }
  const Spatial v = space_.velocity(node);
  return {mechanism_.origin(mechanism_.topology().nodes[as_index(node)].island), v.tail<3>(), v.head<3>()};
}

ContactDynamics::Mobility ContactDynamics::mobility_of(int shape) const {
  const model::Body& body = model_.bodies[as_index(body_of(shape))];
  if (body.kinematic || body.mass <= 0) return {};
  return {1 / body.mass, 3 / body.inertia.trace()};
}

void ContactDynamics::collect_moving_dofs(MovingDofs& of) const {
  of.dofs.clear();
  of.signs.clear();
  const auto add = [&](int dof, signed char sign) {
    of.dofs.push_back(dof);
    of.signs.push_back(sign);
  };
  const auto carriers = [&](int node) {
    return node == kNoNode ? std::span<const int>() : std::span<const int>(carriers_[as_index(node)]);
  };
  const std::span<const int> a = carriers(of.node_a), b = carriers(of.node_b);
  for (std::size_t i = 0, j = 0; i < a.size() || j < b.size();) {
    if (i < a.size() && j < b.size() && a[i] == b[j]) {
      ++i;
      ++j;
    } else if (j == b.size() || (i < a.size() && a[i] < b[j])) {
      add(a[i++], 1);
    } else {
      add(b[j++], -1);
    }
  }
}

/// Whether a coordinate's servo and stops agree with the step that knows of no contacts and stops.
bool ContactDynamics::free_step_holds(std::size_t single, double step) const {
  const NodeView& a = mechanism_.view(as_index(singles_[single]));
  const double rate = *a.u + step * *a.du;
  if (const model::Servo servo = a.servo(); servo.limit > 0) {
    const double pull = servo.pull(step * rate, rate);
    // Written so that NaN does not hold.
    if (*a.saturated == 0 ? !(std::abs(pull) <= servo.limit) : !(*a.saturated * pull > servo.limit))
      return false;
  }
  return sides_[single] == LimitSide::within && rate >= -stop_target(*a.q - *a.low, step) &&
         rate <= stop_target(*a.high - *a.q, step);
}

/// Finds the trees that contacts, loops, stops or torque limits keep from the free step.
void ContactDynamics::choose_trees(double step) {
  std::fill(constrained_.begin(), constrained_.end(), loops_ != nullptr);
  for (const Touch& touch : collider_.touches()) {
    const Contact& any = collider_.contacts()[touch.first];
    for (const int node : {node_of(any.shape_a), node_of(any.shape_b)})
      if (node != kNoNode) constrained_[as_index(root_of_[as_index(space_.first_dof(node))])] = true;
  }
  for (std::size_t i = 0; i < singles_.size(); ++i)
    if (const auto root = as_index(root_of_[as_index(space_.first_dof(singles_[i]))]);
        !constrained_[root] && !free_step_holds(i, step))
      constrained_[root] = true;
  select_dofs();
}

/// The solver's A and g from the step without contacts and stops, of the trees that are involved.
void ContactDynamics::compute_free(ContactProblem& p, double step) {
  const Kernel& kernel = mechanism_.kernel();
  kernel.prepare(mechanism_.tree(), step);
  kernel.solve(mechanism_.tree());
  if (muscles_) muscles_->correct(step);
  choose_trees(step);
  p.reset(system_.chosen);
  space_.compute_inertia([&](int dof) { return is_constrained(dof); });
  for (const int single : singles_)
    if (const int dof = space_.first_dof(single); is_constrained(dof))
      space_.add_to_diagonal(dof, *mechanism_.view(as_index(single)).weight);
  if (muscles_) muscles_->add_to(space_, step, [&](int dof) { return is_constrained(dof); });
  // A, and g = A x of the free step.
  const int n = space_.size();
  const std::span<const double> du = mechanism_.du();
  for (int dof = 0; dof < n; ++dof) {
    if (!is_constrained(dof)) continue;
    const int i = place_[as_index(dof)];
    const double* S = space_.axis_data(dof);
    double* motion = p.motion(i);
    for (std::size_t k = 0; k < 3; ++k) {
      motion[k] = S[k * mechanism_.stride()];
      motion[4 + k] = S[(3 + k) * mechanism_.stride()];
    }
    if (!memory_.change.empty()) p.start[as_index(i)] = memory_.change[as_index(dof)];
    const double change = change_[as_index(dof)] = step * du[space_.rate_index(dof)];
    const double own = p.inertia(i, i) = space_.inertia(dof, dof);
    inverse_inertia_[as_index(i)] = 1 / own;
    double sum = own * change;
    for (int j = space_.parent_dof(dof); j != kNoDof; j = space_.parent_dof(j)) {
      const int k = place_[as_index(j)];
      const double entry = p.inertia(i, k) = space_.inertia(dof, j);
      p.g[as_index(k)] += entry * change;
      sum += entry * change_[as_index(j)];
    }
    p.g[as_index(i)] += sum;
  }
}

/// Greatest speed towards a stop at a distance: the same as the kernels have without contact.
double ContactDynamics::stop_target(double room, double step) const {
  return (room < 0 ? erp_ * room : room) / step;
}

/// Servos with their limits, and stops as bounds of the rates. The servos' part of the free step is removed.
void ContactDynamics::bound_axes(ContactProblem& p, double step) {
  for (std::size_t i = 0; i < singles_.size(); ++i) {
    const int place = place_of(singles_[i]);
    if (place == kNoDof) continue;
    const NodeView& a = mechanism_.view(as_index(singles_[i]));
    const double u = *a.u, q = *a.q;
    Limits& limits = p.limits[as_index(place)];
    if (const model::Servo servo = a.servo(); servo.limit > 0) {
      limits.offset = step * servo.start(step, u);
      limits.slope = step * servo.slope(step);
      limits.limit = step * servo.limit;
      limits.saturated = side_of(*a.saturated);
      p.g[as_index(place)] -= limits.torque(limits.offset);
      if (limits.saturated == LimitSide::within) p.inertia(place, place) -= limits.slope;
    }
    if (*a.low == -HUGE_VAL && *a.high == HUGE_VAL) continue;
    limits.low = -stop_target(q - *a.low, step) - u;
    limits.high = stop_target(*a.high - q, step) - u;
    limits.side = sides_[i];
  }
}

/// Bounds of stops that are hit, with their restitution: true where one changed.
bool ContactDynamics::apply_restitution(ContactProblem& p) {
  bool any = false;
  for (const int single : singles_) {
    const int place = place_of(single);
    if (place == kNoDof) continue;
    const NodeView& a = mechanism_.view(as_index(single));
    Limits& bound = p.limits[as_index(place)];
    const int side = sign(bound.side);
    const double speed = side * *a.u;
    if (bound.bounced || side == 0 || !(speed > 0) || !(*a.restitution > 0)) continue;
    // Speeds towards the stop after the step: without and with restitution.
    const double now = side * p.x[as_index(place)] + speed, bounced = -*a.restitution * speed;
    if (!(bounced < now)) continue;
    bound.bounced = any = true;
    // The opposite stop stays, and the rebound ends there at the latest.
    if (side < 0)
      bound.low = std::min(speed - bounced, bound.high);
    else
      bound.high = std::max(bounced - speed, bound.low);
  }
  return any;
}

/// Makes contacts of light pairs stiffer that yield too fast: true where one changed.
bool ContactDynamics::stiffen(ContactProblem& p) {
  bool any = false;
  for (const std::size_t i : light_) {
    ContactRows& rows = p.contacts[i];
    const double yield = rows.regularization * rows.impulse[0];
    if (!(yield > kTuning.most_yield)) continue;
    const double share = kTuning.firm_share * kTuning.most_yield / yield;
    rows.regularization *= share;
    for (std::size_t k = 0; k < rows.disc_count; ++k) rows.discs[k].regularization *= share;
    any = true;
  }
  return any;
}

NewtonReport ContactDynamics::solve(double step) {
  Workspace& w = workspace();
  ContactProblem& p = w.problem;
  // Stops are bounds here, and not locks.
  for (std::size_t i = 0; i < singles_.size(); ++i)
    sides_[i] = side_of(std::exchange(*mechanism_.view(as_index(singles_[i])).side, 0.0));
  compute_free(p, step);
  bound_axes(p, step);
  add_contacts(p, step);
  add_loop_rows(p);
  const double tolerance = kTuning.tolerance * step;
  NewtonReport report = articulated::solve(system_, w, tolerance);
  int stiffened = 0;
  while (apply_restitution(p) || (stiffened < kTuning.stiffenings && stiffen(p) && ++stiffened > 0)) {
    const NewtonReport before = std::exchange(report, articulated::solve(system_, w, tolerance));
    report.iterations += before.iterations;
    report.limit_updates += before.limit_updates;
  }
  store_solution(p, step);
  return report;
}

/// The solution: accelerations, what is in force, and the contacts' impulses.
void ContactDynamics::store_solution(ContactProblem& p, double step) {
  const std::span<double> du = mechanism_.du();
  memory_.change.assign(as_index(space_.size()), 0.0);
  for (std::size_t i = 0; i < dof_of_.size(); ++i) {
    const int dof = dof_of_[i];
    memory_.change[as_index(dof)] = p.x[i];
    du[space_.rate_index(dof)] = memory_.change[as_index(dof)] / step;
  }
  for (const int single : singles_) {
    const int place = place_of(single);
    if (place == kNoDof) continue;
    *mechanism_.view(as_index(single)).side = sign(p.limits[as_index(place)].side);
    *mechanism_.view(as_index(single)).saturated = sign(p.limits[as_index(place)].saturated);
  }
  store_impulses(p, step);
  if (pads_) store_pads(p, step);
}

}  // namespace handsim::engine::articulated
