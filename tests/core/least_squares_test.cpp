#include "handsim/core/least_squares.h"

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include <Eigen/Dense>

namespace handsim {
namespace {

// Oracle: the normal equations, and a solution without a part that A sends to zero.
TEST(LeastSquares, OfAMatrixWithoutFullRankIsTheShortestOne) {
  const Eigen::MatrixXd low = Eigen::MatrixXd::Random(7, 2) * Eigen::MatrixXd::Random(2, 4);
  const Eigen::VectorXd b = Eigen::VectorXd::Random(7), x = LeastSquares(low, 1e-9).solve(b);
  EXPECT_LT((low.transpose() * (low * x - b)).norm(), 1e-12);
  const Eigen::MatrixXd kernel = Eigen::FullPivLU<Eigen::MatrixXd>(low).kernel();
  ASSERT_EQ(kernel.cols(), 2);
  EXPECT_LT((kernel.transpose() * x).norm(), 1e-12);
}

// Oracle: roots of the eigenvalues of A^T A.
TEST(LeastSquares, SingularValuesAreThoseOfTheSquare) {
  const Eigen::MatrixXd a = Eigen::MatrixXd::Random(5, 3);
  const Eigen::VectorXd squares =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a.transpose() * a).eigenvalues();
  EXPECT_LT((singular_values(a) - squares.reverse().cwiseSqrt()).norm(), 1e-12);
}

}  // namespace
}  // namespace handsim
