#include "handsim/core/least_squares.h"

#include <Eigen/QR>
#include <Eigen/SVD>

namespace handsim {

struct LeastSquares::Factors {
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> of;
};

LeastSquares::LeastSquares(const Eigen::MatrixXd& a, double threshold)
    : factors_(std::make_unique<Factors>()) {
  factors_->of.setThreshold(threshold);
  factors_->of.compute(a);
}
LeastSquares::~LeastSquares() = default;

Eigen::VectorXd LeastSquares::solve(const Eigen::VectorXd& b) const { return factors_->of.solve(b); }

Eigen::VectorXd singular_values(const Eigen::MatrixXd& a) {
  return Eigen::JacobiSVD<Eigen::MatrixXd>(a).singularValues();
}

}  // namespace handsim
