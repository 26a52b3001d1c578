// The one place where a stiffness and a damping become ODE's ERP and CFM. No ODE types.
#pragma once

#include <algorithm>

namespace handsim::engine {

/// Softness of a constraint row.
struct SoftRow {
  double erp = 0;
  double cfm = 0;
};

/// ERP and CFM that make a constraint row an implicit spring-damper. A row obeys
///   v+ + CFM lambda = -(ERP / h) x,
/// with x its error and v+ its rate after the step; hence lambda = -k (x + h v+) - c v+, the spring-damper
/// evaluated at the end of the step, for ERP = h k / (h k + c), CFM = 1 / (h k + c). Stable at any h.
/// @param stiffness k [N m/rad] or [N/m], >= 0; @param damping c [N m s/rad] or [N s/m], >= 0, not both 0
/// @param step h [s], > 0. Source: ODE manual, "How to use ERP and CFM".
inline SoftRow soft_row(double stiffness, double damping, double step) {
  const double sum = step * stiffness + damping;
  return {step * stiffness / sum, 1.0 / sum};
}

/// Damping of a spring beside what its step adds. Evaluated at a step's end, a spring damps by h k more than
/// its damper does, with all that moves slowly by that much too late. A damper of h k alone makes the step
/// stable, for any mass: where c is more than that, the spring needs no more. Together they damp by max(c, h
/// k).
/// @param stiffness k, @param damping c, >= 0; @param step h [s]
inline double damping_beside(double stiffness, double damping, double step) {
  return std::max(damping - step * stiffness, 0.0);
}

}  // namespace handsim::engine
