// Islands: coupled trees are solved one island at a time, so that a hard one does not slow down the others.
#include <algorithm>
#include <numeric>
#include <utility>

#include "handsim/engine/articulated/contact/fixed_limits.h"
#include "handsim/engine/articulated/contact/gauss_seidel.h"
#include "handsim/engine/articulated/contact/islands.h"
#include "handsim/engine/articulated/contact/tuning.h"

namespace handsim::engine::articulated {

namespace {

std::size_t island_of(const ContactProblem& p, const Workspace& w, int unknown) {
  return as_index(w.island_of_tree[as_index(p.unknowns->tree_of[as_index(unknown)])]);
}

std::size_t island_of(const ContactProblem& p, const Workspace& w, const ContactRows& contact) {
  return island_of(p, w, p.dofs[contact.first_dof]);
}

/// Numbers the islands in the order of their first unknowns. @returns how many there are
int find_islands(const ContactProblem& p, Workspace& w) {
  // Union-find of trees.
  std::vector<int>& island = w.island_of_tree;
  const std::vector<int>& tree_of = p.unknowns->tree_of;
  island.resize(p.unknowns->trees.size());
  std::iota(island.begin(), island.end(), 0);
  const auto root = [&](int tree) {
    while (island[as_index(tree)] != tree) tree = island[as_index(tree)];
    return tree;
  };
  std::size_t last_run = p.runs.size();
  for (const ContactRows& contact : p.contacts) {
    // Contacts of one pair have the same unknowns.
    if (std::exchange(last_run, contact.first_run) == contact.first_run) continue;
    const std::span<const Run> runs = p.runs_of(contact);
    for (const Run& run : runs) {
      const int a = root(tree_of[as_index(runs[0].first)]), b = root(tree_of[as_index(run.first)]);
      island[as_index(std::max(a, b))] = std::min(a, b);
    }
  }
  int count = 0;
  // A tree points to a lower one, which has its island's number already.
  for (int tree = 0; tree < static_cast<int>(island.size()); ++tree)
    island[as_index(tree)] =
        island[as_index(tree)] == tree ? count++ : island[as_index(island[as_index(tree)])];
  return count;
}

/// Sorts items 0 to count - 1 by their islands. @param first where each island begins
template <class IslandOf>
void sort(int count, int islands, std::vector<int>& items, std::vector<int>& first, std::vector<int>& next,
          const IslandOf& island_of_item) {
  first.assign(as_index(islands) + 1, 0);
  for (int i = 0; i < count; ++i) ++first[island_of_item(i) + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());
  next = first;
  items.resize(as_index(count));
  for (int i = 0; i < count; ++i) items[as_index(next[island_of_item(i)]++)] = i;
}

std::span<const int> part(const std::vector<int>& items, const std::vector<int>& first, int island) {
  return {items.data() + first[as_index(island)], items.data() + first[as_index(island) + 1]};
}

void load_dofs(const ContactProblem& whole, const Workspace& w, const Dofs& from, Dofs& to,
               ContactProblem& island) {
  to = {island.dofs.size(), from.dof_count, island.runs.size(), from.run_count};
  for (const int dof : whole.dofs_of(from)) island.dofs.push_back(w.place[as_index(dof)]);
  for (const Run& run : whole.runs_of(from)) {
    const int first = w.place[as_index(run.first)];
    island.runs.push_back({first, first + run.size()});
  }
}

void load(const Workspace& w, std::span<const int> members, std::span<const int> touching,
          ContactProblem& to) {
  const ContactProblem& whole = w.problem;
  const auto copy = [](const std::vector<double>& from, std::size_t first, std::size_t count,
                       std::vector<double>& out, std::size_t place) {
    std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(first), count,
                out.begin() + static_cast<std::ptrdiff_t>(place));
  };
  for (std::size_t i = 0; i < members.size(); ++i) {
    const std::size_t from = as_index(members[i]);
    const std::size_t entries = as_index(to.unknowns->last[i]) - i + 1;
    copy(whole.A, whole.unknowns->row_start[from] + from, entries, to.A, to.unknowns->row_start[i] + i);
    to.g[i] = whole.g[from];
    to.start[i] = whole.start[from];
    to.limits[i] = whole.limits[from];
    copy(whole.motions, kSpatial * from, kSpatial, to.motions, kSpatial * i);
  }
  const ContactRows* last = nullptr;
  for (const int c : touching) {
    const ContactRows& from = whole.contacts[as_index(c)];
    const Dofs shared = to.contacts.empty() ? Dofs() : to.contacts.back();
    ContactRows& contact = to.contacts.emplace_back(from);
    if (last && last->first_run == from.first_run)
      static_cast<Dofs&>(contact) = shared;
    else
      load_dofs(whole, w, from, contact, to);
    contact.first_entry = to.entries;
    to.entries += from.rows * from.dof_count;
    if (to.J.size() < to.entries) to.J.resize(to.entries);
    if (from.pair == kNone) {
      copy(whole.J, from.first_entry, from.rows * from.dof_count, to.J, contact.first_entry);
    } else {
      if (!last || last->pair != from.pair) {
        Pair& pair = to.pairs.emplace_back(whole.pairs[as_index(from.pair)]);
        static_cast<Dofs&>(pair) = contact;
        for (int* body : {&pair.a, &pair.b})
          if (*body != kNone) *body = w.place[as_index(*body)];
      }
      contact.pair = static_cast<int>(to.pairs.size()) - 1;
      contact.first_wrench = to.wrenches.size() / kSpatial;
      to.wrenches.resize(to.wrenches.size() + kSpatial * from.rows);
      copy(whole.wrenches, kSpatial * from.first_wrench, kSpatial * from.rows, to.wrenches,
           kSpatial * contact.first_wrench);
    }
    last = &from;
  }
}

/// Copies its solution back.
void store(const ContactProblem& island, std::span<const int> members, std::span<const int> touching,
           ContactProblem& whole) {
  for (std::size_t i = 0; i < members.size(); ++i) {
    const std::size_t to = as_index(members[i]);
    whole.x[to] = island.x[i];
    whole.limits[to].side = island.limits[i].side;
    whole.limits[to].saturated = island.limits[i].saturated;
  }
  for (std::size_t c = 0; c < touching.size(); ++c) {
    ContactRows& to = whole.contacts[as_index(touching[c])];
    const ContactRows& from = island.contacts[c];
    to.impulse = from.impulse;
    to.discs = from.discs;
    to.open = from.open;
  }
}

NewtonReport solve_island(ContactProblem& p, SparseFactor& factor, Workspace& w, double tolerance) {
  check(p);
  w.resize(p);
  factor.update_pattern(p, w);
  for (std::size_t i = 0; i < p.x.size(); ++i)
    p.x[i] = p.limits[i].side == LimitSide::within ? p.start[i] : p.limits[i].bound();
  NewtonReport report;
  if (p.size() <= kTuning.heap) {
    solve_newton(p, factor, w, tolerance, report);
    if (!report.solved) solve_fixed_limits(p, factor, w, tolerance, report);
    return report;
  }
  if (factor.work() <= kTuning.most_work) {
    w.latest.contacts = p.contacts;
    evaluate(p, w, Law::active_set);
    newton_steps(p, factor, w, kTuning.heap_steps, tolerance, report);
    if (report.solved) return report;
    p.contacts = w.latest.contacts;
  }
  solve_gauss_seidel(p, factor, w, tolerance, report);
  return report;
}

}  // namespace

void ContactSystem::assign(std::span<const int> first, Workspace& w) {
  all.assign(first);
  chosen.assign(first);
  w.reserve(all);
  factor.reserve(all);
  if (all.trees.size() < 2) return;
  island.reserve(first.size());
  part_factor.reserve(all);
}

void ContactSystem::forget() {
  factor.forget();
  part_factor.forget();
}

void ContactSystem::save(ArchiveWriter& out) const {
  factor.save(out);
  if (all.trees.size() > 1) part_factor.save(out);
}

void ContactSystem::restore(ArchiveReader& in) {
  factor.restore(in);
  if (all.trees.size() > 1) part_factor.restore(in);
}

NewtonReport solve(ContactSystem& system, Workspace& w, double tolerance) {
  ContactProblem& p = w.problem;
  const int islands = find_islands(p, w);
  if (islands == 1) return solve_island(p, system.factor, w, tolerance);
  const auto island_of_unknown = [&](int i) { return island_of(p, w, i); };
  const auto island_of_contact = [&](int c) { return island_of(p, w, p.contacts[as_index(c)]); };
  sort(p.size(), islands, w.members, w.first_member, w.next, island_of_unknown);
  sort(static_cast<int>(p.contacts.size()), islands, w.touching, w.first_touching, w.next, island_of_contact);
  NewtonReport report;
  report.solved = true;
  w.place.resize(as_index(p.size()));
  for (int island = 0; island < islands; ++island) {
    const std::span<const int> members = part(w.members, w.first_member, island),
                               touching = part(w.touching, w.first_touching, island);
    for (std::size_t i = 0; i < members.size(); ++i) w.place[as_index(members[i])] = static_cast<int>(i);
    system.island.choose(*p.unknowns, members);
    w.island.reset(system.island);
    load(w, members, touching, w.island);
    const NewtonReport part = solve_island(w.island, system.part_factor, w, tolerance);
    store(w.island, members, touching, p);
    report.iterations += part.iterations;
    report.limit_updates += part.limit_updates;
    report.residual = std::max(report.residual, part.residual);
    report.solved = report.solved && part.solved;
    report.iterative = report.iterative || part.iterative;
  }
  return report;
}

}  // namespace handsim::engine::articulated
