// Block Gauss-Seidel sweeps over contacts, for heaps, whose islands are too large for Newton's method.
#pragma once

#include "handsim/engine/articulated/contact/newton.h"

namespace handsim::engine::articulated {

/// Solves one island, whose pattern the factor has, from the contacts' impulses.
void solve_gauss_seidel(ContactProblem& p, SparseFactor& factor, Workspace& w, double tolerance,
                        NewtonReport& report);

}  // namespace handsim::engine::articulated
