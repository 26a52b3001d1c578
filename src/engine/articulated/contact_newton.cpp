#include "handsim/engine/articulated/contact_newton.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "handsim/core/index.h"

namespace handsim::engine::articulated {

namespace {

/// Newton steps from what was in force at the end of the last step.
constexpr int kNewtonSteps = 15;
/// What hangs together by more unknowns than this is a heap: more than two hands with what they hold, or a
/// dozen loose bodies. There Newton's method has fewer steps and no fallback but relaxation, and none at all
/// beyond so many multiplications in a factorisation.
constexpr int kHeap = 72, kHeapSteps = 6;
constexpr double kMostWork = 5e4;
/// Share of the forces that meet in a rate's equation below which what they leave is rounding.
constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();
/// Bounds are passed beyond rounding.
constexpr double kBeyond = 1e-12;

}  // namespace

void ContactNewton::resize(std::span<const int> first) {
  lay_out(first);
  reserve(first.size());
  if (std::count(tree_first_.begin(), tree_first_.end(), 0) == n_) return;
  part_ = std::make_unique<ContactNewton>();
  part_->reserve(first.size());
}

/// The problem's unknowns, without allocating where there were as many before.
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
  for (Solution* each : {&latest_, &nearest_}) {
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
void ContactNewton::widen() {
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

/// Multiplications of a factorisation.
double ContactNewton::factor_work() const {
  double work = 0;
  for (int i = 0; i < n_; ++i) work += 0.5 * (last_[at(i)] - i) * (last_[at(i)] - i);
  return work;
}

/// Impulses at row velocities r, and which parts of the law are in force.
void ContactNewton::apply_law(ContactRows& contact, const double* r, Law law) {
  double& normal = contact.impulse[0];
  normal = -r[0] / contact.softness;
  if (contact.tie) {
    contact.open = false;
    return;
  }
  if (law == Law::as_it_was)
    normal = contact.open ? 0 : normal;
  else
    contact.open = !(normal > 0);
  if (contact.open) normal = 0;
  for (std::size_t k = 0; k < contact.disc_count; ++k) {
    Disc& disc = contact.discs[k];
    double* p = contact.impulse.data() + disc.row;
    const double vx = r[disc.row], vy = disc.size > 1 ? r[disc.row + 1] : 0;
    const double limit = law == Law::fixed_limits ? disc.limit : disc.coefficient * normal;
    double x = -vx / disc.softness, y = -vy / disc.softness;
    if (contact.open && law != Law::fixed_limits) {
      disc.slides = false;
      x = y = 0;
    } else if (law == Law::as_it_was && disc.slides) {
      disc.lateral = std::min(disc.lateral, 1 / disc.softness);
      const double along = vx * disc.x + vy * disc.y;
      x = -limit * disc.x - disc.lateral * (vx - along * disc.x);
      y = -limit * disc.y - disc.lateral * (vy - along * disc.y);
    } else if (law != Law::as_it_was) {
      const double speed = std::sqrt(vx * vx + vy * vy);
      disc.slides = speed > limit * disc.softness;
      if (disc.slides) {
        disc.x = vx / speed;
        disc.y = vy / speed;
        disc.lateral = limit / speed;
        if (law == Law::fixed_limits) {
          disc.px = disc.x;
          disc.py = disc.y;
        }
        x = -limit * disc.x;
        y = -limit * disc.y;
      }
    }
    p[0] = x;
    if (disc.size > 1) p[1] = y;
  }
}

/// Impulses at x_ and what is left of the equation, F = A x - g - J^T p - servos.
void ContactNewton::evaluate(Law law) {
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
    if (law != Law::as_it_was) servo.saturated = pull > servo.limit ? 1 : (pull < -servo.limit ? -1 : 0);
    if (servo.saturated != 0) pull = servo.saturated * servo.limit;
    F_[at(i)] -= pull;
    sum_[at(i)] += std::abs(pull);
  }
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
    apply_law(contact, r, law);
    if (contact.open && law != Law::fixed_limits) continue;
    size[0] /= contact.softness;
    for (std::size_t k = 0; k < contact.disc_count; ++k)
      for (std::size_t row = 0; row < contact.discs[k].size; ++row)
        size[contact.discs[k].row + row] /= contact.discs[k].softness;
    for (std::size_t k = 0; k < contact.rows; ++k)
      for (std::size_t j = 0; j < contact.dof_count; ++j) {
        const double share = J[k * contact.dof_count + j];
        F_[at(dofs[j])] -= share * contact.impulse[k];
        sum_[at(dofs[j])] += std::abs(share) * size[k];
      }
  }
}

/// What the equation leaves, as a rate; rounding does not count.
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

/// x += share d. What passes a bound stays on it, but where bounds are springs.
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

/// Lets go of bounds that would have to pull.
bool ContactNewton::release() {
  bool any = false;
  for (int i = 0; i < n_; ++i) {
    Bound& bound = bounds_[at(i)];
    if (bound.side == 0 || !(bound.side * F_[at(i)] > kRounding * sum_[at(i)])) continue;
    bound.side = 0;
    any = true;
  }
  return any;
}

/// Rows' velocities that the step d_ adds.
void ContactNewton::find_changes() {
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

/// Friction's direction at the end of the step d_, by the step's linear model.
void ContactNewton::update_directions() {
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    ContactRows& contact = contacts_[c];
    const double* s = s_.data() + kMostRows * c;
    const double more = contact.open ? 0 : -s[0] / contact.softness;
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
          x += disc.coefficient * more * disc.px;
          y += disc.coefficient * more * disc.py;
        }
      }
      const double limit = disc.coefficient * std::max(contact.impulse[0] + more, 0.0);
      const double scale = 1 / std::max({limit, std::sqrt(x * x + y * y), 1e-300});
      disc.px = scale * x;
      disc.py = scale * y;
    }
  }
}

/// Newton's step, into d_.
void ContactNewton::find_step(NewtonReport& report) {
  assemble();
  factor();
  for (int i = 0; i < n_; ++i) d_[at(i)] = kept(i) ? 0 : -F_[at(i)];
  solve_factored(d_.data(), 0, n_ - 1);
  couple();
  find_changes();
  ++report.iterations;
}

bool ContactNewton::solved(double tolerance, NewtonReport& report) {
  report.residual = residual();
  report.solved = report.residual <= tolerance && !release();
  return report.solved;
}

/// Newton steps from an evaluated x.
void ContactNewton::newton_steps(int most, double tolerance, NewtonReport& report) {
  for (int i = 0; i < most && !report.solved; ++i) {
    find_step(report);
    update_directions();
    advance(1);
    evaluate(Law::coulomb);
    solved(tolerance, report);
  }
}

NewtonReport ContactNewton::solve_island(double tolerance) {
  widen();
  for (int i = 0; i < n_; ++i) {
    const Bound& bound = bounds_[at(i)];
    x_[at(i)] = bound.side == 0 ? 0 : (bound.side < 0 ? bound.low : bound.high);
  }
  NewtonReport report;
  const bool heap = n_ > kHeap;
  if (heap && factor_work() > kMostWork) {
    relax(tolerance, report);
    return report;
  }
  lay_out(last_, M_start_, M_);
  if (heap) latest_.contacts = contacts_;
  evaluate(Law::as_it_was);
  newton_steps(heap ? kHeapSteps : kNewtonSteps, tolerance, report);
  if (report.solved) return report;
  if (!heap) {
    iterate_limits(tolerance, report);
    return report;
  }
  contacts_ = latest_.contacts;
  relax(tolerance, report);
  return report;
}

}  // namespace handsim::engine::articulated
