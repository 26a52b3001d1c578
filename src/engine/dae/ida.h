// A wrapper of SUNDIALS IDA (variable-order, variable-step BDF for F(t, y, y') = 0; Hindmarsh et al. 2005,
// ACM TOMS 31) with Eigen vectors. Failures are one exception; nothing is printed.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <ida/ida.h>

#include "handsim/engine/multibody/system.h"

namespace handsim::engine::dae {

/// IDA failed.
struct IdaFailure {
  double time = 0;     ///< time that was reached [s]
  Index worst = 0;     ///< index of the unknown with the largest weighted error
  std::string reason;  ///< IDA's message
};

/// F(t, y, y') = 0.
struct IdaProblem {
  using Residual = std::function<void(double t, const Vector& y, const Vector& slope, Vector& out)>;
  Residual residual;
  Vector absolute;      ///< absolute tolerance of each unknown
  double relative = 0;  ///< relative tolerance
  Vector differential;  ///< 1 for unknowns in the error test, 0 for the others
};

class Ida {
 public:
  /// Starts at consistent y and y'.
  Ida(IdaProblem problem, double time, const Vector& y, const Vector& slope);
  /// The solution at a time [s], which must not decrease between calls. Internal steps may pass it, but not
  /// `limit` [s].
  /// @throws IdaFailure
  Vector advance(double time, double limit);

 private:
  struct Free {
    void operator()(SUNContext context) const;
    void operator()(N_Vector vector) const;
    void operator()(SUNMatrix matrix) const;
    void operator()(SUNLinearSolver solver) const;
    void operator()(void* ida) const;
  };
  template <class T>
  using Owner = std::unique_ptr<std::remove_pointer_t<T>, Free>;

  Owner<N_Vector> vector(const Vector& values) const;
  static int on_residual(double t, N_Vector y, N_Vector slope, N_Vector out, void* user);
  static int on_jacobian(double t, double cj, N_Vector y, N_Vector slope, N_Vector residual, SUNMatrix out,
                         void* user, N_Vector, N_Vector, N_Vector);
  static void on_message(int code, const char* module, const char* function, char* text, void* user);
  Index worst_unknown() const;

  IdaProblem problem_;
  std::string message_;
  Owner<SUNContext> context_;
  Owner<N_Vector> y_, slope_;
  Owner<SUNMatrix> matrix_;
  Owner<SUNLinearSolver> solver_;
  std::unique_ptr<void, Free> ida_;
};

}  // namespace handsim::engine::dae
