// Islands: trees of joints that contacts and loops couple are solved one island at a time, so that a hard
// one does not slow down the others.
#include <algorithm>
#include <numeric>
#include <utility>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/contact/solver.h"

namespace handsim::engine::articulated {

/// Numbers the islands in the order of their first unknowns.
void ContactNewton::find_islands() {
  // Union-find of trees.
  island_of_tree_.resize(trees_.size());
  std::iota(island_of_tree_.begin(), island_of_tree_.end(), 0);
  const auto root = [&](int tree) {
    while (island_of_tree_[at(tree)] != tree) tree = island_of_tree_[at(tree)];
    return tree;
  };
  std::size_t last_run = dof_runs_.size();
  for (const ContactRows& contact : contacts_) {
    // Contacts of one pair have the same unknowns.
    if (std::exchange(last_run, contact.first_run) == contact.first_run) continue;
    for (std::size_t r = 1; r < contact.run_count; ++r) {
      const int a = root(tree_of_[at(runs(contact)[0].first)]),
                b = root(tree_of_[at(runs(contact)[r].first)]);
      island_of_tree_[at(std::max(a, b))] = std::min(a, b);
    }
  }
  islands_ = 0;
  for (std::size_t tree = 0; tree < trees_.size(); ++tree) {
    // A root has a lower number than all others, and so its island's number already.
    int& island = island_of_tree_[tree];
    island = island == static_cast<int>(tree) ? islands_++ : island_of_tree_[at(island)];
  }
}

/// Unknowns and contacts of each island.
void ContactNewton::list_islands() {
  const auto begins = [](std::vector<int>& counts) {
    int sum = 0;
    for (int& count : counts) sum += std::exchange(count, sum);
    counts.push_back(sum);
  };
  first_member_.assign(at(islands_), 0);
  place_.resize(at(n_));
  for (int i = 0; i < n_; ++i) place_[at(i)] = first_member_[at(island_of_tree_[at(tree_of_[at(i)])])]++;
  begins(first_member_);
  members_.resize(at(n_));
  for (int i = 0; i < n_; ++i)
    members_[at(first_member_[at(island_of_tree_[at(tree_of_[at(i)])])] + place_[at(i)])] = i;
  first_touching_.assign(at(islands_), 0);
  for (const ContactRows& contact : contacts_) ++first_touching_[at(island_of(contact))];
  begins(first_touching_);
  touching_.resize(contacts_.size());
  next_.assign(first_touching_.begin(), first_touching_.end());
  for (std::size_t c = 0; c < contacts_.size(); ++c)
    touching_[at(next_[at(island_of(contacts_[c]))]++)] = static_cast<int>(c);
}

void ContactNewton::load_island(const ContactNewton& whole, int island) {
  const std::span<const int> members = whole.members(island);
  lay_out_some(members, &whole);
  clear();
  for (const int i : members) {
    const int to = whole.place_[at(i)];
    std::copy_n(whole.A_.begin() + static_cast<std::ptrdiff_t>(whole.entry(i, i)), A_last_[at(to)] - to + 1,
                A_.begin() + static_cast<std::ptrdiff_t>(entry(to, to)));
    g_[at(to)] = whole.g_[at(i)];
    start_[at(to)] = whole.start_[at(i)];
    bounds_[at(to)] = whole.bounds_[at(i)];
    servos_[at(to)] = whole.servos_[at(i)];
    std::copy_n(whole.motions_.begin() + static_cast<std::ptrdiff_t>(kSpatial * at(i)), kSpatial, motion(to));
  }
  const ContactRows* last = nullptr;
  for (const int c : whole.touching(island)) {
    const ContactRows& contact = whole.contacts_[at(c)];
    const bool shared = last && last->first_run == contact.first_run;
    const ContactRows* before = contacts_.empty() ? nullptr : &contacts_.back();
    ContactRows to = contact;
    to.first_dof = shared ? before->first_dof : dofs_.size();
    to.first_run = shared ? before->first_run : dof_runs_.size();
    to.first_entry = contact.pair == kNone ? own_entries_ : entries_;
    if (!shared) load_dofs(whole, contact);
    if (contact.pair != kNone) {
      if (!last || last->pair != contact.pair) load_pair(whole, contact.pair);
      to.pair = static_cast<int>(pairs_.size()) - 1;
      to.first_wrench = wrenches_.size() / kSpatial;
      const auto wrenches =
          whole.wrenches_.begin() + static_cast<std::ptrdiff_t>(kSpatial * contact.first_wrench);
      wrenches_.insert(wrenches_.end(), wrenches,
                       wrenches + static_cast<std::ptrdiff_t>(kSpatial * contact.rows));
    }
    const std::size_t count = contact.rows * contact.dof_count;
    (contact.pair == kNone ? own_entries_ : entries_) += count;
    if (contact.pair == kNone) {
      if (J_.size() < own_entries_) J_.resize(own_entries_);
      std::copy_n(whole.J_.begin() + static_cast<std::ptrdiff_t>(contact.first_entry), count,
                  J_.begin() + static_cast<std::ptrdiff_t>(to.first_entry));
    }
    contacts_.push_back(to);
    last = &contact;
  }
}

void ContactNewton::load_dofs(const ContactNewton& whole, const ContactRows& contact) {
  for (std::size_t k = 0; k < contact.dof_count; ++k)
    dofs_.push_back(whole.place_[at(whole.dofs_[contact.first_dof + k])]);
  for (const Run& run : whole.runs(contact)) {
    const int first = whole.place_[at(run.first)];
    dof_runs_.push_back({first, first + run.size()});
  }
}

void ContactNewton::load_pair(const ContactNewton& whole, int pair) {
  Pair& to = pairs_.emplace_back(whole.pairs_[at(pair)]);
  for (int* body : {&to.a, &to.b})
    if (*body != kNone) *body = whole.place_[at(*body)];
}

void ContactNewton::store_island(ContactNewton& whole, int island) const {
  for (const int i : whole.members(island)) {
    const std::size_t from = at(whole.place_[at(i)]);
    whole.x_[at(i)] = x_[from];
    whole.bounds_[at(i)].side = bounds_[from].side;
    whole.servos_[at(i)].saturated = servos_[from].saturated;
  }
  auto from = contacts_.begin();
  for (const int c : whole.touching(island)) {
    ContactRows& contact = whole.contacts_[at(c)];
    const std::size_t first_dof = contact.first_dof, first_run = contact.first_run,
                      first_entry = contact.first_entry, first_wrench = contact.first_wrench;
    const int pair = contact.pair;
    contact = *from++;
    contact.pair = pair;
    contact.first_wrench = first_wrench;
    contact.first_dof = first_dof;
    contact.first_run = first_run;
    contact.first_entry = first_entry;
  }
}

NewtonReport ContactNewton::solve(double tolerance) {
  find_islands();
  if (islands_ == 1) return solve_island(tolerance);
  NewtonReport report;
  report.solved = true;
  if (islands_ == 0) return report;
  list_islands();
  const Stay stay(*part_, scratch().part);
  for (int island = 0; island < islands_; ++island) {
    part_->load_island(*this, island);
    const NewtonReport part = part_->solve_island(tolerance);
    part_->store_island(*this, island);
    report.iterations += part.iterations;
    report.limit_updates += part.limit_updates;
    report.residual = std::max(report.residual, part.residual);
    report.solved = report.solved && part.solved;
    report.iterative = report.iterative || part.iterative;
  }
  return report;
}

}  // namespace handsim::engine::articulated
