// Fallback: friction with fixed limits (Tresca's friction). Where Newton's method does not converge for
// Coulomb's law, friction's limits are held, and updated by a fixed-point iteration, limit = coefficient x
// normal impulse (Panagiotopoulos 1975; Haslinger, Hlavacek, Necas 1996, "Numerical methods for unilateral
// problems in solid mechanics", section 9). With limits held, the step is the minimum of a strictly convex
// energy
//   x A x / 2 - g x + sum of max(0, -r_n)^2 / (2 R) + sum of Huber functions of r_t + servos + stops,
// which Newton's method with a line search finds. Every such step is physically sound: contacts push
// and do not pull, and friction dissipates.
#include <algorithm>
#include <cmath>

#include "handsim/engine/articulated/contact/fixed_limits.h"
#include "handsim/engine/articulated/contact/tuning.h"

namespace handsim::engine::articulated {

namespace {

/// First and second derivative of the energy along a direction.
struct Slope {
  double value = 0, rise = 0;
};

template <class F>
void each_disc(std::vector<ContactRows>& contacts, const F& f) {
  for (ContactRows& contact : contacts)
    for (std::size_t k = 0; k < contact.disc_count; ++k) f(contact, contact.discs[k]);
}

/// Derivatives of the energy along d at x + share d.
Slope energy_slope(const ContactProblem& p, const Workspace& w, double share) {
  Slope out;
  for (int i = 0; i < p.size(); ++i) {
    const double d = w.d[as_index(i)], x = p.x[as_index(i)] + share * d;
    out.rise += d * w.Ad[as_index(i)];
    out.value += d * (w.smooth[as_index(i)] + share * w.Ad[as_index(i)]);
    const Limits& limits = p.limits[as_index(i)];
    const double beyond = x - std::clamp(x, limits.low, limits.high);
    if (beyond != 0) {
      out.value += d * beyond / stop_compliance(p, i);
      out.rise += d * d / stop_compliance(p, i);
    }
    if (!(limits.limit > 0)) continue;
    const double pull = limits.offset - limits.slope * x;
    out.value -= d * std::clamp(pull, -limits.limit, limits.limit);
    if (std::abs(pull) < limits.limit) out.rise += limits.slope * d * d;
  }
  ContactRows contact;
  for (std::size_t c = 0; c < p.contacts.size(); ++c) {
    contact = p.contacts[c];
    const double *r = w.r.data() + kMostRows * c, *s = w.s.data() + kMostRows * c;
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

/// Step length along d, at most 1, that nearly minimises the energy: Newton's method with bisection as
/// safeguard.
double line_search(const ContactProblem& p, Workspace& w) {
  for (int i = 0; i < p.size(); ++i) {
    w.Ad[as_index(i)] = 0;
    w.smooth[as_index(i)] = -p.g[as_index(i)];
  }
  for (int i = 0; i < p.size(); ++i) {
    const double* row = p.A.data() + p.unknowns->row_start[as_index(i)];
    w.Ad[as_index(i)] += row[i] * w.d[as_index(i)];
    w.smooth[as_index(i)] += row[i] * p.x[as_index(i)];
    for (int j = i + 1; j <= p.unknowns->last[as_index(i)]; ++j) {
      w.Ad[as_index(i)] += row[j] * w.d[as_index(j)];
      w.Ad[as_index(j)] += row[j] * w.d[as_index(i)];
      w.smooth[as_index(i)] += row[j] * p.x[as_index(j)];
      w.smooth[as_index(j)] += row[j] * p.x[as_index(i)];
    }
  }
  const double start = energy_slope(p, w, 0).value;
  Slope end = energy_slope(p, w, 1);
  if (!(start < 0) || !(end.value > kTuning.flat * -start)) return 1;
  double low = 0, high = 1, share = 1;
  for (int i = 0; i < kTuning.searches; ++i) {
    double next = share - end.value / end.rise;
    // Written so that NaN is not taken; the middle where Newton's step leaves the bracket.
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    share = next;
    end = energy_slope(p, w, share);
    if (std::abs(end.value) <= kTuning.flat * -start) break;
    (end.value > 0 ? high : low) = share;
  }
  return share;
}

/// Minimises the energy with fixed limits, from x, to the tolerance or for `fixed_steps`.
void minimise(ContactProblem& p, SparseFactor& factor, Workspace& w, double tolerance, NewtonReport& report) {
  evaluate(p, w, Law::fixed_limits);
  for (int i = 0; i < kTuning.fixed_steps && !(residual(p, w, tolerance) <= tolerance); ++i) {
    factor.factor(p, w);
    compute_step(p, factor, w, report);
    evaluate(p, w, Law::fixed_limits, advance(p, w, line_search(p, w)));
  }
}

/// Aitken's relaxation of the limits (Irons and Tuck 1969), faster while updates grow, careful at a start.
/// @returns its factor
double update_limits(ContactProblem& p, double relaxation, double most) {
  double product = 0, square = 0;
  each_disc(p.contacts, [&](const ContactRows& contact, Disc& disc) {
    const double change = disc.coefficient * std::max(contact.impulse[0], 0.0) - disc.limit;
    const double more = change - disc.change;
    product += disc.change * more;
    square += more * more;
    disc.change = change;
  });
  if (!(square > 0))
    relaxation = 1;
  else if (product > 0)
    relaxation = std::min(kTuning.growth * relaxation, 100 * most);
  else
    relaxation = std::clamp(-relaxation * product / square, 0.25 * std::min(most, 1.0), most);
  each_disc(p.contacts, [&](const ContactRows&, Disc& disc) {
    disc.limit = std::max(disc.limit + relaxation * disc.change, 0.0);
  });
  return relaxation;
}

/// Moves the limits of the latest solution towards those that a Newton step for Coulomb's law predicts.
void predict_limits(ContactProblem& p, SparseFactor& factor, Workspace& w, NewtonReport& report) {
  factor.factor(p, w);
  compute_step(p, factor, w, report);
  for (std::size_t c = 0; c < p.contacts.size(); ++c) {
    const ContactRows& contact = p.contacts[c];
    const double s = w.s[kMostRows * c];
    const double end = contact.pad ? contact.impulse[0] - s / contact.regularization
                                   : -(w.r[kMostRows * c] + s) / contact.regularization;
    const double normal = contact.open ? 0 : std::max(end, 0.0);
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      Disc& disc = w.latest.contacts[c].discs[k];
      disc.limit += kTuning.predicted_share * (disc.coefficient * normal - disc.limit);
      disc.change = 0;
    }
  }
}

void restart_limits(ContactProblem& p, double multiple) {
  double largest = 0;
  for (const ContactRows& contact : p.contacts) largest = std::max(largest, contact.impulse[0]);
  each_disc(p.contacts, [&](const ContactRows&, Disc& disc) {
    disc.limit = multiple * largest * disc.coefficient;
    disc.change = 0;
  });
}

}  // namespace

void solve_fixed_limits(ContactProblem& p, SparseFactor& factor, Workspace& w, double tolerance,
                        NewtonReport& report) {
  std::ranges::fill(p.x, 0.0);
  restart_limits(p, 0);
  double relaxation = 1;
  double least = HUGE_VAL;
  const double work = factor.work();
  for (int i = 0;
       i < kTuning.limit_updates && (i == 0 || report.iterations * work < kTuning.most_fallback_work); ++i) {
    minimise(p, factor, w, tolerance, report);
    w.latest = p.iterate();
    ++report.limit_updates;
    evaluate(p, w, Law::coulomb);
    solved(p, w, tolerance, report);
    // The first one, whatever it is: a solution of this problem, also where no residual is a number.
    if (i == 0 || report.residual < least) {
      least = report.residual;
      w.best = w.latest;
    }
    const bool predicted = i >= kTuning.predicted_updates && i % 4 == 2;
    if (!report.solved && predicted) predict_limits(p, factor, w, report);
    newton_steps(p, factor, w, kTuning.steps_from_fixed, tolerance, report);
    if (report.solved) return;
    p.iterate() = w.latest;
    const bool restart = i % kTuning.restart == kTuning.restart - 1;
    if (restart)
      restart_limits(p, kTuning.restart_at[as_index(i / kTuning.restart) % kTuning.restart_at.size()]);
    if (!restart && !predicted)
      relaxation =
          update_limits(p, relaxation, i % 4 == 3 ? kTuning.long_relaxation : kTuning.short_relaxation);
  }
  p.iterate() = w.best;
  report.residual = least;
}

}  // namespace handsim::engine::articulated
