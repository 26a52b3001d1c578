// Fallback: friction with fixed limits (Tresca's friction). Where Newton's method does not converge for
// Coulomb's law, friction's limits are held, and updated by a fixed-point iteration, limit = coefficient x
// normal impulse (Panagiotopoulos 1975; Haslinger, Hlavacek, Necas 1996, "Numerical methods for unilateral
// problems in solid mechanics", section 9). With limits held, the step is the minimum of a strictly convex
// energy
//   x A x / 2 - g x + sum of max(0, -r_n)^2 / (2 R) + sum of Huber functions of r_t + servos + stops,
// which Newton's method with a line search always finds. Every such step is physically sound: contacts push
// and do not pull, and friction dissipates.
#include <algorithm>
#include <cmath>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/contact/solver.h"

namespace handsim::engine::articulated {

namespace {

/// Newton steps at fixed limits: in 10,000 random drops at most 45 were needed.
constexpr int kLeastSteps = 100;
/// Updates of the limits, and Newton steps with Coulomb's law from the solution of each.
constexpr int kMostUpdates = 240, kStepsFromFixed = 6;
/// After so many updates the limits start anew, at these multiples of the largest normal impulse by turns:
/// from large ones sticking solutions are found, from small ones sliding solutions.
constexpr int kRestart = 40;
constexpr std::array<double, 5> kRestartAt = {10, 0.3, 2, 0.05, 1};
/// Largest relaxation factor of an update, and that of every fourth: small ones end limit cycles, large ones
/// speed up slow convergence. Chosen, as the numbers above and below.
constexpr double kShort = 0.7, kLong = 1000;
/// From this update on every fourth moves the limits half way to those that a Newton step for Coulomb's law
/// predicts.
constexpr int kNewtonUpdates = 80;
constexpr double kNewtonShare = 0.5;
constexpr double kGrowth = 2;  ///< of the relaxation factor while updates grow
/// Multiplications in factorisations after which the iteration ends: 0.05 s or less.
constexpr double kMostFallbackWork = 1.2e7;
constexpr int kSearches = 30;
/// The line search ends where the energy's slope is this share of that at its start (strong Wolfe condition).
constexpr double kFlat = 0.1;
/// Compliance of stops as penalties, as a share of the inverse inertia of their coordinate. Chosen.
constexpr double kBoundCompliance = 1e-7;

}  // namespace

double ContactNewton::bound_compliance(int i) const { return kBoundCompliance / A_[entry(i, i)]; }

/// First and second derivative of the energy along d at x + share d.
ContactNewton::Slope ContactNewton::energy_slope(double share) const {
  Slope out;
  for (int i = 0; i < n_; ++i) {
    const double d = d_[at(i)], x = x_[at(i)] + share * d;
    out.rise += d * Ad_[at(i)];
    out.value += d * (sum_[at(i)] + share * Ad_[at(i)]);
    const Bound& bound = bounds_[at(i)];
    const double beyond = x - std::clamp(x, bound.low, bound.high);
    if (beyond != 0) {
      out.value += d * beyond / bound_compliance(i);
      out.rise += d * d / bound_compliance(i);
    }
    const Servo& servo = servos_[at(i)];
    if (!(servo.limit > 0)) continue;
    const double pull = servo.offset - servo.slope * x;
    out.value -= d * std::clamp(pull, -servo.limit, servo.limit);
    if (std::abs(pull) < servo.limit) out.rise += servo.slope * d * d;
  }
  ContactRows contact;
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    contact = contacts_[c];
    const double *r = r_.data() + kMostRows * c, *s = s_.data() + kMostRows * c;
    std::array<double, kMostRows> now{};
    for (std::size_t k = 0; k < contact.rows; ++k) now[k] = r[k] + share * s[k];
    apply_law(contact, now.data(), Law::fixed_limits);
    for (std::size_t k = 0; k < contact.rows; ++k) out.value -= s[k] * contact.impulse[k];
    if (!contact.open) out.rise += s[0] * s[0] / contact.regularization;
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      const Disc& disc = contact.discs[k];
      const auto [xx, xy, yy] = stiffness(disc);
      const double sx = s[disc.row], sy = disc.size > 1 ? s[disc.row + 1] : 0;
      out.rise += xx * sx * sx + 2 * xy * sx * sy + yy * sy * sy;
    }
  }
  return out;
}

/// Step length along d_ that minimises the energy: Newton's method with bisection as safeguard.
double ContactNewton::line_search() {
  // A d, and what of F does not depend on the law, into sum_.
  for (int i = 0; i < n_; ++i) {
    Ad_[at(i)] = 0;
    sum_[at(i)] = -g_[at(i)];
  }
  for (int i = 0; i < n_; ++i) {
    const double* row = A_.data() + entry(i, 0);
    Ad_[at(i)] += row[i] * d_[at(i)];
    sum_[at(i)] += row[i] * x_[at(i)];
    for (int j = i + 1; j <= A_last_[at(i)]; ++j) {
      Ad_[at(i)] += row[j] * d_[at(j)];
      Ad_[at(j)] += row[j] * d_[at(i)];
      sum_[at(i)] += row[j] * x_[at(j)];
      sum_[at(j)] += row[j] * x_[at(i)];
    }
  }
  const double start = energy_slope(0).value;
  Slope end = energy_slope(1);
  if (!(start < 0) || !(end.value > kFlat * -start)) return 1;
  double low = 0, high = 1, share = 1;
  for (int i = 0; i < kSearches; ++i) {
    double next = share - end.value / end.rise;
    // Written so that NaN is not taken; the middle where Newton's step leaves the bracket.
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    share = next;
    end = energy_slope(share);
    if (std::abs(end.value) <= kFlat * -start) break;
    (end.value > 0 ? high : low) = share;
  }
  return share;
}

/// Minimises the energy with fixed limits, from x_. False where rounding prevents the tolerance.
bool ContactNewton::minimise(double tolerance, NewtonReport& report) {
  evaluate_residual(Law::fixed_limits);
  for (int i = 0; i < kLeastSteps && !(residual(tolerance) <= tolerance); ++i) {
    find_factor();
    find_newton_step(report);
    advance(line_search());
    evaluate_residual(Law::fixed_limits);
  }
  return residual(tolerance) <= tolerance;
}

/// Moves the limits towards coefficient x normal impulse with Aitken's relaxation (Irons and Tuck 1969);
/// while updates grow, with ever larger factors. @returns the relaxation factor
double ContactNewton::update_limits(double relaxation, double most) {
  double product = 0, square = 0;
  for (ContactRows& contact : contacts_)
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      Disc& disc = contact.discs[k];
      const double change = disc.coefficient * std::max(contact.impulse[0], 0.0) - disc.limit;
      const double more = change - disc.change;
      product += disc.change * more;
      square += more * more;
      disc.change = change;
    }
  if (!(square > 0))
    relaxation = 1;
  else if (product > 0)
    relaxation = std::min(kGrowth * relaxation, 100 * most);
  else
    relaxation = std::clamp(-relaxation * product / square, 0.25 * std::min(most, 1.0), most);
  for (ContactRows& contact : contacts_)
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      Disc& disc = contact.discs[k];
      disc.limit = std::max(disc.limit + relaxation * disc.change, 0.0);
    }
  return relaxation;
}

/// Moves the limits towards those that a Newton step for Coulomb's law predicts.
void ContactNewton::predict_limits(NewtonReport& report) {
  find_factor();
  find_newton_step(report);
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    ContactRows &contact = contacts_[c], &to = scratch().latest.contacts[c];
    const double end = -(r_[kMostRows * c] + s_[kMostRows * c]) / contact.regularization;
    const double normal = contact.open ? 0 : std::max(end, 0.0);
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      Disc& disc = to.discs[k];
      disc.limit += kNewtonShare * (disc.coefficient * normal - disc.limit);
      disc.change = 0;
    }
  }
}

/// Sets all limits to a multiple of the largest normal impulse.
void ContactNewton::restart_limits(double multiple) {
  double largest = 0;
  for (const ContactRows& contact : contacts_) largest = std::max(largest, contact.impulse[0]);
  for (ContactRows& contact : contacts_)
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      contact.discs[k].limit = multiple * largest * contact.discs[k].coefficient;
      contact.discs[k].change = 0;
    }
}

/// Coulomb's law by iterated limits. Where this does not converge, the solution with the least residual is
/// the result.
void ContactNewton::iterate_limits(double tolerance, NewtonReport& report) {
  std::fill(x_.begin(), x_.end(), 0.0);
  restart_limits(0);
  double relaxation = 1;
  Solution &latest = scratch().latest, &best = scratch().best;
  best.residual = HUGE_VAL;
  const double work = factor_work();
  for (int i = 0; i < kMostUpdates && (i == 0 || report.iterations * work < kMostFallbackWork); ++i) {
    minimise(tolerance, report);
    latest.x = x_;
    latest.contacts = contacts_;
    latest.bounds = bounds_;
    ++report.limit_updates;
    evaluate_residual(Law::coulomb);
    solved(tolerance, report);
    latest.residual = report.residual;
    if (latest.residual < best.residual) best = latest;
    const bool predicted = i >= kNewtonUpdates && i % 4 == 2;
    if (!report.solved && predicted) predict_limits(report);
    if (!report.solved) newton_steps(kStepsFromFixed, tolerance, report);
    if (report.solved) return;
    x_ = latest.x;
    contacts_ = latest.contacts;
    bounds_ = latest.bounds;
    const bool restart = i % kRestart == kRestart - 1;
    if (restart) restart_limits(kRestartAt[at(i / kRestart) % kRestartAt.size()]);
    relaxation = restart || predicted ? 1 : update_limits(relaxation, i % 4 == 3 ? kLong : kShort);
  }
  x_ = best.x;
  contacts_ = best.contacts;
  bounds_ = best.bounds;
  report.residual = best.residual;
}

}  // namespace handsim::engine::articulated
