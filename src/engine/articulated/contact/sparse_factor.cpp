// The linear system of a Newton step: assembly, sparse Cholesky factor, and the low-rank unsymmetric part of
// sliding contacts. The pattern is kept by chains of unknowns: fingers that hold an object couple with each
// other through it alone.
#include <algorithm>
#include <cmath>
#include <utility>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/contact/solver.h"

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
  const Triangle M = factor().M;
  const double normal = contact.open ? 0 : 1 / contact.regularization;
  std::size_t k = 0;
  if (contact.disc_count > 0 && contact.discs[0].kind == Disc::Kind::sliding)
    kernel_.add_stiffness(M, rows(contact, 0, 3), normal, stiffness(contact.discs[k++]));
  else if (normal > 0)
    kernel_.add_stiffness(M, rows(contact, 0, 1), 0, {normal, 0, 0});
  for (; k < contact.disc_count; ++k) {
    const Disc& disc = contact.discs[k];
    kernel_.add_stiffness(M, rows(contact, disc.row, disc.size), 0, stiffness(disc));
  }
}

/// The columns of C and G: one for each disc that slides.
void ContactNewton::list_columns() {
  columns_.clear();
  column_range_.assign(chains_.size(), {});
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    const ContactRows& contact = contacts_[c];
    if (contact.open) continue;
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
}

void ContactNewton::size_columns() {
  const std::size_t m = columns_.size();
  K_.resize(m * m);
  h_.resize(m);
  pivots_.resize(m);
}

void ContactNewton::add_coupling() {
  list_columns();
  const std::size_t m = columns_.size();
  C_.resize(at(n_) * m);
  G_.resize(at(n_) * m);
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    const Run own = chains_[c].own, range = column_range_[c];
    for (int k = own.first; k < own.end && range.size() > 0; ++k)
      for (std::vector<double>* each : {&C_, &G_})
        std::fill_n(each->data() + at(k) * m + at(range.first), range.size(), 0.0);
  }
  for (std::size_t column = 0; column < columns_.size(); ++column) add_column(column);
}

void ContactNewton::add_column(std::size_t column) {
  const ContactRows& contact = contacts_[columns_[column].contact];
  const Disc& disc = contact.discs[columns_[column].disc];
  const std::size_t m = contact.dof_count;
  const double *J = entries(contact), *rows = J + disc.row * m;
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
  find_jacobians();
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

/// As numbers of 0 or more: of each contact, then of each unknown.
void ContactNewton::find_active_set() {
  active_.clear();
  for (const ContactRows& contact : contacts_) {
    int code = contact.open ? 1 : 0;
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      const Disc& disc = contact.discs[k];
      code = 8 * code + 2 * static_cast<int>(disc.kind) + (disc.slides ? 1 : 0);
    }
    active_.push_back(code);
  }
  for (int i = 0; i < n_; ++i)
    active_.push_back(static_cast<int>(4 * (bounds_[at(i)].side + 1) + servos_[at(i)].saturated + 1));
}

/// Whether the factor is of the same unknowns, contacts and active set.
bool ContactNewton::factor_fits() {
  if (factored_.empty()) return false;
  find_active_set();
  if (active_ != factored_) return false;
  list_columns();
  // A restored one may be of any size.
  const std::size_t m = columns_.size();
  h_.resize(m);
  return C_.size() == at(n_) * m && G_.size() == C_.size() && K_.size() == m * m && pivots_.size() == m &&
         std::all_of(pivots_.begin(), pivots_.end(), [&](std::size_t each) { return each < m; });
}

void ContactNewton::forget_factor() {
  factored_.clear();
  failures_ = problems_to_pass_ = 0;
  if (part_) part_->forget_factor();
}

void ContactNewton::save(ArchiveWriter& out) const {
  out(failures_);
  out(problems_to_pass_);
  out(factored_);
  if (!factored_.empty()) {
    out(laid_out_);
    for (const std::vector<double>* each : {&M_, &C_, &G_, &K_}) out(*each);
    out(pivots_);
  }
  if (part_) part_->save(out);
}

void ContactNewton::restore(ArchiveReader& in) {
  failures_ = static_cast<int>(in.count(kMostFailures));
  problems_to_pass_ = static_cast<int>(in.count(1 << kMostFailures));
  in(factored_);
  if (!factored_.empty()) {
    structured_ = false;
    in(laid_out_);
    for (std::vector<double>* each : {&M_, &C_, &G_, &K_}) in(*each);
    in(pivots_);
  }
  if (part_) part_->restore(in);
}

}  // namespace handsim::engine::articulated
