// Friction by fixed limits. Where Newton's method does not find Coulomb's law at once, friction's limits are
// held and updated from outside: limit = coefficient x normal impulse is the fixed point (Panagiotopoulos
// 1975; Haslinger, Hlavacek, Necas 1996, "Numerical methods for unilateral problems in solid mechanics",
// section 9: Tresca's friction). With limits held, the step is the least value of a strictly convex energy
//   x A x / 2 - g x + sum of max(0, -r_n)^2 / (2 softness) + sum of Huber functions of r_t + servos + stops,
// which Newton's method with a line search always finds. Every such step is a sound one: contacts push, do
// not pull, and friction only takes energy.
#include <algorithm>
#include <cmath>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/contact_newton.h"

namespace handsim::engine::articulated {

namespace {

/// Newton steps at fixed limits: in 10,000 random drops at most 45 were needed.
constexpr int kLeastSteps = 100;
/// Updates of the limits, and Newton steps with Coulomb's law from the solution of each.
constexpr int kMostUpdates = 240, kStepsFromFixed = 6;
/// After so many updates the limits start anew, at this many times the largest normal impulse in turn:
/// solutions that slide and solutions that stick are found from different ends.
constexpr int kRestart = 40;
constexpr std::array<double, 2> kRestartAt = {10, 0.3};
/// Largest relaxation of an update, and that of every fourth: the short ones leave limit cycles, the long
/// ones hasten slow convergence.
constexpr double kShort = 0.7, kLong = 1000;
/// From this update on every fourth goes half way to where Newton's step for Coulomb's law has the impulses.
constexpr int kNewtonUpdates = 80;
constexpr double kNewtonShare = 0.5;
constexpr double kGrowth = 2;  ///< of the relaxation where updates grow
/// Multiplications in factorisations after which no more updates are made: a twentieth of a second or less.
constexpr double kMostFallbackWork = 1.2e7;
constexpr int kSearches = 30;
/// Slope of the energy that a line search may leave, as a share of its start's.
constexpr double kFlat = 0.1;
/// Of stops as springs, as a share of what their coordinate alone gives way.
constexpr double kBoundCompliance = 1e-7;

}  // namespace

double ContactNewton::bound_compliance(int i) const { return kBoundCompliance / A_[entry(i, i)]; }

/// Slope of the energy at x + share d, and its rise.
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
    if (!contact.open) out.rise += s[0] * s[0] / contact.softness;
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      const Disc& disc = contact.discs[k];
      const auto [xx, xy, yy] = stiffness(disc);
      const double sx = s[disc.row], sy = disc.size > 1 ? s[disc.row + 1] : 0;
      out.rise += xx * sx * sx + 2 * xy * sx * sy + yy * sy * sy;
    }
  }
  return out;
}

/// Share of the step d_ at which the energy is least.
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

/// The step at fixed limits, from x_. False where rounding keeps it from the tolerance.
bool ContactNewton::minimise(double tolerance, NewtonReport& report) {
  evaluate(Law::fixed_limits);
  for (int i = 0; i < kLeastSteps && !(residual() <= tolerance); ++i) {
    find_step(report);
    advance(line_search());
    evaluate(Law::fixed_limits);
  }
  return residual() <= tolerance;
}

/// Moves the limits towards coefficient x normal impulse by Aitken's relaxation (Irons and Tuck 1969); where
/// updates grow, by ever longer steps. @returns the relaxation
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

/// Moves the limits towards what Newton's step from here, with Coulomb's law, would make of them.
void ContactNewton::predict_limits(NewtonReport& report) {
  find_step(report);
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    ContactRows &contact = contacts_[c], &to = latest_.contacts[c];
    const double end = -(r_[kMostRows * c] + s_[kMostRows * c]) / contact.softness;
    const double normal = contact.open ? 0 : std::max(end, 0.0);
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      Disc& disc = to.discs[k];
      disc.limit += kNewtonShare * (disc.coefficient * normal - disc.limit);
      disc.change = 0;
    }
  }
}

/// All limits alike, as a multiple of the largest normal impulse.
void ContactNewton::restart_limits(double multiple) {
  double largest = 0;
  for (const ContactRows& contact : contacts_) largest = std::max(largest, contact.impulse[0]);
  for (ContactRows& contact : contacts_)
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      contact.discs[k].limit = multiple * largest * contact.discs[k].coefficient;
      contact.discs[k].change = 0;
    }
}

/// Coulomb's law by way of fixed limits. Where it is not found, the solution at fixed limits that comes
/// nearest to it is the result.
void ContactNewton::iterate_limits(double tolerance, NewtonReport& report) {
  std::fill(x_.begin(), x_.end(), 0.0);
  restart_limits(0);
  double relaxation = 1;
  nearest_.residual = HUGE_VAL;
  const double work = factor_work();
  for (int i = 0; i < kMostUpdates && (i == 0 || report.iterations * work < kMostFallbackWork); ++i) {
    minimise(tolerance, report);
    latest_.x = x_;
    latest_.contacts = contacts_;
    latest_.bounds = bounds_;
    ++report.limit_updates;
    evaluate(Law::coulomb);
    solved(tolerance, report);
    latest_.residual = report.residual;
    if (latest_.residual < nearest_.residual) nearest_ = latest_;
    const bool predicted = i >= kNewtonUpdates && i % 4 == 2;
    if (!report.solved && predicted) predict_limits(report);
    if (!report.solved) newton_steps(kStepsFromFixed, tolerance, report);
    if (report.solved) return;
    x_ = latest_.x;
    contacts_ = latest_.contacts;
    bounds_ = latest_.bounds;
    const bool restart = i % kRestart == kRestart - 1;
    if (restart) restart_limits(kRestartAt[at(i / kRestart % 2)]);
    relaxation = restart || predicted ? 1 : update_limits(relaxation, i % 4 == 3 ? kLong : kShort);
  }
  x_ = nearest_.x;
  contacts_ = nearest_.contacts;
  bounds_ = nearest_.bounds;
  report.residual = nearest_.residual;
}

}  // namespace handsim::engine::articulated
