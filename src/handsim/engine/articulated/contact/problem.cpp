#include "handsim/engine/articulated/contact/problem.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <utility>

namespace handsim::engine::articulated {

void ContactProblem::reserve(const Unknowns& most) {
  const std::size_t n = as_index(most.size()), widest = most.widest();
  A.reserve(most.entries);
  Iterate::reserve(n);
  reserve_each(n, g, start);
  pairs.reserve(kUsualContacts);
  motions.reserve(kSpatial * n);
  wrenches.reserve(kUsualContacts * kUsualRows * kSpatial);
  dofs.reserve(kUsualContacts * widest);
  runs.reserve(kUsualContacts * 4);
  J.reserve(kUsualContacts * kMostRows * widest);
}

void ContactProblem::reset(const Unknowns& of) {
  unknowns = &of;
  const std::size_t n = as_index(of.size());
  A.assign(of.entries, 0.0);
  g.assign(n, 0.0);
  start.assign(n, 0.0);
  x.resize(n);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  limits.assign(n, {.low = -kInfinity, .high = kInfinity});
  motions.assign(kSpatial * n, 0.0);
  contacts.clear();
  dofs.clear();
  runs.clear();
  pairs.clear();
  wrenches.clear();
  entries = 0;
  with_jacobians = false;
}

void ContactProblem::list(Dofs& out, std::span<const int> of) {
  out = {dofs.size(), of.size(), runs.size(), 0};
  dofs.insert(dofs.end(), of.begin(), of.end());
  for (std::size_t k = 0; k < of.size(); ++k) {
    // A run does not go on from one tree to the next.
    if (k == 0 || of[k] != of[k - 1] + 1 || unknowns->tree(of[k]).first == of[k])
      runs.push_back({of[k], of[k]});
    ++runs.back().end;
  }
  out.run_count = runs.size() - out.first_run;
}

ContactRows& ContactProblem::add(std::span<const int> of, std::size_t rows) {
  ContactRows& out = contacts.emplace_back();
  // Rows of the same unknowns share them.
  const std::size_t last = contacts.size() < 2 ? 0 : contacts.size() - 2;
  const std::span<const int> shared = dofs_of(contacts[last]);
  if (std::equal(of.begin(), of.end(), shared.begin(), shared.end()))
    static_cast<Dofs&>(out) = static_cast<const Dofs&>(contacts[last]);
  else
    list(out, of);
  out.rows = rows;
  out.first_entry = entries;
  entries += rows * of.size();
  if (J.size() < entries) J.resize(entries);
  return out;
}

void ContactProblem::add_pair(int a, int b, const Vec3& apart, std::span<const int> of) {
  Pair& pair = pairs.emplace_back();
  pair.a = a;
  pair.b = b;
  pair.apart = apart;
  list(pair, of);
}

ContactRows& ContactProblem::add_contact(std::size_t rows) {
  // Copied: a third of the time that its default values take one by one.
  static const ContactRows kEmpty;
  const Pair& pair = pairs.back();
  contacts.push_back(kEmpty);
  ContactRows& out = contacts.back();
  static_cast<Dofs&>(out) = static_cast<const Dofs&>(pair);
  out.rows = rows;
  out.pair = static_cast<int>(pairs.size()) - 1;
  out.first_entry = entries;
  entries += rows * pair.dof_count;
  out.first_wrench = wrenches.size() / kSpatial;
  wrenches.resize(wrenches.size() + kSpatial * rows);
  return out;
}

void ContactProblem::compute_jacobians(const RowKernel& kernel) {
  if (std::exchange(with_jacobians, true)) return;
  if (J.size() < entries) J.resize(entries);
  std::array<double, kMostRows> column;
  for (const ContactRows& contact : contacts) {
    if (contact.pair == kNone) continue;
    const Pair& pair = pairs[as_index(contact.pair)];
    double* to = J.data() + contact.first_entry;
    int up = pair.a;
    for (std::size_t k = 0; k < contact.dof_count; ++k) {
      const int dof = dofs[contact.first_dof + k];
      while (up != kNone && up < dof) up = unknowns->parent[as_index(up)];
      std::array<double, kSpatial> moved{};
      const double* S = motion(dof);
      if (up != dof) {
        // The unknown carries b: its motion at a's origin, the other way.
        const Vec3 w(S[0], S[1], S[2]), v = Vec3(S[4], S[5], S[6]) + w.cross(pair.apart);
        moved = {-w.x(), -w.y(), -w.z(), 0, -v.x(), -v.y(), -v.z(), 0};
        S = moved.data();
      }
      kernel.project(wrenches_of(contact), contact.rows, S, column.data());
      for (std::size_t row = 0; row < contact.rows; ++row) to[row * contact.dof_count + k] = column[row];
    }
  }
}

void check([[maybe_unused]] const ContactProblem& p) {
#ifndef NDEBUG
  const Unknowns& u = *p.unknowns;
  const int n = p.size();
  assert(p.A.size() == u.entries && p.motions.size() == kSpatial * as_index(n));
  assert(!p.with_jacobians || p.J.size() >= p.entries);
  for (const std::size_t size : {p.g.size(), p.start.size(), p.x.size(), p.limits.size()})
    assert(size == as_index(n));
  for (int i = 0; i < n; ++i) {
    // A row and its column have the same ends: the pattern is symmetric, and fills along branches alone.
    const int up = u.parent[as_index(i)], last = u.last[as_index(i)];
    assert(u.first[as_index(i)] <= i && u.first[as_index(last)] <= i && i <= last && last < n);
    assert(up > i &&
           (up == n ? last == i
                    : u.last[as_index(up)] == last && u.first[as_index(up)] <= u.first[as_index(i)]));
    assert(!(p.limits[as_index(i)].low > p.limits[as_index(i)].high) && !(p.limits[as_index(i)].limit < 0));
  }
  std::size_t entries = 0;
  for (const ContactRows& contact : p.contacts) {
    const std::span<const int> dofs = p.dofs_of(contact);
    assert(!dofs.empty() && dofs.front() >= 0 && dofs.back() < n && std::ranges::is_sorted(dofs));
    auto dof = dofs.begin();
    for (const Run& run : p.runs_of(contact))
      for (int i = run.first; i < run.end; ++i) assert(dof != dofs.end() && *dof++ == i);
    assert(dof == dofs.end() && contact.first_entry == entries);
    entries += contact.rows * dofs.size();
    std::size_t row = 1;
    for (std::size_t k = 0; k < contact.disc_count; ++k) {
      assert(contact.discs[k].row == row);
      row += contact.discs[k].size;
    }
    assert(row == contact.rows && row <= kMostRows && contact.pair < static_cast<int>(p.pairs.size()));
  }
  assert(entries == p.entries);
#endif
}

}  // namespace handsim::engine::articulated
