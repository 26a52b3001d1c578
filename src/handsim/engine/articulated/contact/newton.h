// Semi-smooth Newton steps (Alart and Curnier 1991, "A mixed formulation for frictional contact problems
// prone to Newton like solution methods", CMAME 92) from the active set of the last step; the factor is
// sparse along the branches of the mechanism. While the active set stays, the factor of an earlier problem
// serves for as long as its steps converge fast (the modified Newton method), as they do in a hold. Where the
// last solution solves the next problem, as it often does in a hold, no step is taken.
#pragma once

#include "handsim/engine/articulated/contact/sparse_factor.h"

namespace handsim::engine::articulated {

/// The effort that a solution took, and its accuracy.
struct NewtonReport {
  int iterations = 0;      ///< linear systems solved; relaxed: and sweeps
  int limit_updates = 0;   ///< of friction's limits, where Newton's method alone did not converge
  double residual = 0;     ///< largest |F_i| / A_ii; relaxed: change in the last sweep [rad/s, m/s]
  bool solved = false;     ///< the residual is within the tolerance; if `iterative`, is a number
  bool iterative = false;  ///< relaxed by block Gauss-Seidel: too large for Newton's method
};

/// Solves one island, whose pattern the factor has, from ContactProblem::x on. Coulomb's law is not the
/// gradient of an energy, so Newton's steps need not converge: then `report.solved` is false.
void solve_newton(ContactProblem& p, SparseFactor& factor, Workspace& w, double tolerance,
                  NewtonReport& report);

/// Computes Newton's step into w.d, and its J d into w.s.
void compute_step(ContactProblem& p, SparseFactor& factor, Workspace& w, NewtonReport& report);
/// x += share d, projected on the bounds unless these are penalties. @returns whether x has moved by all of d
bool advance(ContactProblem& p, const Workspace& w, double share);
/// @returns whether the evaluated x is the solution
bool solved(ContactProblem& p, Workspace& w, double tolerance, NewtonReport& report);
/// Makes Newton steps from an evaluated x.
void newton_steps(ContactProblem& p, SparseFactor& factor, Workspace& w, int most, double tolerance,
                  NewtonReport& report);

}  // namespace handsim::engine::articulated
