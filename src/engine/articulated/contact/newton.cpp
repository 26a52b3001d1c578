#include "handsim/engine/articulated/contact/solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "handsim/core/index.h"

namespace handsim::engine::articulated {

namespace {

/// Largest number of Newton steps from the active set of the last step. Chosen.
constexpr int kNewtonSteps = 15;
/// A heap gets fewer Newton steps, with Gauss-Seidel as the only fallback; none where a factorisation takes
/// more multiplications than kMostWork. Both are chosen.
constexpr int kHeapSteps = 6;
/// Steps with the factor of an earlier problem. Chosen.
constexpr int kReusedSteps = 3;
constexpr double kMostWork = 5e4;
/// A start whose residual is within this share of the tolerance is the solution: 1e-5 m/s^2, a millionth of
/// gravity. Chosen; a step with the factor of an earlier problem leaves as much.
constexpr double kAtRest = 0.1;
/// A residual below this share of the sum of its terms' magnitudes is rounding.
constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();
/// A bound is passed by more than rounding [m/s, rad/s].
constexpr double kBeyond = 1e-12;

}  // namespace

void ContactNewton::begin() { clear(); }

void ContactNewton::bound(int i, double low, double high, double side) { bounds_[at(i)] = {low, high, side}; }

void ContactNewton::servo(int i, double offset, double slope, double limit, double saturated) {
  servos_[at(i)] = {offset, slope, limit, saturated};
}

/// Impulses at row velocities r, and the active set.
void ContactNewton::apply_law(ContactRows& contact, const double* r, Law law) {
  double& normal = contact.impulse[0];
  normal = -r[0] / contact.regularization;
  if (contact.bilateral) {
    contact.open = false;
    return;
  }
  if (law == Law::active_set)
    normal = contact.open ? 0 : normal;
  else
    contact.open = !(normal > 0);
  if (contact.open) normal = 0;
  for (std::size_t k = 0; k < contact.disc_count; ++k) {
    Disc& disc = contact.discs[k];
    double* p = contact.impulse.data() + disc.row;
    const double vx = r[disc.row], vy = disc.size > 1 ? r[disc.row + 1] : 0;
    const double limit = law == Law::fixed_limits ? disc.limit : disc.coefficient * normal;
    double x = -vx / disc.regularization, y = -vy / disc.regularization;
    if (contact.open && law != Law::fixed_limits) {
      disc.slides = false;
      x = y = 0;
    } else if (law == Law::active_set && disc.slides) {
      disc.tangent_stiffness = std::min(disc.tangent_stiffness, 1 / disc.regularization);
      const double slip = vx * disc.slip_x + vy * disc.slip_y;
      x = -limit * disc.slip_x - disc.tangent_stiffness * (vx - slip * disc.slip_x);
      y = -limit * disc.slip_y - disc.tangent_stiffness * (vy - slip * disc.slip_y);
    } else if (law != Law::active_set) {
      const double speed = std::sqrt(vx * vx + vy * vy);
      disc.slides = speed > limit * disc.regularization;
      if (disc.slides) {
        disc.slip_x = vx / speed;
        disc.slip_y = vy / speed;
        disc.tangent_stiffness = limit / speed;
        if (law == Law::fixed_limits) {
          disc.force_x = disc.slip_x;
          disc.force_y = disc.slip_y;
        }
        x = -limit * disc.slip_x;
        y = -limit * disc.slip_y;
      }
    }
    p[0] = x;
    if (disc.size > 1) p[1] = y;
  }
}

/// Impulses at x_ and the residual F = A x - g - J^T p - servos.
void ContactNewton::evaluate_residual(Law law) {
  law_ = law;
  rounding_known_ = false;
  const bool still = std::all_of(x_.begin(), x_.end(), [](double x) { return x == 0; });
  for (int i = 0; i < n_; ++i) F_[at(i)] = -g_[at(i)];
  if (!still) kernel_.add_product(A(), A_last_.data(), n_, x_.data(), F_.data());
  for (int i = 0; i < n_; ++i) {
    if (law == Law::fixed_limits) {
      Bound& bound = bounds_[at(i)];
      bound.side = x_[at(i)] < bound.low ? -1 : (x_[at(i)] > bound.high ? 1 : 0);
      if (bound.side != 0) F_[at(i)] += (x_[at(i)] - end_of(bound)) / bound_compliance(i);
    }
    Servo& servo = servos_[at(i)];
    if (!(servo.limit > 0)) continue;
    const double pull = servo.offset - servo.slope * x_[at(i)];
    if (law != Law::active_set) servo.saturated = servo.side(pull);
    F_[at(i)] -= servo.saturated != 0 ? servo.saturated * servo.limit : pull;
  }
  find_row_velocities(still);
  whole_ = false;
  add_contact_impulses();
}

/// r = start + J x.
void ContactNewton::find_row_velocities(bool still) {
  r_.resize(kMostRows * contacts_.size());
  if (!still && !whole_) multiply_rows(x_.data(), r_.data());
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    const ContactRows& contact = contacts_[c];
    double* r = r_.data() + kMostRows * c;
    for (std::size_t k = 0; k < contact.rows; ++k)
      r[k] = whole_ ? r[k] + s_[kMostRows * c + k] : contact.start[k] + (still ? 0 : r[k]);
  }
}

/// The sum of the magnitudes of F's terms, into sum_.
void ContactNewton::find_rounding() {
  if (std::exchange(rounding_known_, true)) return;
  find_jacobians();
  for (int i = 0; i < n_; ++i) {
    sum_[at(i)] = std::abs(g_[at(i)]);
    const Bound& bound = bounds_[at(i)];
    if (law_ == Law::fixed_limits && bound.side != 0)
      sum_[at(i)] += (std::abs(x_[at(i)]) + std::abs(end_of(bound))) / bound_compliance(i);
    const Servo& servo = servos_[at(i)];
    if (servo.limit > 0)
      sum_[at(i)] += servo.saturated != 0 ? servo.limit : std::abs(servo.offset - servo.slope * x_[at(i)]);
  }
  for (const ContactRows& contact : contacts_) {
    if (contact.open && law_ != Law::fixed_limits) continue;
    const int* dofs = dofs_.data() + contact.first_dof;
    const double* J = entries(contact);
    for (std::size_t k = 0; k < contact.rows; ++k, J += contact.dof_count) {
      double size = std::abs(contact.start[k]), regularization = contact.regularization;
      for (std::size_t j = 0; j < contact.dof_count; ++j) size += std::abs(J[j] * x_[at(dofs[j])]);
      for (std::size_t i = 0; i < contact.disc_count; ++i)
        if (k >= contact.discs[i].row) regularization = contact.discs[i].regularization;
      for (std::size_t j = 0; j < contact.dof_count; ++j)
        sum_[at(dofs[j])] += std::abs(J[j]) * size / regularization;
    }
  }
}

/// Largest entry of F as a rate, without rounding where that is known.
double ContactNewton::largest_residual() const {
  double most = 0;
  for (int i = 0; i < n_; ++i) {
    if (kept(i)) continue;
    const double left = std::abs(F_[at(i)]) - (rounding_known_ ? kRounding * sum_[at(i)] : 0);
    // Written so that NaN counts.
    if (!(left <= 0)) most = std::max(most, std::isnan(left) ? HUGE_VAL : left / A_[entry(i, i)]);
  }
  return most;
}

/// The same; where it is beyond the tolerance, without rounding.
double ContactNewton::residual(double tolerance) {
  const double most = largest_residual();
  if (most <= tolerance || rounding_known_) return most;
  find_rounding();
  return largest_residual();
}

/// x += share d, projected on the bounds unless these are penalties.
void ContactNewton::advance(double share) {
  whole_ = share == 1;
  for (int i = 0; i < n_; ++i) {
    if (law_ == Law::fixed_limits) {
      x_[at(i)] += share * d_[at(i)];
      continue;
    }
    Bound& bound = bounds_[at(i)];
    if (bound.side != 0) continue;
    double& x = x_[at(i)];
    x += share * d_[at(i)];
    if (x < bound.low - kBeyond) bound.side = -1;
    if (x > bound.high + kBeyond) bound.side = 1;
    if (bound.side == 0) continue;
    x = end_of(bound);
    whole_ = false;
  }
}

/// Takes bounds whose multiplier has the wrong sign out of the active set.
bool ContactNewton::release_bounds() {
  bool any = false;
  for (int i = 0; i < n_; ++i) {
    Bound& bound = bounds_[at(i)];
    if (bound.side == 0 || !(bound.side * F_[at(i)] > 0)) continue;
    find_rounding();
    if (!(bound.side * F_[at(i)] > kRounding * sum_[at(i)])) continue;
    bound.side = 0;
    any = true;
  }
  return any;
}

/// Friction's direction at the end of the step d_, by the linearised law.
void ContactNewton::update_directions() {
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    ContactRows& contact = contacts_[c];
    const double* s = s_.data() + kMostRows * c;
    const double more = contact.open ? 0 : -s[0] / contact.regularization;
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      Disc& disc = contact.discs[k];
      double x = 0, y = 0;
      if (!contact.open) {
        const auto [xx, xy, yy] = stiffness(disc);
        const double sx = s[disc.row], sy = disc.size > 1 ? s[disc.row + 1] : 0;
        const double* p = contact.impulse.data() + disc.row;
        x = -p[0] + xx * sx + xy * sy;
        y = disc.size > 1 ? -p[1] + xy * sx + yy * sy : 0;
        if (disc.slides) {
          x += disc.coefficient * more * disc.force_x;
          y += disc.coefficient * more * disc.force_y;
        }
      }
      const double limit = disc.coefficient * std::max(contact.impulse[0] + more, 0.0);
      const double scale = 1 / std::max({limit, std::sqrt(x * x + y * y), 1e-300});
      disc.force_x = scale * x;
      disc.force_y = scale * y;
    }
  }
}

/// Factors the derivative of F at x_.
void ContactNewton::find_factor() {
  assemble();
  kernel_.factor(factor());
  size_columns();
  if (!columns_.empty()) {
    kernel_.eliminate_coupling(factor(), coupling());
    kernel_.factor_coupling(factor(), coupling());
  }
  factored_.clear();
  if (law_ == Law::fixed_limits) return;
  find_active_set();
  factored_ = active_;
}

/// Newton's step with the factor, into d_, and its J d, into s_.
void ContactNewton::find_newton_step(NewtonReport& report) {
  for (int i = 0; i < n_; ++i) d_[at(i)] = kept(i) ? 0 : -F_[at(i)];
  kernel_.eliminate(factor(), d_.data(), 0, chains_.size());
  if (!columns_.empty()) kernel_.apply_coupling(factor(), coupling(), d_.data());
  kernel_.substitute_back(factor(), d_.data(), 0, chains_.size());
  s_.resize(r_.size());
  multiply_rows(d_.data(), s_.data());
  ++report.iterations;
}

bool ContactNewton::solved(double tolerance, NewtonReport& report) {
  report.residual = residual(tolerance);
  report.solved = report.residual <= tolerance && !release_bounds();
  return report.solved;
}

/// Newton steps from an evaluated x.
void ContactNewton::newton_steps(int most, double tolerance, NewtonReport& report) {
  for (int i = 0; i < most && !report.solved; ++i) {
    find_factor();
    find_newton_step(report);
    update_directions();
    advance(1);
    evaluate_residual(Law::coulomb);
    solved(tolerance, report);
  }
}

void ContactNewton::keep_start() {
  Solution& start = scratch().latest;
  start.x = x_;
  start.bounds = bounds_;
  start.servos = servos_;
  std::vector<Outcome>& outcomes = scratch().start;
  outcomes.resize(contacts_.size());
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    const ContactRows& contact = contacts_[c];
    Outcome& to = outcomes[c];
    to.open = contact.open;
    to.impulse = contact.impulse;
    for (std::size_t k = 0; k < contact.disc_count; ++k) to.discs[k] = contact.discs[k];
  }
}

void ContactNewton::back_to_start() {
  const Solution& start = scratch().latest;
  x_ = start.x;
  bounds_ = start.bounds;
  servos_ = start.servos;
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    ContactRows& contact = contacts_[c];
    const Outcome& from = scratch().start[c];
    contact.open = from.open;
    contact.impulse = from.impulse;
    for (std::size_t k = 0; k < contact.disc_count; ++k)
      static_cast<Sliding&>(contact.discs[k]) = from.discs[k];
  }
}

/// Steps with the factor of an earlier problem, from an evaluated x, while the next may be the last: true
/// where it was. Else x has a smaller residual than it had, or is the start again.
bool ContactNewton::reuse_factor(double tolerance, NewtonReport& report) {
  keep_start();
  double last = largest_residual();
  for (int i = 0; i < kReusedSteps; ++i) {
    find_newton_step(report);
    update_directions();
    advance(1);
    evaluate_residual(Law::coulomb);
    if (solved(tolerance, report)) return true;
    // Linear convergence. Written so that NaN does not go on.
    if (!(report.residual * report.residual < tolerance * last)) break;
    last = report.residual;
  }
  if (report.residual < last) return false;
  back_to_start();
  evaluate_residual(Law::active_set);
  return false;
}

/// Whether the active set is that of the start.
bool ContactNewton::keeps_active_set() const {
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    const ContactRows& contact = contacts_[c];
    const Outcome& start = scratch().start[c];
    if (contact.open != start.open) return false;
    for (std::size_t k = 0; k < contact.disc_count; ++k)
      if (contact.discs[k].slides != start.discs[k].slides) return false;
  }
  return std::equal(servos_.begin(), servos_.begin() + n_, scratch().latest.servos.begin(),
                    [](const Servo& a, const Servo& b) { return a.saturated == b.saturated; });
}

/// Evaluates the start, by Coulomb's law where nothing opens, closes, sticks or slides anew: slow slip that
/// goes on bends along the cone, and the active set's straight continuation is further off. @returns whether
/// the start, which goes on as the last solution, solves this problem
bool ContactNewton::starts_solved(double tolerance, NewtonReport& report) {
  const double enough = kAtRest * tolerance;
  keep_start();
  evaluate_residual(Law::coulomb);
  if (largest_residual() <= enough && solved(enough, report)) return true;
  if (keeps_active_set()) return false;
  back_to_start();
  evaluate_residual(Law::active_set);
  return false;
}

/// Whether the factor of an earlier problem has solved this one. Where it fails again and again, as in fast
/// motion, ever more problems pass before it is tried again.
bool ContactNewton::solved_by_old_factor(double tolerance, NewtonReport& report) {
  if (!factor_fits()) return false;
  if (problems_to_pass_ > 0) {
    --problems_to_pass_;
    return false;
  }
  if (reuse_factor(tolerance, report)) {
    failures_ = 0;
    return true;
  }
  problems_to_pass_ = (1 << failures_) - 1;
  failures_ = std::min(failures_ + 1, kMostFailures);
  return false;
}

NewtonReport ContactNewton::solve_island(double tolerance) {
  jacobians_known_ = false;
  update_structure();
  for (int i = 0; i < n_; ++i) x_[at(i)] = bounds_[at(i)].side == 0 ? start_[at(i)] : end_of(bounds_[at(i)]);
  NewtonReport report;
  const bool heap = n_ > kHeap;
  if (heap && factor_work() > kMostWork) {
    gauss_seidel(tolerance, report);
    return report;
  }
  M_.resize(lay_out_rows(last_, M_start_));
  if (heap) scratch().latest.contacts = contacts_;
  if (heap)
    evaluate_residual(Law::active_set);
  else if (starts_solved(tolerance, report) || solved_by_old_factor(tolerance, report))
    return report;
  newton_steps(heap ? kHeapSteps : kNewtonSteps, tolerance, report);
  if (report.solved) return report;
  if (!heap) {
    iterate_limits(tolerance, report);
    return report;
  }
  contacts_ = scratch().latest.contacts;
  gauss_seidel(tolerance, report);
  return report;
}

}  // namespace handsim::engine::articulated
