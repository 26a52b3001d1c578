#include "handsim/engine/articulated/contact/equation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "handsim/core/triple.h"
#include "handsim/engine/articulated/contact/tuning.h"

namespace handsim::engine::articulated {

namespace {

/// A residual below this share of the sum of its terms' magnitudes is rounding.
constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();

double* motion_of(const ContactProblem& p, Workspace& w, int body) {
  return w.carried.data() + kSpatial * as_index(body == kNone ? p.size() : body);
}

/// Motion of body a relative to b at a's origin: angular velocity, 0, velocity, 0.
void compute_relative_motion(const ContactProblem& p, Workspace& w, const Pair& pair, double* out) {
  const double *a = motion_of(p, w, pair.a), *b = motion_of(p, w, pair.b);
  const Triple turn(b), v = Triple(b + 4) + turn.cross(pair.apart);
  (Triple(a) - turn).store(out);
  (Triple(a + 4) - v).store(out + 4);
  out[3] = out[7] = 0;
}

/// A wrench on body a at its origin, and the opposite one on b.
void add_pair_wrench(const ContactProblem& p, Workspace& w, const Pair& pair, const double* wrench) {
  double *a = motion_of(p, w, pair.a), *b = motion_of(p, w, pair.b);
  const Triple on_a(wrench), f(wrench + 4), m = on_a + Triple(pair.apart).cross(f);
  (Triple(a) + on_a).store(a);
  (Triple(a + 4) + f).store(a + 4);
  (Triple(b) - m).store(b);
  (Triple(b + 4) - f).store(b + 4);
}

/// r = r0 + J x.
void compute_row_velocities(ContactProblem& p, Workspace& w, bool still, bool whole_step) {
  w.r.resize(kMostRows * p.contacts.size());
  if (!still && !whole_step) multiply_rows(p, w, p.x.data(), w.r.data());
  for (std::size_t c = 0; c < p.contacts.size(); ++c) {
    const ContactRows& contact = p.contacts[c];
    double* r = w.r.data() + kMostRows * c;
    for (std::size_t k = 0; k < contact.rows; ++k)
      r[k] = whole_step ? r[k] + w.s[kMostRows * c + k] : contact.r0[k] + (still ? 0 : r[k]);
  }
}

/// -J^T p, into F.
void add_contact_impulses(ContactProblem& p, Workspace& w) {
  std::ranges::fill(w.carried, 0.0);
  std::array<double, kSpatial> wrench{};
  int pair = kNone;
  const auto add_pair = [&] {
    if (pair != kNone) add_pair_wrench(p, w, p.pairs[as_index(pair)], wrench.data());
    wrench.fill(0);
  };
  for (std::size_t c = 0; c < p.contacts.size(); ++c) {
    ContactRows& contact = p.contacts[c];
    apply_law(contact, w.r.data() + kMostRows * c, w.law);
    if (contact.open && w.law != Law::fixed_limits) continue;
    if (contact.pair == kNone) {
      w.kernel.subtract_transposed(p.block(contact, 0, contact.rows), contact.impulse.data(), w.F.data());
      continue;
    }
    if (contact.pair != pair) add_pair();
    pair = contact.pair;
    w.kernel.add_wrenches(p.wrenches_of(contact), contact.rows, contact.impulse.data(), wrench.data());
  }
  add_pair();
  if (!p.pairs.empty())
    w.kernel.subtract_wrenches(p.motions.data(), p.unknowns->parent.data(), p.size(), w.carried.data(),
                               w.F.data());
}

}  // namespace

void Workspace::reserve(const Unknowns& most) {
  const std::size_t n = as_index(most.size());
  problem.reserve(most);
  island.reserve(most);
  reserve_each(n + 1, F, rounding, d, Ad, smooth, island_of_tree, place, members, first_member,
               first_touching, next);
  reserve_each(kUsualContacts * kMostRows, r, s, touching);
  carried.reserve(kSpatial * (n + 1));
  contacts_before.reserve(kUsualContacts);
  for (Iterate* each : {&before, &latest, &best}) each->reserve(n);
  reserve_each(n + kUsualContacts * (3 + most.widest()), layout, active);
  links.reserve(n * (n / 64 + 1));
}

void Workspace::resize(const ContactProblem& of) {
  for (std::vector<double>* each : {&F, &rounding, &d, &Ad, &smooth}) each->resize(as_index(of.size()));
  carried.resize(kSpatial * as_index(of.size() + 1));
}

void apply_law(ContactRows& contact, const double* r, Law law) {
  double& normal = contact.impulse[0];
  if (contact.pad) {
    const PadPoint::Push push = contact.pad->at(r[0]);
    normal = push.impulse;
    contact.regularization = 1 / push.slope;
  } else {
    normal = -r[0] / contact.regularization;
  }
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

double stop_compliance(const ContactProblem& p, int i) { return kTuning.stop_compliance / p.inertia(i); }

void multiply_rows(ContactProblem& p, Workspace& w, const double* x, double* out) {
  if (!p.pairs.empty())
    w.kernel.compute_motions(p.motions.data(), p.unknowns->parent.data(), p.size(), x, w.carried.data());
  std::array<double, kSpatial> motion;
  int pair = kNone;
  for (const ContactRows& contact : p.contacts) {
    if (contact.pair == kNone) {
      w.kernel.multiply(p.block(contact, 0, contact.rows), x, out);
    } else {
      if (contact.pair != pair) compute_relative_motion(p, w, p.pairs[as_index(contact.pair)], motion.data());
      pair = contact.pair;
      w.kernel.project(p.wrenches_of(contact), contact.rows, motion.data(), out);
    }
    out += kMostRows;
  }
}

void evaluate(ContactProblem& p, Workspace& w, Law law, bool whole_step) {
  w.law = law;
  w.rounding_known = false;
  const int n = p.size();
  const bool still = std::ranges::all_of(p.x, [](double x) { return x == 0; });
  for (int i = 0; i < n; ++i) w.F[as_index(i)] = -p.g[as_index(i)];
  if (!still)
    w.kernel.add_product({p.A.data(), p.unknowns->row_start.data()}, p.unknowns->last.data(), n, p.x.data(),
                         w.F.data());
  for (int i = 0; i < n; ++i) {
    const double x = p.x[as_index(i)];
    Limits& limits = p.limits[as_index(i)];
    if (law == Law::fixed_limits) {
      limits.side = x < limits.low ? LimitSide::low : (x > limits.high ? LimitSide::high : LimitSide::within);
      if (limits.side != LimitSide::within) w.F[as_index(i)] += (x - limits.bound()) / stop_compliance(p, i);
    }
    if (!(limits.limit > 0)) continue;
    const double pull = limits.offset - limits.slope * x;
    if (law != Law::active_set) limits.saturated = limits.side_of_pull(pull);
    w.F[as_index(i)] -= limits.torque(pull);
  }
  compute_row_velocities(p, w, still, whole_step);
  add_contact_impulses(p, w);
}

void compute_rounding(ContactProblem& p, Workspace& w) {
  if (std::exchange(w.rounding_known, true)) return;
  p.compute_jacobians(w.kernel);
  for (int i = 0; i < p.size(); ++i) {
    double& sum = w.rounding[as_index(i)];
    const double x = p.x[as_index(i)];
    sum = std::abs(p.g[as_index(i)]);
    const Limits& limits = p.limits[as_index(i)];
    if (w.law == Law::fixed_limits && limits.side != LimitSide::within)
      sum += (std::abs(x) + std::abs(limits.bound())) / stop_compliance(p, i);
    if (limits.limit > 0) sum += std::abs(limits.torque(limits.offset - limits.slope * x));
  }
  for (const ContactRows& contact : p.contacts) {
    if (contact.open && w.law != Law::fixed_limits) continue;
    const std::span<const Run> runs = p.runs_of(contact);
    const double *J = p.entries_of(contact), *entry = J;
    for (std::size_t k = 0; k < contact.rows; ++k, J += contact.dof_count) {
      double size = std::abs(contact.r0[k]), regularization = contact.regularization;
      if (k == 0 && contact.pad) size += std::abs(contact.pad->depth) / contact.pad->step;
      entry = J;
      for (const Run& run : runs)
        for (int i = run.first; i < run.end; ++i) size += std::abs(*entry++ * p.x[as_index(i)]);
      for (std::size_t i = 0; i < contact.disc_count; ++i)
        if (k >= contact.discs[i].row) regularization = contact.discs[i].regularization;
      const double share = size / regularization;
      entry = J;
      for (const Run& run : runs)
        for (int i = run.first; i < run.end; ++i) w.rounding[as_index(i)] += std::abs(*entry++) * share;
    }
  }
}

double largest_residual(const ContactProblem& p, const Workspace& w) {
  double most = 0;
  for (int i = 0; i < p.size(); ++i) {
    // A bound holds it.
    if (w.law != Law::fixed_limits && p.limits[as_index(i)].side != LimitSide::within) continue;
    const double left =
        std::abs(w.F[as_index(i)]) - (w.rounding_known ? kRounding * w.rounding[as_index(i)] : 0);
    // Written so that NaN counts.
    if (!(left <= 0)) most = std::max(most, std::isnan(left) ? HUGE_VAL : left / p.inertia(i));
  }
  return most;
}

double residual(ContactProblem& p, Workspace& w, double tolerance) {
  const double most = largest_residual(p, w);
  if (most <= tolerance || w.rounding_known) return most;
  compute_rounding(p, w);
  return largest_residual(p, w);
}

bool release_bounds(ContactProblem& p, Workspace& w) {
  bool any = false;
  for (int i = 0; i < p.size(); ++i) {
    Limits& bound = p.limits[as_index(i)];
    const double push = sign(bound.side) * w.F[as_index(i)];
    if (bound.side == LimitSide::within || !(push > 0)) continue;
    compute_rounding(p, w);
    if (!(push > kRounding * w.rounding[as_index(i)])) continue;
    bound.side = LimitSide::within;
    any = true;
  }
  return any;
}

}  // namespace handsim::engine::articulated
