#include "handsim/study/validate/linear_program.h"

#include <limits>

#include <gtest/gtest.h>

namespace handsim::study {
namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();

// Oracle: by hand. 3 x + 2 y is largest where x + y = 4 and x is at its bound 3.
TEST(LinearProgram, FindsTheCorner) {
  Eigen::MatrixXd equal(1, 3);
  equal << 1, 1, 1;
  const auto x = largest(Eigen::Vector3d(3, 2, 0), equal, Eigen::VectorXd::Constant(1, 4),
                         Eigen::Vector3d(3, kNone, kNone));
  ASSERT_TRUE(x);
  EXPECT_TRUE(x->isApprox(Eigen::Vector3d(3, 1, 0), 1e-6)) << x->transpose();
}

// Oracle: x + y = 4 has no point with both below 1; and x - y = 0 has points without end.
TEST(LinearProgram, SaysWhereThereIsNone) {
  Eigen::MatrixXd sum(1, 2), difference(1, 2);
  sum << 1, 1;
  difference << 1, -1;
  EXPECT_FALSE(largest(Eigen::Vector2d(1, 0), sum, Eigen::VectorXd::Constant(1, 4), Eigen::Vector2d(1, 1)));
  EXPECT_FALSE(
      largest(Eigen::Vector2d(1, 0), difference, Eigen::VectorXd::Zero(1), Eigen::Vector2d(kNone, kNone)));
}

}  // namespace
}  // namespace handsim::study
