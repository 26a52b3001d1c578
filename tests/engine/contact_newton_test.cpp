// The solver of contact impulses by itself, against the law's own conditions.
#include <gtest/gtest.h>

#include <random>

#include <Eigen/Dense>

#include "handsim/core/pose.h"
#include "handsim/engine/articulated/contact_newton.h"

namespace handsim::engine::articulated {
namespace {

// Oracle: the law's own conditions, put to random problems: signs, complementarity, the disc, and slip
// against friction. 12 dofs and 8 contacts, so that impulses are not unique, as where a hand holds an object.
TEST(ContactNewton, MeetsCoulombsLawOnRandomProblems) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  constexpr double kSoftness = 1e-5;
  int sticking = 0, sliding = 0, open = 0;
  for (int trial = 0; trial < 200; ++trial) {
    constexpr int kContacts = 8, kDofs = 12;
    const Eigen::MatrixXd J =
        Eigen::MatrixXd::NullaryExpr(3 * kContacts, kDofs, [&] { return normal(random); });
    // A velocity that the dofs can have, so that a solution exists.
    const Eigen::VectorXd b = J * Eigen::VectorXd::NullaryExpr(kDofs, [&] { return normal(random); });
    ContactNewton solver;
    solver.resize({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11});
    solver.begin();
    std::vector<int> dofs(kDofs);
    for (int i = 0; i < kDofs; ++i) {
      dofs[static_cast<std::size_t>(i)] = i;
      solver.inertia(i, i) = 1;
    }
    for (int i = 0; i < kContacts; ++i) {
      ContactRows& rows = solver.add(dofs, 3);
      rows.open = false;
      rows.softness = kSoftness;
      rows.disc_count = 1;
      rows.discs[0].coefficient = 0.4;
      rows.discs[0].softness = kSoftness;
      for (int k = 0; k < 3; ++k) {
        rows.start[static_cast<std::size_t>(k)] = b[3 * i + k];
        for (int j = 0; j < kDofs; ++j)
          solver.jacobian(rows)[static_cast<std::size_t>(k * kDofs + j)] = J(3 * i + k, j);
      }
    }
    const NewtonReport report = solver.solve(1e-9);
    ASSERT_TRUE(report.solved) << trial << ": " << report.residual;
    EXPECT_LT(report.iterations, 150);
    Eigen::VectorXd p(3 * kContacts), x(kDofs);
    for (int i = 0; i < kDofs; ++i) x[i] = solver.x()[static_cast<std::size_t>(i)];
    for (int i = 0; i < 3 * kContacts; ++i)
      p[i] = solver.contacts()[static_cast<std::size_t>(i / 3)].impulse[static_cast<std::size_t>(i % 3)];
    EXPECT_LT((x - J.transpose() * p).cwiseAbs().maxCoeff(), 1e-7);
    const Eigen::VectorXd v = b + J * x;
    for (int i = 0; i < kContacts; ++i) {
      const Vec3 v_i = v.segment<3>(3 * i), p_i = p.segment<3>(3 * i);
      const double bound = 0.4 * p_i.x(), friction = p_i.tail<2>().norm(), slip = v_i.tail<2>().norm();
      const double give = kSoftness * p_i.norm() + 1e-9;
      EXPECT_GE(p_i.x(), 0);
      EXPECT_GT(v_i.x(), -give);
      EXPECT_LT(p_i.x() * v_i.x(), 1e-8);
      EXPECT_LE(friction, bound * (1 + 1e-12));
      if (p_i.x() == 0) {
        ++open;
      } else if (friction < bound * (1 - 1e-9)) {
        EXPECT_LT(slip, give);
        ++sticking;
      } else {
        EXPECT_LT(v_i.tail<2>().dot(p_i.tail<2>()), -(1 - 1e-6) * slip * friction + 1e-9);
        ++sliding;
      }
    }
  }
  EXPECT_GT(std::min({sticking, sliding, open}), 10);
}

}  // namespace
}  // namespace handsim::engine::articulated
