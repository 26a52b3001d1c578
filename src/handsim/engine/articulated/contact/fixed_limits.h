// The fallback where Newton's method does not converge: friction's limits are held fixed, which makes the
// problem convex. Newton's method with a line search solves it, and the limits are iterated.
#pragma once

#include "handsim/engine/articulated/contact/newton.h"

namespace handsim::engine::articulated {

/// Solves one island, whose pattern the factor has, anew: from x = 0 without friction. Adds to the report.
void solve_fixed_limits(ContactProblem& p, SparseFactor& factor, Workspace& w, double tolerance,
                        NewtonReport& report);

}  // namespace handsim::engine::articulated
