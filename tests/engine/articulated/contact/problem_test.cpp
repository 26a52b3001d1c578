// Contacts that the solver of impulses is given as wrenches on two bodies.
#include <gtest/gtest.h>

#include <random>

#include <Eigen/Dense>

#include "engine/articulated/contact/solver.h"
#include "handsim/core/pose.h"

namespace handsim::engine::articulated {
namespace {

/// Trees of unknowns 0-3, 4-6, and 7 and 8 on 9; what each moves, and pairs of bodies that they carry.
struct PairProblem {
  struct Pair {
    int a, b;
    Vec3 apart;
    std::vector<int> dofs;
  };
  static constexpr int kDofs = 10, kContacts = 6, kRows = 4;
  std::vector<int> first = {0, 0, 0, 0, 4, 4, 4, 7, 8, 7};
  std::vector<std::vector<int>> carriers = {{0, 1, 2, 3}, {1, 2, 3}, {2, 3}, {3},    {4, 5, 6},
                                            {5, 6},       {6},       {7, 9}, {8, 9}, {9}};
  std::vector<Pair> pairs;
  Eigen::MatrixXd S, G, J;
  Eigen::VectorXd b;

  explicit PairProblem(unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const auto any = [&] { return normal(random); };
    pairs = {{0, 4, Vec3(any(), any(), any()), {0, 1, 2, 3, 4, 5, 6}},
             {7, 8, Vec3::Zero(), {7, 8}},
             {kNone, 5, Vec3(any(), any(), any()), {5, 6}}};
    S = Eigen::MatrixXd::NullaryExpr(6, kDofs, any);
    G = Eigen::MatrixXd::NullaryExpr(kRows * kContacts, 6, any);
    J = Eigen::MatrixXd::Zero(kRows * kContacts, kDofs);
    for (int c = 0; c < kContacts; ++c) {
      const Pair& pair = pair_of(c);
      Eigen::MatrixXd relative = Eigen::MatrixXd::Zero(6, kDofs);
      if (pair.a != kNone)
        for (const int i : carriers[static_cast<std::size_t>(pair.a)]) relative.col(i) += S.col(i);
      for (const int i : carriers[static_cast<std::size_t>(pair.b)]) {
        const Vec3 w = S.col(i).head<3>();
        relative.col(i).head<3>() -= w;
        relative.col(i).tail<3>() -= S.col(i).tail<3>() + w.cross(pair.apart);
      }
      J.middleRows(kRows * c, kRows) = G.middleRows(kRows * c, kRows) * relative;
    }
    b = J * Eigen::VectorXd::NullaryExpr(kDofs, any);
  }
  const Pair& pair_of(int contact) const { return pairs[static_cast<std::size_t>(contact / 2)]; }

  Eigen::VectorXd solve(Solver& solver, bool by_wrenches) const {
    solver.resize(first);
    solver.begin();
    for (int i = 0; i < kDofs; ++i) {
      solver.problem.inertia(i, i) = 1 + 0.1 * i;
      for (int k = 0; k < 6; ++k) solver.problem.motion(i)[k < 3 ? k : k + 1] = S(k, i);
    }
    for (int c = 0; c < kContacts; ++c) {
      const Pair& pair = pair_of(c);
      if (by_wrenches && c % 2 == 0) solver.problem.add_pair(pair.a, pair.b, pair.apart, pair.dofs);
      ContactRows& rows =
          by_wrenches ? solver.problem.add_contact(kRows) : solver.problem.add(pair.dofs, kRows);
      rows.open = false;
      rows.regularization = 1e-3;
      rows.disc_count = 2;
      rows.discs[0].coefficient = 0.5;
      rows.discs[1] = rows.discs[0];
      rows.discs[1].kind = Disc::Kind::spinning;
      rows.discs[1].row = 3;
      rows.discs[1].size = 1;
      rows.discs[0].regularization = rows.discs[1].regularization = 1e-3;
      for (int k = 0; k < kRows; ++k) {
        rows.r0[static_cast<std::size_t>(k)] = b[kRows * c + k];
        for (int j = 0; j < 6 && by_wrenches; ++j)
          solver.problem.wrenches_of(
              rows)[kSpatial * static_cast<std::size_t>(k) + static_cast<std::size_t>(j < 3 ? j : j + 1)] =
              G(kRows * c + k, j);
        for (std::size_t j = 0; j < pair.dofs.size() && !by_wrenches; ++j)
          solver.problem.jacobian(rows)[static_cast<std::size_t>(k) * pair.dofs.size() + j] =
              J(kRows * c + k, pair.dofs[j]);
      }
    }
    EXPECT_TRUE(solver.solve(1e-11).solved);
    return Eigen::Map<const Eigen::VectorXd>(solver.problem.x.data(), kDofs);
  }
};

// Oracle: the same contacts given by the entries of their Jacobians, each a sum by definition; in islands and
// with every instruction set, which all give the same bits.
TEST(ContactSolver, WrenchesAreAsGoodAsEntries) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    const PairProblem problem(seed);
    Solver entries;
    const Eigen::VectorXd want = problem.solve(entries, false);
    Eigen::VectorXd first;
    for (const RowKernel* kernel : row_kernels()) {
      Solver wrenches(*kernel);
      const Eigen::VectorXd x = problem.solve(wrenches, true);
      EXPECT_LT((x - want).cwiseAbs().maxCoeff(), 1e-9) << seed;
      if (first.size() == 0) first = x;
      EXPECT_EQ(x, first) << seed;
    }
  }
}

// Oracle: a sound problem passes; with one rule broken a debug build ends at that rule.
TEST(ContactProblem, WithABrokenRuleEndsADebugBuild) {
  Solver solver;
  PairProblem(1).solve(solver, true);
  check(solver.problem);
  const ContactProblem sound = solver.problem;
  ContactProblem bounds = sound, rows = sound, pattern = sound;
  bounds.limits[3] = {.low = 1, .high = 0};
  EXPECT_DEBUG_DEATH(check(bounds), "low > ");
  rows.contacts[0].discs[1].row = 2;
  EXPECT_DEBUG_DEATH(check(rows), "row == row");
  pattern.A.pop_back();
  EXPECT_DEBUG_DEATH(check(pattern), "A.size");
}

}  // namespace
}  // namespace handsim::engine::articulated
