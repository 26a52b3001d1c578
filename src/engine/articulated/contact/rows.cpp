// Rows of contacts: entries by unknowns, or wrenches on one of two bodies. Wrenches are enough for velocities
// and impulses, by one recursion along the branches for all contacts; entries are found where a factor is.
#include <algorithm>
#include <utility>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/contact/solver.h"

namespace handsim::engine::articulated {

ContactNewton::Scratch& ContactNewton::scratch() {
  thread_local Scratch own;
  return own;
}

/// Of a contact that is added.
void ContactNewton::list_dofs(std::span<const int> dofs) {
  dofs_.insert(dofs_.end(), dofs.begin(), dofs.end());
  for (std::size_t k = 0; k < dofs.size(); ++k) {
    // A run does not go on from one tree to the next.
    if (k == 0 || dofs[k] != dofs[k - 1] + 1 || tree_first_[at(dofs[k])] == dofs[k])
      dof_runs_.push_back({dofs[k], dofs[k]});
    ++dof_runs_.back().end;
  }
}

ContactRows& ContactNewton::add(std::span<const int> dofs, std::size_t rows) {
  ContactRows& out = contacts_.emplace_back();
  out.rows = rows;
  out.dof_count = dofs.size();
  out.first_entry = own_entries_;
  own_entries_ += rows * dofs.size();
  if (J_.size() < own_entries_) J_.resize(own_entries_);
  // Contacts of one pair share their unknowns.
  if (contacts_.size() > 1) {
    const ContactRows& last = contacts_[contacts_.size() - 2];
    if (std::equal(dofs.begin(), dofs.end(), dofs_.begin() + static_cast<std::ptrdiff_t>(last.first_dof),
                   dofs_.end())) {
      out.first_dof = last.first_dof;
      out.first_run = last.first_run;
      out.run_count = last.run_count;
      return out;
    }
  }
  out.first_dof = dofs_.size();
  out.first_run = dof_runs_.size();
  list_dofs(dofs);
  out.run_count = dof_runs_.size() - out.first_run;
  return out;
}

void ContactNewton::add_pair(int a, int b, const Vec3& apart, std::span<const int> dofs) {
  Pair& pair = pairs_.emplace_back();
  pair.a = a;
  pair.b = b;
  pair.apart = apart;
  pair.first_dof = dofs_.size();
  pair.dof_count = dofs.size();
  pair.first_run = dof_runs_.size();
  list_dofs(dofs);
  pair.run_count = dof_runs_.size() - pair.first_run;
}

ContactRows& ContactNewton::add_contact(std::size_t rows) {
  // Copied: a third of the time that its default values take one by one.
  static const ContactRows kEmpty;
  const Pair& pair = pairs_.back();
  contacts_.push_back(kEmpty);
  ContactRows& out = contacts_.back();
  out.rows = rows;
  out.pair = static_cast<int>(pairs_.size()) - 1;
  out.first_dof = pair.first_dof;
  out.dof_count = pair.dof_count;
  out.first_run = pair.first_run;
  out.run_count = pair.run_count;
  out.first_entry = entries_;
  entries_ += rows * pair.dof_count;
  out.first_wrench = wrenches_.size() / kSpatial;
  wrenches_.resize(wrenches_.size() + kSpatial * rows);
  return out;
}

/// J of all contacts.
void ContactNewton::find_jacobians() {
  if (std::exchange(jacobians_known_, true) || pairs_.empty()) return;
  if (scratch().J.size() < entries_) scratch().J.resize(entries_);
  for (const ContactRows& contact : contacts_)
    if (contact.pair != kNone) find_jacobian(contact);
}

void ContactNewton::find_jacobian(const ContactRows& contact) {
  const Pair& pair = pairs_[at(contact.pair)];
  double* J = scratch().J.data() + contact.first_entry;
  std::array<double, kMostRows> column;
  int up = pair.a;
  for (std::size_t k = 0; k < contact.dof_count; ++k) {
    const int dof = dofs_[contact.first_dof + k];
    while (up != kNone && up < dof) up = parent_[at(up)];
    std::array<double, kSpatial> moved{};
    const double* S = motion(dof);
    if (up != dof) {
      // The unknown carries b: its motion at a's origin, the other way.
      const Vec3 w(S[0], S[1], S[2]), v = Vec3(S[4], S[5], S[6]) + w.cross(pair.apart);
      moved = {-w.x(), -w.y(), -w.z(), 0, -v.x(), -v.y(), -v.z(), 0};
      S = moved.data();
    }
    kernel_.project(wrenches(contact), contact.rows, S, column.data());
    for (std::size_t row = 0; row < contact.rows; ++row) J[row * contact.dof_count + k] = column[row];
  }
}

/// Of body a against b at a's origin.
void ContactNewton::find_relative_motion(const Pair& pair, double* out) const {
  const double *a = motion_of(pair.a), *b = motion_of(pair.b);
  const Vec3 w(b[0], b[1], b[2]), v = Vec3(b[4], b[5], b[6]) + w.cross(pair.apart);
  for (std::size_t k = 0; k < 3; ++k) {
    out[k] = a[k] - w[static_cast<Eigen::Index>(k)];
    out[4 + k] = a[4 + k] - v[static_cast<Eigen::Index>(k)];
  }
  out[3] = out[7] = 0;
}

/// out = J x, kMostRows a contact.
void ContactNewton::multiply_rows(const double* x, double* out) {
  if (!pairs_.empty()) kernel_.find_motions(motions_.data(), parent_.data(), n_, x, carried_.data());
  std::array<double, kSpatial> motion;
  int pair = kNone;
  for (std::size_t c = 0; c < contacts_.size(); ++c, out += kMostRows) {
    const ContactRows& contact = contacts_[c];
    if (contact.pair == kNone) {
      kernel_.multiply(rows(contact), x, out);
      continue;
    }
    if (contact.pair != pair) find_relative_motion(pairs_[at(contact.pair)], motion.data());
    pair = contact.pair;
    kernel_.project(wrenches(contact), contact.rows, motion.data(), out);
  }
}

/// A wrench on body a at its origin, and the opposite one on b.
void ContactNewton::add_pair_wrench(const Pair& pair, const double* wrench) {
  double *a = motion_of(pair.a), *b = motion_of(pair.b);
  const Vec3 f(wrench[4], wrench[5], wrench[6]),
      m = Vec3(wrench[0], wrench[1], wrench[2]) + pair.apart.cross(f);
  for (std::size_t k = 0; k < 3; ++k) {
    a[k] += wrench[k];
    a[4 + k] += wrench[4 + k];
    b[k] -= m[static_cast<Eigen::Index>(k)];
    b[4 + k] -= f[static_cast<Eigen::Index>(k)];
  }
}

/// -J^T p, into F_.
void ContactNewton::add_contact_impulses() {
  std::fill(carried_.begin(), carried_.end(), 0.0);
  std::array<double, kSpatial> wrench{};
  int pair = kNone;
  const auto add_pair = [&] {
    if (pair != kNone) add_pair_wrench(pairs_[at(pair)], wrench.data());
    wrench.fill(0);
  };
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    ContactRows& contact = contacts_[c];
    apply_law(contact, r_.data() + kMostRows * c, law_);
    if (contact.open && law_ != Law::fixed_limits) continue;
    if (contact.pair == kNone) {
      kernel_.subtract_transposed(rows(contact), contact.impulse.data(), F_.data());
      continue;
    }
    if (contact.pair != pair) add_pair();
    pair = contact.pair;
    kernel_.add_wrenches(wrenches(contact), contact.rows, contact.impulse.data(), wrench.data());
  }
  add_pair();
  if (!pairs_.empty())
    kernel_.subtract_wrenches(motions_.data(), parent_.data(), n_, carried_.data(), F_.data());
}

}  // namespace handsim::engine::articulated
