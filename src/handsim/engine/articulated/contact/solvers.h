// The solution of contact problems. It is found by semi-smooth Newton steps (Alart and Curnier 1991, "A mixed
// formulation for frictional contact problems prone to Newton like solution methods", CMAME 92) from the
// active set of the last step; the factor is sparse along the branches of the mechanism. While the active set
// stays, the factor of an earlier problem serves for as long as its steps converge fast (the modified Newton
// method), as they do in a hold. Where the last solution solves the next problem, as it often does in a hold,
// no step is taken.
// Coulomb's law is not the gradient of an energy, so these steps need not converge. Then friction's limits
// are held fixed, which makes the problem convex: Newton's method with a line search solves it, and the
// limits are iterated (fixed_limits.cpp). Heaps are solved by block Gauss-Seidel (gauss_seidel.cpp).
// Trees that contacts and loops couple are islands, each a problem of its own.
#pragma once

#include "handsim/engine/articulated/contact/sparse_factor.h"

namespace handsim::engine::articulated {

/// What a solution took and how exact it is.
struct NewtonReport {
  int iterations = 0;      ///< linear systems solved; relaxed: and sweeps
  int limit_updates = 0;   ///< of friction's limits, where Newton's method alone did not converge
  double residual = 0;     ///< largest |F_i| / A_ii; relaxed: change in the last sweep [rad/s, m/s]
  bool solved = false;     ///< the residual is within the tolerance; if `iterative`, is a number
  bool iterative = false;  ///< relaxed by block Gauss-Seidel: too large for Newton's method
};

/// What an engine keeps from problem to problem.
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

/// The three solvers, for one island whose pattern the factor has. This one goes on from Problem::x.
void solve_newton(Problem& p, SparseFactor& factor, Workspace& w, double tolerance, NewtonReport& report);
/// Starts anew, from x = 0 without friction, and adds to the report.
void solve_fixed_limits(Problem& p, SparseFactor& factor, Workspace& w, double tolerance,
                        NewtonReport& report);
/// From the contacts' impulses.
void solve_gauss_seidel(Problem& p, SparseFactor& factor, Workspace& w, double tolerance,
                        NewtonReport& report);

// Steps of Newton's method and its fallback (newton.cpp). Newton's step into d, its J d into s.
void compute_step(Problem& p, SparseFactor& factor, Workspace& w, NewtonReport& report);
/// x += share d, projected on the bounds unless these are penalties. @returns whether x has moved by all of d
bool advance(Problem& p, const Workspace& w, double share);
/// Whether the evaluated x is the solution.
bool solved(Problem& p, Workspace& w, double tolerance, NewtonReport& report);
/// Newton steps from an evaluated x.
void newton_steps(Problem& p, SparseFactor& factor, Workspace& w, int most, double tolerance,
                  NewtonReport& report);

}  // namespace handsim::engine::articulated
