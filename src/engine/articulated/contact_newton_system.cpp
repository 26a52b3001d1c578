// The linear system of a Newton step: assembly, sparse Cholesky factor without fill-in outside its envelope,
// and the low-rank unsymmetric part of sliding contacts.
#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "handsim/engine/articulated/contact_newton.h"

#include "handsim/core/index.h"

namespace handsim::engine::articulated {

namespace {

using Row = Eigen::Map<Eigen::VectorXd>;
using ConstRow = Eigen::Map<const Eigen::VectorXd>;

}  // namespace

/// Multiplications of a factorisation.
double ContactNewton::factor_work() const {
  double work = 0;
  for (int i = 0; i < n_; ++i) work += 0.5 * (last_[at(i)] - i) * (last_[at(i)] - i);
  return work;
}

/// The derivative of F: M is its symmetric part, C and G are friction's dependence on the normal impulse.
void ContactNewton::assemble() {
  for (int i = 0; i < n_; ++i) {
    double* M = M_.data() + M_entry(i, 0);
    const double* A = A_.data() + entry(i, 0);
    std::copy(A + i, A + A_last_[at(i)] + 1, M + i);
    std::fill(M + A_last_[at(i)] + 1, M + std::max(A_last_[at(i)], last_[at(i)]) + 1, 0.0);
    const Servo& servo = servos_[at(i)];
    if (servo.limit > 0 && servo.saturated == 0) M[i] += servo.slope;
    if (law_ == Law::fixed_limits && bounds_[at(i)].side != 0) M[i] += 1 / bound_compliance(i);
  }
  coupled_ = 0;
  coupling_.clear();
  for (const ContactRows& contact : contacts_) {
    if (contact.open && law_ != Law::fixed_limits) continue;
    const std::size_t m = contact.dof_count;
    const int* dofs = dofs_.data() + contact.first_dof;
    const double* J = J_.data() + contact.first_entry;
    const auto add = [&](double weight, const double* row) {
      for (std::size_t i = 0; i < m; ++i) {
        if (row[i] == 0) continue;
        const double scaled = weight * row[i];
        double* to = M_.data() + M_entry(dofs[i], 0);
        for (std::size_t j = i; j < m; ++j) to[dofs[j]] += scaled * row[j];
      }
    };
    if (!contact.open) add(1 / contact.regularization, J);
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      const Disc& disc = contact.discs[k];
      const double* rows = J + disc.row * m;
      const auto [xx, xy, yy] = stiffness(disc);
      if (disc.size == 1) {
        add(xx, rows);
      } else {
        const double *first = rows, *second = rows + m;
        for (std::size_t i = 0; i < m; ++i) {
          const double a = xx * first[i] + xy * second[i], b = xy * first[i] + yy * second[i];
          double* to = M_.data() + M_entry(dofs[i], 0);
          for (std::size_t j = i; j < m; ++j) to[dofs[j]] += a * first[j] + b * second[j];
        }
      }
      if (!disc.slides || law_ == Law::fixed_limits) continue;
      const double share = disc.coefficient / contact.regularization;
      for (std::size_t j = 0; j < m; ++j) {
        if (bounds_[at(dofs[j])].side != 0) continue;
        const double slip = disc.force_x * rows[j] + (disc.size > 1 ? disc.force_y * rows[m + j] : 0);
        coupling_.push_back({coupled_, dofs[j], share * slip, J[j]});
      }
      ++coupled_;
    }
  }
  if (law_ == Law::fixed_limits) return;
  for (int i = 0; i < n_; ++i) {
    if (bounds_[at(i)].side == 0) continue;
    std::fill(M_.begin() + static_cast<std::ptrdiff_t>(M_entry(i, i)),
              M_.begin() + static_cast<std::ptrdiff_t>(M_entry(i, last_[at(i)])) + 1, 0.0);
    for (int j = first_[at(i)]; j < i; ++j) M_[M_entry(j, i)] = 0;
    M_[M_entry(i, i)] = 1;
  }
}

/// M = U^T U in place, its diagonal inverted; structural zeros are skipped.
void ContactNewton::factor() {
  for (int k = 0; k < n_; ++k) {
    double* row = M_.data() + M_entry(k, 0);
    const int last = last_[at(k)];
    const double inverse = 1 / std::sqrt(row[k]);
    for (int j = k + 1; j <= last; ++j) row[j] *= inverse;
    row[k] = inverse;
    for (int i = k + 1; i <= last; ++i) {
      if (row[i] == 0) continue;
      Row(M_.data() + M_entry(i, i), last - i + 1) -= row[i] * ConstRow(row + i, last - i + 1);
    }
  }
}

void ContactNewton::solve_factored(double* x, int first, int end) const {
  for (int k = first; k <= end; ++k) {
    const double* row = M_.data() + M_entry(k, 0);
    x[k] *= row[k];
    if (x[k] == 0) continue;
    for (int j = k + 1; j <= last_[at(k)]; ++j) x[j] -= row[j] * x[k];
  }
  for (int k = end; k >= first; --k) {
    const double* row = M_.data() + M_entry(k, 0);
    const int count = last_[at(k)] - k;
    x[k] = (x[k] - ConstRow(row + k + 1, count).dot(ConstRow(x + k + 1, count))) * row[k];
  }
}

/// Corrects d_ = -M^-1 F to -(M - C G^T)^-1 F by the Sherman-Morrison-Woodbury formula. Elimination is by
/// hand: Eigen's sums round otherwise.
void ContactNewton::apply_coupling() {
  const std::size_t m = coupled_;
  if (m == 0) return;
  const auto width = static_cast<Eigen::Index>(m);
  // C = M^-1 C, all columns at once: C lies by rows.
  C_.resize(std::max(C_.size(), m * at(n_)));
  std::fill_n(C_.begin(), m * at(n_), 0.0);
  for (const Entry& each : coupling_) C_[at(each.dof) * m + each.column] = each.C;
  const auto row_of = [&](int i) { return Row(C_.data() + at(i) * m, width); };
  for (int k = 0; k < n_; ++k) {
    const double* row = M_.data() + M_entry(k, 0);
    row_of(k) *= row[k];
    for (int j = k + 1; j <= last_[at(k)]; ++j)
      if (row[j] != 0) row_of(j) -= row[j] * row_of(k);
  }
  for (int k = n_ - 1; k >= 0; --k) {
    const double* row = M_.data() + M_entry(k, 0);
    for (int j = k + 1; j <= last_[at(k)]; ++j)
      if (row[j] != 0) row_of(k) -= row[j] * row_of(j);
    row_of(k) *= row[k];
  }
  // K = 1 - G^T M^-1 C, and beside it G^T d.
  K_.assign(m * (m + 1), 0.0);
  const auto K = [&](std::size_t i, std::size_t j) -> double& { return K_[i * (m + 1) + j]; };
  for (std::size_t i = 0; i < m; ++i) K(i, i) = 1;
  for (const Entry& each : coupling_) {
    Row(&K(each.column, 0), width) -= each.G * row_of(each.dof);
    K(each.column, m) += each.G * d_[at(each.dof)];
  }
  for (std::size_t k = 0; k < m; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < m; ++i)
      if (std::abs(K(i, k)) > std::abs(K(pivot, k))) pivot = i;
    if (pivot != k)
      for (std::size_t j = k; j <= m; ++j) std::swap(K(k, j), K(pivot, j));
    const auto rest = static_cast<Eigen::Index>(m + 1 - k);
    for (std::size_t i = k + 1; i < m; ++i) Row(&K(i, k), rest) -= K(i, k) / K(k, k) * Row(&K(k, k), rest);
  }
  for (std::size_t k = m; k-- > 0;) {
    for (std::size_t j = k + 1; j < m; ++j) K(k, m) -= K(k, j) * K(j, m);
    K(k, m) /= K(k, k);
  }
  for (int i = 0; i < n_; ++i)
    for (std::size_t k = 0; k < m; ++k) d_[at(i)] += C_[at(i) * m + k] * K(k, m);
}

}  // namespace handsim::engine::articulated
