#include <algorithm>
#include <cmath>

#include "handsim/engine/articulated/contact/newton.h"
#include "handsim/engine/articulated/contact/tuning.h"

namespace handsim::engine::articulated {

namespace {

constexpr double kBeyond = 1e-12;  ///< A bound is passed by more than rounding [m/s, rad/s].

/// Friction's direction at the end of the step d, by the linearised law.
void update_directions(ContactProblem& p, const Workspace& w) {
  for (std::size_t c = 0; c < p.contacts.size(); ++c) {
    ContactRows& contact = p.contacts[c];
    const double* s = w.s.data() + kMostRows * c;
    const double more = contact.open ? 0 : -s[0] / contact.regularization;
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      Disc& disc = contact.discs[k];
      double x = 0, y = 0;
      if (!contact.open) {
        const auto [xx, xy, yy] = stiffness(disc);
        const double sx = s[disc.row], sy = disc.size > 1 ? s[disc.row + 1] : 0;
        const double* impulse = contact.impulse.data() + disc.row;
        x = -impulse[0] + xx * sx + xy * sy;
        y = disc.size > 1 ? -impulse[1] + xy * sx + yy * sy : 0;
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

/// Share of a step that no pad's exponential overshoots: a pad deepens by the logarithm of what its tangent
/// asks for, where that is far, as voltages of diodes do in circuit simulators (Nagel 1975, SPICE2).
double within_pads(const ContactProblem& p, const Workspace& w) {
  double share = 1;
  for (std::size_t c = 0; c < p.contacts.size(); ++c) {
    const PadPoint* point = p.contacts[c].pad;
    if (!point) continue;
    const double rise = point->pad->rise(), scale = point->step / rise;
    const double deeper = -scale * w.s[kMostRows * c];
    if (!(deeper > kTuning.most_rises)) continue;
    const double now = point->depth / rise - scale * w.r[kMostRows * c], from = std::max(now, 0.0);
    if (const double more = now + deeper - from; more > kTuning.most_rises)
      share = std::min(share, (from + std::log1p(more) - now) / deeper);
  }
  return share;
}

/// A step with the factor for Coulomb's law.
void take_step(ContactProblem& p, SparseFactor& factor, Workspace& w, NewtonReport& report) {
  compute_step(p, factor, w, report);
  update_directions(p, w);
  evaluate(p, w, Law::coulomb, advance(p, w, within_pads(p, w)));
}

void save_iterate(const ContactProblem& p, Workspace& w) {
  w.before.x = p.x;
  w.before.limits = p.limits;
  w.contacts_before.resize(p.contacts.size());
  for (std::size_t c = 0; c < p.contacts.size(); ++c) {
    const ContactRows& contact = p.contacts[c];
    Workspace::Outcome& to = w.contacts_before[c];
    to.open = contact.open;
    to.impulse = contact.impulse;
    for (std::size_t k = 0; k < contact.disc_count; ++k) to.discs[k] = contact.discs[k];
  }
}

/// Whether the residual is within the tolerance, and no bound is to be released.
bool holds(ContactProblem& p, Workspace& w, double tolerance, NewtonReport& report) {
  report.solved = report.residual <= tolerance && !release_bounds(p, w);
  return report.solved;
}

/// Back to the start, evaluated with its active set.
void restart(ContactProblem& p, Workspace& w) {
  p.x = w.before.x;
  p.limits = w.before.limits;
  for (std::size_t c = 0; c < p.contacts.size(); ++c) {
    ContactRows& contact = p.contacts[c];
    const Workspace::Outcome& from = w.contacts_before[c];
    contact.open = from.open;
    contact.impulse = from.impulse;
    for (std::size_t k = 0; k < contact.disc_count; ++k)
      static_cast<Sliding&>(contact.discs[k]) = from.discs[k];
  }
  evaluate(p, w, Law::active_set);
}

bool keeps_active_set(const ContactProblem& p, const Workspace& w) {
  for (std::size_t c = 0; c < p.contacts.size(); ++c) {
    const ContactRows& contact = p.contacts[c];
    const Workspace::Outcome& before = w.contacts_before[c];
    if (contact.open != before.open) return false;
    for (std::size_t k = 0; k < contact.disc_count; ++k)
      if (contact.discs[k].slides != before.discs[k].slides) return false;
  }
  return std::ranges::equal(p.limits, w.before.limits, {}, &Limits::saturated, &Limits::saturated);
}

/// Whether the start passes no stop, which steps are projected on.
bool keeps_bounds(const ContactProblem& p) {
  for (int i = 0; i < p.size(); ++i)
    if (const Limits& bound = p.limits[as_index(i)];
        bound.side == LimitSide::within &&
        (p.x[as_index(i)] < bound.low - kBeyond || p.x[as_index(i)] > bound.high + kBeyond))
      return false;
  return true;
}

/// Evaluates the start; by Coulomb's law where nothing opens, closes, sticks or slides anew: slow slip bends
/// along the cone, away from the active set's straight continuation. @returns whether it solves the problem
bool starts_solved(ContactProblem& p, Workspace& w, double tolerance, NewtonReport& report) {
  const double enough = kTuning.at_rest * tolerance;
  save_iterate(p, w);
  evaluate(p, w, Law::coulomb);
  if (largest_residual(p, w) <= enough && keeps_bounds(p) && solved(p, w, enough, report)) return true;
  if (!keeps_active_set(p, w)) restart(p, w);
  return false;
}

/// Steps with the factor of an earlier problem, from an evaluated x, while the next may be the last: true
/// where it was. Else x has a smaller residual than it had, or is the start again.
bool reuse_factor(ContactProblem& p, SparseFactor& factor, Workspace& w, double tolerance,
                  NewtonReport& report) {
  save_iterate(p, w);
  double last = largest_residual(p, w);
  for (int i = 0; i < kTuning.reused_steps; ++i) {
    take_step(p, factor, w, report);
    report.residual = largest_residual(p, w);
    // Linear convergence. Written so that NaN does not go on.
    const auto converges = [&] { return report.residual * report.residual < tolerance * last; };
    // What may be rounding is looked into where no step follows: it takes Jacobians, a fifth of a problem's
    // time.
    const bool goes_on = converges() && i + 1 < kTuning.reused_steps;
    if (report.residual <= tolerance ? holds(p, w, tolerance, report)
                                     : !goes_on && solved(p, w, tolerance, report))
      return true;
    if (!converges()) break;
    last = report.residual;
  }
  if (!(report.residual < last)) restart(p, w);
  return false;
}

}  // namespace

void compute_step(ContactProblem& p, SparseFactor& factor, Workspace& w, NewtonReport& report) {
  const auto kept = [&](int i) {
    return w.law != Law::fixed_limits && p.limits[as_index(i)].side != LimitSide::within;
  };
  for (int i = 0; i < p.size(); ++i) w.d[as_index(i)] = kept(i) ? 0 : -w.F[as_index(i)];
  factor.solve(w, w.d.data());
  // An earlier problem's factor does not know which unknowns are at a bound.
  for (int i = 0; i < p.size(); ++i)
    if (kept(i)) w.d[as_index(i)] = 0;
  w.s.resize(w.r.size());
  multiply_rows(p, w, w.d.data(), w.s.data());
  ++report.iterations;
}

bool advance(ContactProblem& p, const Workspace& w, double share) {
  bool whole = share == 1;
  for (int i = 0; i < p.size(); ++i) {
    double& x = p.x[as_index(i)];
    Limits& bound = p.limits[as_index(i)];
    const bool penalty = w.law == Law::fixed_limits;
    if (!penalty && bound.side != LimitSide::within) continue;
    x += share * w.d[as_index(i)];
    if (penalty) continue;
    if (x < bound.low - kBeyond) bound.side = LimitSide::low;
    if (x > bound.high + kBeyond) bound.side = LimitSide::high;
    if (bound.side == LimitSide::within) continue;
    x = bound.bound();
    whole = false;
  }
  return whole;
}

bool solved(ContactProblem& p, Workspace& w, double tolerance, NewtonReport& report) {
  report.residual = residual(p, w, tolerance);
  return holds(p, w, tolerance, report);
}

void newton_steps(ContactProblem& p, SparseFactor& factor, Workspace& w, int most, double tolerance,
                  NewtonReport& report) {
  for (int i = 0; i < most && !report.solved; ++i) {
    factor.factor(p, w);
    take_step(p, factor, w, report);
    solved(p, w, tolerance, report);
  }
}

void solve_newton(ContactProblem& p, SparseFactor& factor, Workspace& w, double tolerance,
                  NewtonReport& report) {
  if (starts_solved(p, w, tolerance, report)) return;
  if (factor.begin_trial(p, w)) {
    factor.end_trial(reuse_factor(p, factor, w, tolerance, report));
    if (report.solved) return;
  }
  newton_steps(p, factor, w, kTuning.newton_steps, tolerance, report);
}

}  // namespace handsim::engine::articulated
