// The solver of contact problems by itself.
#pragma once

#include <span>

#include "handsim/engine/articulated/contact/islands.h"

namespace handsim::engine::articulated {

struct Solver {
  explicit Solver(const RowKernel& kernel = row_kernel()) : work(kernel) {}
  void resize(std::span<const int> first) { system.assign(first, work); }
  ContactProblem& begin() {
    problem.reset(system.chosen);
    return problem;
  }
  NewtonReport solve(double tolerance) { return articulated::solve(system, work, tolerance); }

  Workspace work;
  ContactSystem system;
  ContactProblem& problem = work.problem;
};

}  // namespace handsim::engine::articulated
