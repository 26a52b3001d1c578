// The module that least_squares.h loads: Ceres and what it brings.
#include <cmath>

#include "handsim/study/track/least_squares.h"

#ifdef __GNUC__
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#endif
#include <ceres/ceres.h>
#ifdef __GNUC__
#pragma GCC diagnostic pop
#endif

namespace {

class Cost final : public ceres::CostFunction {
 public:
  explicit Cost(const handsim::study::LeastSquares& of) : of_(of) {
    mutable_parameter_block_sizes()->push_back(of.parameters);
    set_num_residuals(of.residuals);
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    of_.evaluate(of_.context, parameters[0], residuals, jacobians ? jacobians[0] : nullptr);
    return true;
  }

 private:
  const handsim::study::LeastSquares& of_;
};

}  // namespace

extern "C" __attribute__((visibility("default"))) void handsim_least_squares(
    const handsim::study::LeastSquares* of, double* x) {
  Cost cost(*of);
  ceres::Problem::Options borrowed;
  borrowed.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(borrowed);
  problem.AddResidualBlock(&cost, nullptr, x);
  for (int i = 0; i < of->parameters; ++i) {
    if (std::isfinite(of->low[i])) problem.SetParameterLowerBound(x, i, of->low[i]);
    if (std::isfinite(of->high[i])) problem.SetParameterUpperBound(x, i, of->high[i]);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 60;
  options.function_tolerance = 1e-7;
  options.parameter_tolerance = 1e-10;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
}
