#include "handsim/engine/articulated/contact/sparse_factor.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "handsim/engine/articulated/contact/tuning.h"

namespace handsim::engine::articulated {

namespace {

/// The active set as numbers of 0 or more: of each contact, then of each unknown.
void list_active_set(const ContactProblem& p, std::vector<int>& out) {
  out.clear();
  for (const ContactRows& contact : p.contacts) {
    int code = contact.open ? 1 : 0;
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      const Disc& disc = contact.discs[k];
      code = 8 * code + 2 * static_cast<int>(disc.kind) + (disc.slides ? 1 : 0);
    }
    out.push_back(code);
  }
  for (int i = 0; i < p.size(); ++i)
    out.push_back(4 * (sign(p.limits[as_index(i)].side) + 1) + sign(p.limits[as_index(i)].saturated) + 1);
}

}  // namespace

void SparseFactor::reserve(const Unknowns& most) {
  const std::size_t n = as_index(most.size()), chains = most.chains.size();
  const std::size_t rows = std::min(n, as_index(kTuning.heap));
  M_.reserve(rows * (rows + 1) / 2);
  reserve_each(n, chains_, last_, row_start_, column_range_);
  runs_.reserve(std::min(chains * chains, as_index(kTuning.heap * kTuning.heap)));
  reserve_each(kUsualSliding * n, C_, G_);
  K_.reserve(kUsualSliding * kUsualSliding);
  reserve_each(kUsualContacts, pivots_, columns_, h_);
  layout_.reserve(n + kUsualContacts * (3 + most.widest()));
  active_.reserve(n + kUsualContacts);
}

void SparseFactor::update_pattern(const ContactProblem& p, Workspace& w) {
  w.layout.assign(p.unknowns->ids.begin(), p.unknowns->ids.end());
  for (const ContactRows& contact : p.contacts) {
    w.layout.push_back(static_cast<int>(contact.first_dof));
    w.layout.push_back(static_cast<int>(contact.dof_count));
    w.layout.push_back(static_cast<int>(contact.rows));
  }
  w.layout.insert(w.layout.end(), p.dofs.begin(), p.dofs.end());
  if (w.layout != layout_) {
    layout_.swap(w.layout);
    active_.clear();
    known_ = false;
  }
  if (!std::exchange(known_, true)) compute_pattern(p, w, p.contacts);
}

/// The pattern of the factor of A and of what contacts add.
void SparseFactor::compute_pattern(const ContactProblem& p, Workspace& w,
                                   std::span<const ContactRows> contacts) {
  const Unknowns& unknowns = *p.unknowns;
  const int n = p.size();
  const std::vector<std::size_t>& chain_of = unknowns.chain_of;
  chains_.clear();
  for (const Run& own : unknowns.chains) chains_.push_back({.own = own});
  const std::size_t count = chains_.size(), words = count / 64 + 1;
  w.links.assign(count * words, 0);
  const auto link = [&](std::size_t from, std::size_t to) {
    w.links[from * words + to / 64] |= std::uint64_t{1} << to % 64;
  };
  const auto above = [&](std::size_t chain) { return unknowns.parent[as_index(chains_[chain].own.end - 1)]; };
  for (std::size_t c = 0; c < count; ++c)
    for (int up = above(c); up < n; up = above(chain_of[as_index(up)])) link(c, chain_of[as_index(up)]);
  std::size_t last_run = p.runs.size();
  for (const ContactRows& contact : contacts) {
    // Contacts of one pair have the same unknowns.
    if (std::exchange(last_run, contact.first_run) == contact.first_run) continue;
    const std::size_t first = chain_of[as_index(p.runs_of(contact).front().first)];
    for (const Run& run : p.runs_of(contact))
      for (std::size_t c = chain_of[as_index(run.first)]; c < count && chains_[c].own.first < run.end; ++c)
        if (c > first) link(first, c);
  }
  runs_.clear();
  last_.resize(as_index(n));
  for (std::size_t c = 0; c < count; ++c) {
    Chain& chain = chains_[c];
    chain.first_run = runs_.size();
    chain.next = count;
    for (std::size_t word = c / 64; word < words; ++word)
      for (std::uint64_t bits = w.links[c * words + word]; bits != 0; bits &= bits - 1) {
        const std::size_t to = 64 * word + static_cast<std::size_t>(std::countr_zero(bits));
        const Run& own = chains_[to].own;
        // Fill-in: the first of the later chains has entries in all others.
        if (chain.next == count)
          chain.next = to;
        else
          link(chain.next, to);
        if (runs_.size() > chain.first_run && runs_.back().end == own.first)
          runs_.back().end = own.end;
        else
          runs_.push_back(own);
      }
    chain.run_count = runs_.size() - chain.first_run;
    const int last = (chain.run_count > 0 ? runs_.back().end : chain.own.end) - 1;
    for (int i = chain.own.first; i < chain.own.end; ++i) last_[as_index(i)] = last;
  }
  entries_ = place_rows(last_, row_start_);
}

double SparseFactor::work() const {
  double work = 0;
  int last = 0;
  for (int i = 0; i < static_cast<int>(last_.size()); ++i) {
    last = std::max(last, last_[as_index(i)]);
    work += 0.5 * (last - i) * (last - i);
  }
  return work;
}

/// Adds the symmetric part of a contact's -J^T (dp/dr) J.
void SparseFactor::add_stiffness(const ContactProblem& p, const Workspace& w, const ContactRows& contact) {
  const Triangle M = view().M;
  const double normal = contact.open ? 0 : 1 / contact.regularization;
  std::size_t k = 0;
  if (contact.disc_count > 0 && contact.discs[0].kind == Disc::Kind::sliding)
    w.kernel.add_stiffness(M, p.block(contact, 0, 3), normal, stiffness(contact.discs[k++]));
  else if (normal > 0)
    w.kernel.add_stiffness(M, p.block(contact, 0, 1), 0, {normal, 0, 0});
  for (; k < contact.disc_count; ++k) {
    const Disc& disc = contact.discs[k];
    w.kernel.add_stiffness(M, p.block(contact, disc.row, disc.size), 0, stiffness(disc));
  }
}

/// The columns of C and G: one for each disc that slides.
void SparseFactor::list_columns(const ContactProblem& p) {
  columns_.clear();
  column_range_.assign(chains_.size(), {});
  for (std::size_t c = 0; c < p.contacts.size(); ++c) {
    const ContactRows& contact = p.contacts[c];
    if (contact.open) continue;
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      if (!contact.discs[k].slides) continue;
      const int column = static_cast<int>(columns_.size());
      columns_.push_back({c, k});
      for (std::size_t chain = p.unknowns->chain_of[as_index(p.dofs[contact.first_dof])];
           chain < chains_.size(); chain = chains_[chain].next) {
        Run& range = column_range_[chain];
        if (range.size() == 0) range.first = column;
        range.end = column + 1;
      }
    }
  }
  h_.resize(columns_.size());
}

void SparseFactor::add_coupling(const ContactProblem& p) {
  list_columns(p);
  const std::size_t m = columns_.size(), n = as_index(p.size());
  C_.resize(n * m);
  G_.resize(n * m);
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    const Run own = chains_[c].own, range = column_range_[c];
    for (int k = own.first; k < own.end && range.size() > 0; ++k)
      for (std::vector<double>* each : {&C_, &G_})
        std::fill_n(each->data() + as_index(k) * m + as_index(range.first), range.size(), 0.0);
  }
  for (std::size_t column = 0; column < m; ++column) {
    const ContactRows& contact = p.contacts[columns_[column].contact];
    const Disc& disc = contact.discs[columns_[column].disc];
    const std::span<const int> dofs = p.dofs_of(contact);
    const double *J = p.entries_of(contact), *rows = J + disc.row * dofs.size();
    const double share = disc.coefficient / contact.regularization;
    for (std::size_t j = 0; j < dofs.size(); ++j) {
      const std::size_t dof = as_index(dofs[j]);
      if (p.limits[dof].side != LimitSide::within) continue;
      C_[dof * m + column] =
          share * (disc.force_x * rows[j] + (disc.size > 1 ? disc.force_y * rows[dofs.size() + j] : 0));
      G_[dof * m + column] = J[j];
    }
  }
}

void SparseFactor::assemble(ContactProblem& p, Workspace& w) {
  p.compute_jacobians(w.kernel);
  M_.resize(entries_);
  const Unknowns& unknowns = *p.unknowns;
  const bool fixed = w.law == Law::fixed_limits;
  for (int i = 0; i < p.size(); ++i) {
    const int own_last = unknowns.last[as_index(i)];
    double* M = &entry(i, 0);
    const double* A = p.A.data() + unknowns.row_start[as_index(i)];
    std::copy(A + i, A + own_last + 1, M + i);
    std::fill(M + own_last + 1, M + std::max(own_last, last_[as_index(i)]) + 1, 0.0);
    const Limits& servo = p.limits[as_index(i)];
    if (servo.limit > 0 && servo.saturated == LimitSide::within) M[i] += servo.slope;
    if (fixed && p.limits[as_index(i)].side != LimitSide::within) M[i] += 1 / stop_compliance(p, i);
  }
  for (const ContactRows& contact : p.contacts)
    if (!contact.open || fixed) add_stiffness(p, w, contact);
  columns_.clear();
  if (fixed) return;
  add_coupling(p);
  for (int i = 0; i < p.size(); ++i) {
    if (p.limits[as_index(i)].side == LimitSide::within) continue;
    std::fill(&entry(i, i), &entry(i, last_[as_index(i)]) + 1, 0.0);
    for (int j = 0; j < i; ++j)
      if (last_[as_index(j)] >= i) entry(j, i) = 0;
    entry(i, i) = 1;
  }
}

void SparseFactor::factor(ContactProblem& p, Workspace& w) {
  assemble(p, w);
  w.kernel.factor(view());
  const std::size_t m = columns_.size();
  K_.resize(m * m);
  h_.resize(m);
  pivots_.resize(m);
  if (m > 0) {
    w.kernel.eliminate_coupling(view(), coupling());
    w.kernel.factor_coupling(view(), coupling());
  }
  active_.clear();
  if (w.law != Law::fixed_limits) list_active_set(p, active_);
}

void SparseFactor::factor_inertia(const ContactProblem& p, Workspace& w) {
  compute_pattern(p, w, {});
  known_ = false;
  active_.clear();
  columns_.clear();
  M_ = p.A;
  w.kernel.factor(view());
}

void SparseFactor::solve(const Workspace& w, double* x) {
  w.kernel.eliminate(view(), x, 0, chains_.size());
  if (!columns_.empty()) w.kernel.apply_coupling(view(), coupling(), x);
  w.kernel.substitute_back(view(), x, 0, chains_.size());
}

void SparseFactor::solve_tree(const Workspace& w, double* x, const Unknowns& unknowns, const Run& tree) {
  const std::size_t first = unknowns.chain_of[as_index(tree.first)],
                    end = unknowns.chain_of[as_index(tree.end - 1)] + 1;
  w.kernel.eliminate(view(), x, first, end);
  w.kernel.substitute_back(view(), x, first, end);
}

bool SparseFactor::begin_trial(const ContactProblem& p, Workspace& w) {
  if (active_.empty()) return false;
  list_active_set(p, w.active);
  if (w.active != active_) return false;
  list_columns(p);
  // A restored one may be of any size.
  const std::size_t m = columns_.size();
  if (M_.size() != entries_ || C_.size() != as_index(p.size()) * m || G_.size() != C_.size() ||
      K_.size() != m * m || pivots_.size() != m ||
      std::ranges::any_of(pivots_, [&](std::size_t each) { return each >= m; }))
    return false;
  if (problems_to_pass_ == 0) return true;
  --problems_to_pass_;
  return false;
}

void SparseFactor::end_trial(bool solved) {
  if (!solved) problems_to_pass_ = (1 << failures_) - 1;
  failures_ = solved ? 0 : std::min(failures_ + 1, kTuning.most_failures);
}

void SparseFactor::forget() {
  active_.clear();
  failures_ = problems_to_pass_ = 0;
}

void SparseFactor::save(ArchiveWriter& out) const {
  out(failures_, problems_to_pass_, active_);
  if (active_.empty()) return;
  out(layout_);
  for (const std::vector<double>* each : {&M_, &C_, &G_, &K_}) out(*each);
  out(pivots_);
}

void SparseFactor::restore(ArchiveReader& in) {
  failures_ = static_cast<int>(in.count(kTuning.most_failures));
  problems_to_pass_ = static_cast<int>(in.count(1 << kTuning.most_failures));
  in(active_);
  if (active_.empty()) return;
  known_ = false;
  in(layout_);
  for (std::vector<double>* each : {&M_, &C_, &G_, &K_}) in(*each);
  in(pivots_);
}

}  // namespace handsim::engine::articulated
