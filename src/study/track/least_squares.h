// Least squares with bounds by Ceres. Ceres brings OpenBLAS, which reserves some 200 MB of address space
// where it is loaded; so it is in a module of its own (ceres_module.cpp), which the first use loads.
#pragma once

#include <span>

namespace handsim::study {

/// Minimises the squared residuals of parameters within bounds. Plain types: they cross to the module.
struct LeastSquares {
  /// Writes residuals and, where not null, their derivatives, row by residual.
  void (*evaluate)(const void* context, const double* x, double* residuals, double* jacobian) = nullptr;
  const void* context = nullptr;
  int residuals = 0, parameters = 0;
  const double* low = nullptr;   ///< by parameter; -infinity: no bound
  const double* high = nullptr;  ///< by parameter; infinity: no bound
};

/// Levenberg-Marquardt from x, which becomes the solution.
/// @throws Error (input) where the module or one of its libraries is missing.
void solve(const LeastSquares& problem, std::span<double> x);

}  // namespace handsim::study
