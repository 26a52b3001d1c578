#include "handsim/engine/articulated/contact_newton.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "handsim/core/index.h"

namespace handsim::engine::articulated {

namespace {

/// Largest number of Newton steps from the active set of the last step. Chosen.
constexpr int kNewtonSteps = 15;
/// An island of more unknowns is a heap: more than two hands with what they hold, or a dozen loose bodies.
/// There are fewer Newton steps, with Gauss-Seidel as the only fallback; and no Newton steps at all where a
/// factorisation takes more multiplications than kMostWork. All three are chosen.
constexpr int kHeap = 72, kHeapSteps = 6;
constexpr double kMostWork = 5e4;
/// A residual below this share of the sum of its terms' magnitudes is rounding.
constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();
/// A bound is passed by more than rounding [m/s, rad/s].
constexpr double kBeyond = 1e-12;

}  // namespace

void ContactNewton::resize(std::span<const int> first) {
  lay_out(first);
  reserve(first.size());
  if (std::count(tree_first_.begin(), tree_first_.end(), 0) == n_) return;
  part_ = std::make_unique<ContactNewton>();
  part_->reserve(first.size());
}

/// Sizes everything for the unknowns; allocates only where there were never as many.
void ContactNewton::lay_out(std::span<const int> first) {
  n_ = static_cast<int>(first.size());
  A_first_.assign(first.begin(), first.end());
  A_last_.resize(at(n_));
  for (int i = 0; i < n_; ++i) {
    A_last_[at(i)] = i;
    for (int k = A_first_[at(i)]; k < i; ++k) A_last_[at(k)] = i;
  }
  first_ = A_first_;
  last_ = A_last_;
  lay_out(A_last_, A_start_, A_);
  tree_first_.resize(at(n_));
  tree_last_.resize(at(n_));
  // A tree's unknowns stand together, its root's last.
  for (int i = 0; i < n_; ++i) tree_first_[at(i)] = A_first_[at(i)];
  for (int i = n_ - 1; i >= 0; --i) {
    tree_last_[at(i)] = i == n_ - 1 || tree_first_[at(i + 1)] > i ? i : tree_last_[at(i + 1)];
    if (i > 0 && tree_first_[at(i)] < i)
      tree_first_[at(i - 1)] = std::min(tree_first_[at(i - 1)], tree_first_[at(i)]);
  }
  for (std::vector<double>* each : {&g_, &x_, &F_, &sum_, &d_, &Ad_}) each->assign(at(n_), 0.0);
  bounds_.resize(at(n_));
  servos_.resize(at(n_));
}

void ContactNewton::reserve(std::size_t n) {
  island_of_.reserve(n);
  place_.reserve(n);
  members_.reserve(n);
  touching_.reserve(kUsualContacts);
  for (std::vector<int>* each : {&first_member_, &first_touching_, &next_}) each->reserve(n + 1);
  const std::size_t most = std::min(n, at(kHeap)) * (std::min(n, at(kHeap)) + 1) / 2;
  for (std::vector<double>* each : {&A_, &M_}) each->reserve(most);
  for (std::vector<double>* each : {&g_, &x_, &F_, &sum_, &d_, &Ad_}) each->reserve(n);
  for (std::vector<int>* each :
       {&A_first_, &A_last_, &first_, &last_, &tree_first_, &tree_last_, &part_first_})
    each->reserve(n);
  for (std::vector<std::size_t>* each : {&A_start_, &M_start_}) each->reserve(n);
  bounds_.reserve(n);
  servos_.reserve(n);
  for (Solution* each : {&latest_, &best_}) {
    each->x.reserve(n);
    each->bounds.reserve(n);
    each->contacts.reserve(kUsualContacts);
  }
  contacts_.reserve(kUsualContacts);
  dofs_.reserve(kUsualContacts * n);
  J_.reserve(kUsualContacts * kMostRows * n);
  r_.reserve(kUsualContacts * kMostRows);
  s_.reserve(kUsualContacts * kMostRows);
  coupling_.reserve(kUsualContacts * n);
  C_.reserve(kUsualContacts * n);
  K_.reserve(kUsualContacts * (kUsualContacts + 1));
}

/// Rows of an upper triangle, each from its diagonal to its last entry, all zero.
void ContactNewton::lay_out(std::span<const int> last, std::vector<std::size_t>& start,
                            std::vector<double>& rows) const {
  start.resize(at(n_));
  std::size_t count = 0;
  for (int i = 0; i < n_; ++i) {
    start[at(i)] = count - at(i);  // entry (i, j) is at start + j
    count += at(last[at(i)] - i + 1);
  }
  rows.assign(count, 0.0);
}

void ContactNewton::begin() {
  std::fill(A_.begin(), A_.end(), 0.0);
  std::fill(g_.begin(), g_.end(), 0.0);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  std::fill(bounds_.begin(), bounds_.end(), Bound{-kInfinity, kInfinity, 0});
  std::fill(servos_.begin(), servos_.end(), Servo{});
  contacts_.clear();
  dofs_.clear();
  J_.clear();
}

void ContactNewton::bound(int i, double low, double high, double side) { bounds_[at(i)] = {low, high, side}; }

void ContactNewton::servo(int i, double offset, double slope, double limit, double saturated) {
  servos_[at(i)] = {offset, slope, limit, saturated};
}

ContactRows& ContactNewton::add(std::span<const int> dofs, std::size_t rows) {
  ContactRows& out = contacts_.emplace_back();
  out.rows = rows;
  out.first_dof = dofs_.size();
  out.dof_count = dofs.size();
  out.first_entry = J_.size();
  dofs_.insert(dofs_.end(), dofs.begin(), dofs.end());
  J_.resize(J_.size() + rows * dofs.size());
  return out;
}

/// The envelope of A and of all contacts.
void ContactNewton::find_envelope() {
  first_ = A_first_;
  for (const ContactRows& contact : contacts_)
    for (std::size_t k = 1; k < contact.dof_count; ++k) {
      int& first = first_[at(dofs_[contact.first_dof + k])];
      first = std::min(first, dofs_[contact.first_dof]);
    }
  for (int i = 0; i < n_; ++i) {
    last_[at(i)] = i;
    for (int k = first_[at(i)]; k < i; ++k) last_[at(k)] = i;
  }
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
  for (int i = 0; i < n_; ++i) {
    F_[at(i)] = -g_[at(i)];
    sum_[at(i)] = std::abs(g_[at(i)]);
  }
  for (int i = 0; i < n_; ++i) {
    const double* row = A_.data() + entry(i, 0);
    double sum = row[i] * x_[at(i)];
    for (int j = i + 1; j <= A_last_[at(i)]; ++j) {
      sum += row[j] * x_[at(j)];
      F_[at(j)] += row[j] * x_[at(i)];
    }
    F_[at(i)] += sum;
  }
  for (int i = 0; i < n_; ++i) {
    if (law == Law::fixed_limits) {
      Bound& bound = bounds_[at(i)];
      bound.side = x_[at(i)] < bound.low ? -1 : (x_[at(i)] > bound.high ? 1 : 0);
      if (bound.side != 0) {
        const double end = bound.side < 0 ? bound.low : bound.high;
        F_[at(i)] += (x_[at(i)] - end) / bound_compliance(i);
        sum_[at(i)] += (std::abs(x_[at(i)]) + std::abs(end)) / bound_compliance(i);
      }
    }
    Servo& servo = servos_[at(i)];
    if (!(servo.limit > 0)) continue;
    double pull = servo.offset - servo.slope * x_[at(i)];
    if (law != Law::active_set) servo.saturated = pull > servo.limit ? 1 : (pull < -servo.limit ? -1 : 0);
    if (servo.saturated != 0) pull = servo.saturated * servo.limit;
    F_[at(i)] -= pull;
    sum_[at(i)] += std::abs(pull);
  }
  add_contact_impulses();
}

/// -J^T p, into F_.
void ContactNewton::add_contact_impulses() {
  r_.resize(kMostRows * contacts_.size());
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    ContactRows& contact = contacts_[c];
    const int* dofs = dofs_.data() + contact.first_dof;
    const double* J = J_.data() + contact.first_entry;
    double* r = r_.data() + kMostRows * c;
    std::array<double, kMostRows> size{};
    for (std::size_t k = 0; k < contact.rows; ++k) {
      r[k] = contact.start[k];
      size[k] = std::abs(r[k]);
      for (std::size_t j = 0; j < contact.dof_count; ++j) {
        const double part = J[k * contact.dof_count + j] * x_[at(dofs[j])];
        r[k] += part;
        size[k] += std::abs(part);
      }
    }
    apply_law(contact, r, law_);
    if (contact.open && law_ != Law::fixed_limits) continue;
    size[0] /= contact.regularization;
    for (std::size_t k = 0; k < contact.disc_count; ++k)
      for (std::size_t row = 0; row < contact.discs[k].size; ++row)
        size[contact.discs[k].row + row] /= contact.discs[k].regularization;
    for (std::size_t k = 0; k < contact.rows; ++k)
      for (std::size_t j = 0; j < contact.dof_count; ++j) {
        const double share = J[k * contact.dof_count + j];
        F_[at(dofs[j])] -= share * contact.impulse[k];
        sum_[at(dofs[j])] += std::abs(share) * size[k];
      }
  }
}

/// Largest entry of F as a rate, without rounding.
double ContactNewton::residual() const {
  double most = 0;
  for (int i = 0; i < n_; ++i) {
    if (kept(i)) continue;
    const double left = std::abs(F_[at(i)]) - kRounding * sum_[at(i)];
    // Written so that NaN counts.
    if (!(left <= 0)) most = std::max(most, std::isnan(left) ? HUGE_VAL : left / A_[entry(i, i)]);
  }
  return most;
}

/// x += share d, projected on the bounds unless these are penalties.
void ContactNewton::advance(double share) {
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
    if (bound.side != 0) x = bound.side < 0 ? bound.low : bound.high;
  }
}

/// Takes bounds whose multiplier has the wrong sign out of the active set.
bool ContactNewton::release_bounds() {
  bool any = false;
  for (int i = 0; i < n_; ++i) {
    Bound& bound = bounds_[at(i)];
    if (bound.side == 0 || !(bound.side * F_[at(i)] > kRounding * sum_[at(i)])) continue;
    bound.side = 0;
    any = true;
  }
  return any;
}

/// s_ = J d_.
void ContactNewton::find_row_changes() {
  s_.resize(r_.size());
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    const ContactRows& contact = contacts_[c];
    for (std::size_t k = 0; k < contact.rows; ++k) {
      double& s = s_[kMostRows * c + k] = 0;
      for (std::size_t j = 0; j < contact.dof_count; ++j)
        s += J_[contact.first_entry + k * contact.dof_count + j] * d_[at(dofs_[contact.first_dof + j])];
    }
  }
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

/// Newton's step, into d_.
void ContactNewton::find_newton_step(NewtonReport& report) {
  assemble();
  factor();
  for (int i = 0; i < n_; ++i) d_[at(i)] = kept(i) ? 0 : -F_[at(i)];
  solve_factored(d_.data(), 0, n_ - 1);
  apply_coupling();
  find_row_changes();
  ++report.iterations;
}

bool ContactNewton::solved(double tolerance, NewtonReport& report) {
  report.residual = residual();
  report.solved = report.residual <= tolerance && !release_bounds();
  return report.solved;
}

/// Newton steps from an evaluated x.
void ContactNewton::newton_steps(int most, double tolerance, NewtonReport& report) {
  for (int i = 0; i < most && !report.solved; ++i) {
    find_newton_step(report);
    update_directions();
    advance(1);
    evaluate_residual(Law::coulomb);
    solved(tolerance, report);
  }
}

NewtonReport ContactNewton::solve_island(double tolerance) {
  find_envelope();
  for (int i = 0; i < n_; ++i) {
    const Bound& bound = bounds_[at(i)];
    x_[at(i)] = bound.side == 0 ? 0 : (bound.side < 0 ? bound.low : bound.high);
  }
  NewtonReport report;
  const bool heap = n_ > kHeap;
  if (heap && factor_work() > kMostWork) {
    gauss_seidel(tolerance, report);
    return report;
  }
  lay_out(last_, M_start_, M_);
  if (heap) latest_.contacts = contacts_;
  evaluate_residual(Law::active_set);
  newton_steps(heap ? kHeapSteps : kNewtonSteps, tolerance, report);
  if (report.solved) return report;
  if (!heap) {
    iterate_limits(tolerance, report);
    return report;
  }
  contacts_ = latest_.contacts;
  gauss_seidel(tolerance, report);
  return report;
}

}  // namespace handsim::engine::articulated
