// The solution of contact problems. Trees that contacts and loops couple are islands, each a problem of its
// own: Newton's method solves it (newton.h), or else fixed friction limits (fixed_limits.h); heaps are
// relaxed (gauss_seidel.h).
#pragma once

#include "handsim/engine/articulated/contact/newton.h"

namespace handsim::engine::articulated {

/// The numbering and the factors that an engine keeps from one contact problem to the next.
struct ContactSystem {
  Unknowns all;              ///< that problems can have
  Unknowns chosen;           ///< those that they have now
  Unknowns island;           ///< those of the last island that was solved, where there were several
  SparseFactor factor;       ///< of the last problem, where it was one island
  SparseFactor part_factor;  ///< of the last island of several, which it serves in turn

  /// @param first as for Unknowns::assign
  void assign(std::span<const int> first, Workspace& w);
  void forget();
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);
};

/// Solves w.problem, with the chosen unknowns, from `start` and the active set in `open`, `slides` and the
/// sides of bounds and servos. Where Coulomb's law is not met to the tolerance [rad/s or m/s], gives the
/// solution with fixed friction limits whose residual is the least of those tried.
NewtonReport solve(ContactSystem& system, Workspace& w, double tolerance);

}  // namespace handsim::engine::articulated
