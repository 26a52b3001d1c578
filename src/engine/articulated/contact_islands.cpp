// Islands: trees of joints that contacts and loops couple are solved one island at a time, so that a hard
// one does not slow down the others.
#include <algorithm>
#include <utility>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/contact_newton.h"

namespace handsim::engine::articulated {

/// Numbers the islands in the order of their first unknowns.
void ContactNewton::find_islands() {
  // Union-find by the first unknown of each tree.
  island_of_ = tree_first_;
  const auto root = [&](int i) {
    while (island_of_[at(i)] != i) i = island_of_[at(i)] = island_of_[at(island_of_[at(i)])];
    return i;
  };
  for (const ContactRows& contact : contacts_)
    for (const Run& run : runs(contact)) {
      const int a = root(dofs_[contact.first_dof]), b = root(run.first);
      island_of_[at(std::max(a, b))] = std::min(a, b);
    }
  islands_ = 0;
  place_.resize(at(n_));
  first_member_.clear();
  for (int i = 0; i < n_; ++i) {
    // The root of an unknown comes before it and has its island's number already, as -1, -2, ...
    int& island = island_of_[at(i)];
    if (island == i) {
      island = -1 - islands_++;
      first_member_.push_back(0);
    } else {
      island = island_of_[at(island)];
    }
    place_[at(i)] = first_member_[at(-1 - island)]++;
  }
  for (int& island : island_of_) island = -1 - island;
  first_touching_.assign(at(islands_), 0);
  for (const ContactRows& contact : contacts_) ++first_touching_[at(island_of(contact))];
  const auto begins = [](std::vector<int>& counts) {
    int sum = 0;
    for (int& count : counts) sum += std::exchange(count, sum);
    counts.push_back(sum);
  };
  begins(first_member_);
  begins(first_touching_);
  members_.resize(at(n_));
  for (int i = 0; i < n_; ++i) members_[at(first_member_[at(island_of_[at(i)])] + place_[at(i)])] = i;
  touching_.resize(contacts_.size());
  next_.assign(first_touching_.begin(), first_touching_.end());
  for (std::size_t c = 0; c < contacts_.size(); ++c)
    touching_[at(next_[at(island_of(contacts_[c]))]++)] = static_cast<int>(c);
}

/// Sizes everything for an island, where it is not the last one.
void ContactNewton::lay_out_island(const ContactNewton& whole, std::span<const int> members) {
  if (std::equal(members.begin(), members.end(), loaded_.begin(), loaded_.end())) return;
  loaded_.assign(members.begin(), members.end());
  part_first_.clear();
  for (const int i : members) part_first_.push_back(whole.place_[at(whole.A_first_[at(i)])]);
  lay_out(part_first_);
}

void ContactNewton::load_island(const ContactNewton& whole, int island) {
  const std::span<const int> members = whole.members(island);
  lay_out_island(whole, members);
  contacts_.clear();
  dofs_.clear();
  dof_runs_.clear();
  J_.clear();
  for (const int i : members) {
    const int to = whole.place_[at(i)];
    std::copy_n(whole.A_.begin() + static_cast<std::ptrdiff_t>(whole.entry(i, i)), A_last_[at(to)] - to + 1,
                A_.begin() + static_cast<std::ptrdiff_t>(entry(to, to)));
    g_[at(to)] = whole.g_[at(i)];
    bounds_[at(to)] = whole.bounds_[at(i)];
    servos_[at(to)] = whole.servos_[at(i)];
  }
  std::size_t last_run = 0;
  for (const int c : whole.touching(island)) {
    const ContactRows& contact = whole.contacts_[at(c)];
    const bool shared = std::exchange(last_run, contact.first_run) == contact.first_run && !contacts_.empty();
    ContactRows& to = contacts_.emplace_back(contact);
    to.first_dof = shared ? contacts_[contacts_.size() - 2].first_dof : dofs_.size();
    to.first_run = shared ? contacts_[contacts_.size() - 2].first_run : dof_runs_.size();
    to.first_entry = J_.size();
    if (!shared) {
      for (std::size_t k = 0; k < contact.dof_count; ++k)
        dofs_.push_back(whole.place_[at(whole.dofs_[contact.first_dof + k])]);
      for (const Run& run : whole.runs(contact)) {
        const int first = whole.place_[at(run.first)];
        dof_runs_.push_back({first, first + run.size()});
      }
    }
    const auto entries = whole.J_.begin() + static_cast<std::ptrdiff_t>(contact.first_entry);
    J_.insert(J_.end(), entries, entries + static_cast<std::ptrdiff_t>(contact.rows * contact.dof_count));
  }
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
                      first_entry = contact.first_entry;
    contact = *from++;
    contact.first_dof = first_dof;
    contact.first_run = first_run;
    contact.first_entry = first_entry;
  }
}

NewtonReport ContactNewton::solve(double tolerance) {
  find_islands();
  if (islands_ == 1 && !left_out_[0]) return solve_island(tolerance);
  NewtonReport report;
  report.solved = true;
  for (int island = 0; island < islands_; ++island) {
    if (left_out_[at(members(island).front())]) continue;
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
