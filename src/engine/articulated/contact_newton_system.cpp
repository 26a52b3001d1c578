// The linear system of a Newton step: assembly, sparse Cholesky factor, and the low-rank unsymmetric part of
// sliding contacts. The pattern is kept by chains of unknowns: fingers that hold an object couple with each
// other through it alone.
#include <algorithm>
#include <cmath>
#include <utility>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/contact_newton.h"
#include "handsim/engine/articulated/row_operations.h"

namespace handsim::engine::articulated {

/// Multiplications of a factorisation that knows of no gaps in a row.
double ContactNewton::factor_work() const {
  double work = 0;
  int last = 0;
  for (int i = 0; i < n_; ++i) {
    last = std::max(last, last_[at(i)]);
    work += 0.5 * (last - i) * (last - i);
  }
  return work;
}

/// Adds a contact's -J^T (dp/dr) J, where it is symmetric.
void ContactNewton::add_stiffness(const ContactRows& contact) {
  const std::size_t m = contact.dof_count;
  const double* J = J_.data() + contact.first_entry;
  const double normal = contact.open ? 0 : 1 / contact.regularization;
  const std::span<const Run> all = runs(contact);
  // Of each of the contact's unknowns: what the upper triangle of M has in its row, run by run.
  const auto each_row = [&](auto&& add) {
    std::size_t own = 0;
    for (std::size_t r = 0; r < all.size(); ++r)
      for (int i = all[r].first; i < all[r].end; ++i, ++own) {
        double* to = M_.data() + M_entry(i, 0);
        add(own, to + i, own, all[r].end - i);
        std::size_t from = own + at(all[r].end - i);
        for (const Run& run : all.subspan(r + 1)) {
          add(own, to + run.first, from, run.size());
          from += at(run.size());
        }
      }
  };
  std::size_t k = 0;
  if (contact.disc_count > 0 && contact.discs[0].kind == Disc::Kind::sliding) {
    const std::array<double, 3> D = stiffness(contact.discs[k++]);
    const double *x = J + m, *y = J + 2 * m;
    each_row([&](std::size_t own, double* to, std::size_t from, int count) {
      const double s[3] = {-normal * J[own], -D[0] * x[own] - D[1] * y[own], -D[1] * x[own] - D[2] * y[own]};
      subtract(to, J + from, x + from, y + from, s, count);
    });
  } else if (normal > 0) {
    each_row([&](std::size_t own, double* to, std::size_t from, int count) {
      subtract(to, J + from, -normal * J[own], count);
    });
  }
  for (; k < contact.disc_count; ++k) {
    const Disc& disc = contact.discs[k];
    const std::array<double, 3> D = stiffness(disc);
    const double *x = J + disc.row * m, *y = x + m;
    each_row([&](std::size_t own, double* to, std::size_t from, int count) {
      if (disc.size == 1) return subtract(to, x + from, -D[0] * x[own], count);
      subtract(to, x + from, -D[0] * x[own] - D[1] * y[own], count);
      subtract(to, y + from, -D[1] * x[own] - D[2] * y[own], count);
    });
  }
}

/// The columns of C and G: one for each disc that slides.
void ContactNewton::add_coupling() {
  columns_.clear();
  column_range_.assign(chains_.size(), {});
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    const ContactRows& contact = contacts_[c];
    if (contact.open || contact.dof_count == 0) continue;
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      if (!contact.discs[k].slides) continue;
      const int column = static_cast<int>(columns_.size());
      columns_.push_back({c, k});
      for (std::size_t chain = chain_of_[at(dofs_[contact.first_dof])]; chain < chains_.size();
           chain = chains_[chain].next) {
        Run& range = column_range_[chain];
        if (range.size() == 0) range.first = column;
        range.end = column + 1;
      }
    }
  }
  C_.assign(at(n_) * columns_.size(), 0.0);
  G_.assign(at(n_) * columns_.size(), 0.0);
  for (std::size_t column = 0; column < columns_.size(); ++column) add_column(column);
}

void ContactNewton::add_column(std::size_t column) {
  const ContactRows& contact = contacts_[columns_[column].contact];
  const Disc& disc = contact.discs[columns_[column].disc];
  const std::size_t m = contact.dof_count;
  const double *J = J_.data() + contact.first_entry, *rows = J + disc.row * m;
  const double share = disc.coefficient / contact.regularization;
  for (std::size_t j = 0; j < m; ++j) {
    const std::size_t dof = at(dofs_[contact.first_dof + j]);
    if (bounds_[dof].side != 0) continue;
    const std::size_t place = dof * columns_.size() + column;
    C_[place] = share * (disc.force_x * rows[j] + (disc.size > 1 ? disc.force_y * rows[m + j] : 0));
    G_[place] = J[j];
  }
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
  for (const ContactRows& contact : contacts_)
    if (!contact.open || law_ == Law::fixed_limits) add_stiffness(contact);
  columns_.clear();
  if (law_ == Law::fixed_limits) return;
  add_coupling();
  for (int i = 0; i < n_; ++i) {
    if (bounds_[at(i)].side == 0) continue;
    std::fill(M_.begin() + static_cast<std::ptrdiff_t>(M_entry(i, i)),
              M_.begin() + static_cast<std::ptrdiff_t>(M_entry(i, last_[at(i)])) + 1, 0.0);
    for (int j = 0; j < i; ++j)
      if (last_[at(j)] >= i) M_[M_entry(j, i)] = 0;
    M_[M_entry(i, i)] = 1;
  }
}

/// M = U^T U in place, its diagonal inverted.
void ContactNewton::factor() {
  for (const Chain& chain : chains_)
    for (int k = chain.own.first; k < chain.own.end; ++k) {
      double* row = M_.data() + M_entry(k, 0);
      const double inverse = 1 / std::sqrt(row[k]);
      row[k] = inverse;
      for (int j = k + 1; j < chain.own.end; ++j) row[j] *= inverse;
      for (const Run& run : runs(chain))
        for (int j = run.first; j < run.end; ++j) row[j] *= inverse;
      for (int i = k + 1; i < chain.own.end; ++i) {
        double* to = M_.data() + M_entry(i, 0);
        subtract(to + i, row + i, row[i], chain.own.end - i);
        for (const Run& run : runs(chain)) subtract(to + run.first, row + run.first, row[i], run.size());
      }
      const std::span<const Run> later = runs(chain);
      for (std::size_t r = 0; r < later.size(); ++r)
        for (int i = later[r].first; i < later[r].end; ++i) {
          double* to = M_.data() + M_entry(i, 0);
          subtract(to + i, row + i, row[i], later[r].end - i);
          for (const Run& run : later.subspan(r + 1))
            subtract(to + run.first, row + run.first, row[i], run.size());
        }
    }
}

void ContactNewton::eliminate(double* x, std::size_t first_chain, std::size_t end) const {
  for (std::size_t c = first_chain; c < end; ++c) {
    const Chain& chain = chains_[c];
    for (int k = chain.own.first; k < chain.own.end; ++k) {
      const double* row = M_.data() + M_entry(k, 0);
      x[k] *= row[k];
      if (x[k] == 0) continue;
      subtract(x + k + 1, row + k + 1, x[k], chain.own.end - k - 1);
      for (const Run& run : runs(chain)) subtract(x + run.first, row + run.first, x[k], run.size());
    }
  }
}

void ContactNewton::substitute_back(double* x, std::size_t first_chain, std::size_t end) const {
  for (std::size_t c = end; c-- > first_chain;) {
    const Chain& chain = chains_[c];
    for (int k = chain.own.end - 1; k >= chain.own.first; --k) {
      const double* row = M_.data() + M_entry(k, 0);
      double sum = dot(row + k + 1, x + k + 1, chain.own.end - k - 1);
      for (const Run& run : runs(chain)) sum += dot(row + run.first, x + run.first, run.size());
      x[k] = (x[k] - sum) * row[k];
    }
  }
}

/// C = U^-T C and G = U^-T G.
void ContactNewton::eliminate_coupling() {
  const std::size_t m = columns_.size();
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    const Run range = column_range_[c];
    if (range.size() == 0) continue;
    for (int k = chains_[c].own.first; k < chains_[c].own.end; ++k) {
      const double* row = M_.data() + M_entry(k, 0);
      double *C = C_.data() + at(k) * m, *G = G_.data() + at(k) * m;
      for (int i = range.first; i < range.end; ++i) {
        C[i] *= row[k];
        G[i] *= row[k];
      }
      const auto subtract_run = [&](int first, int end) {
        for (int j = first; j < end; ++j) {
          const std::size_t to = at(j) * m + at(range.first);
          subtract(C_.data() + to, C + range.first, row[j], range.size());
          subtract(G_.data() + to, G + range.first, row[j], range.size());
        }
      };
      subtract_run(k + 1, chains_[c].own.end);
      for (const Run& run : runs(chains_[c])) subtract_run(run.first, run.end);
    }
  }
}

/// K = 1 - G^T M^-1 C, and beside it G^T M^-1 F.
void ContactNewton::find_coupling_system() {
  const std::size_t m = columns_.size();
  K_.assign(m * (m + 1), 0.0);
  for (std::size_t i = 0; i < m; ++i) K_[i * (m + 1) + i] = 1;
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    const Run range = column_range_[c];
    if (range.size() == 0) continue;
    for (int k = chains_[c].own.first; k < chains_[c].own.end; ++k) {
      const double *C = C_.data() + at(k) * m, *G = G_.data() + at(k) * m, d = d_[at(k)];
      for (int i = range.first; i < range.end; ++i) {
        double* K = K_.data() + at(i) * (m + 1);
        subtract(K + range.first, C + range.first, G[i], range.size());
        K[m] += G[i] * d;
      }
    }
  }
}

/// Gaussian elimination with row exchanges, by hand: Eigen's sums round otherwise.
void ContactNewton::solve_coupling_system() {
  const std::size_t m = columns_.size();
  const auto K = [&](std::size_t i, std::size_t j) -> double& { return K_[i * (m + 1) + j]; };
  for (std::size_t k = 0; k < m; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < m; ++i)
      if (std::abs(K(i, k)) > std::abs(K(pivot, k))) pivot = i;
    if (pivot != k)
      for (std::size_t j = k; j <= m; ++j) std::swap(K(k, j), K(pivot, j));
    const double inverse = 1 / K(k, k);
    for (std::size_t i = k + 1; i < m; ++i)
      subtract(&K(i, k), &K(k, k), K(i, k) * inverse, static_cast<int>(m + 1 - k));
  }
  for (std::size_t k = m; k-- > 0;) {
    for (std::size_t j = k + 1; j < m; ++j) K(k, m) -= K(k, j) * K(j, m);
    K(k, m) /= K(k, k);
  }
}

/// Where d_ = -U^-T F: corrects the step to -(M - C G^T)^-1 F by the Sherman-Morrison-Woodbury formula.
void ContactNewton::apply_coupling() {
  const std::size_t m = columns_.size();
  if (m == 0) return;
  eliminate_coupling();
  find_coupling_system();
  solve_coupling_system();
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    const Run range = column_range_[c];
    for (int k = chains_[c].own.first; k < chains_[c].own.end; ++k)
      for (int i = range.first; i < range.end; ++i)
        d_[at(k)] += C_[at(k) * m + at(i)] * K_[at(i) * (m + 1) + m];
  }
}

}  // namespace handsim::engine::articulated
