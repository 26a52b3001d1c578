// The solver of contact impulses by itself, against the law's own conditions.
#include <gtest/gtest.h>

#include <limits>
#include <numeric>
#include <random>

#include <Eigen/Dense>

#include "engine/articulated/contact/solver.h"
#include "handsim/core/pose.h"

namespace handsim::engine::articulated {
namespace {

// Oracle: the law's own conditions, put to random problems: signs, complementarity, the disc, and slip
// against friction. 12 dofs and 8 contacts, so that impulses are not unique, as where a hand holds an object.
TEST(ContactSolver, MeetsCoulombsLawOnRandomProblems) {
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
    Solver solver;
    solver.resize(std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11});
    solver.begin();
    std::vector<int> dofs(kDofs);
    for (int i = 0; i < kDofs; ++i) {
      dofs[static_cast<std::size_t>(i)] = i;
      solver.problem.inertia(i, i) = 1;
    }
    for (int i = 0; i < kContacts; ++i) {
      ContactRows& rows = solver.problem.add(dofs, 3);
      rows.open = false;
      rows.regularization = kSoftness;
      rows.disc_count = 1;
      rows.discs[0].coefficient = 0.4;
      rows.discs[0].regularization = kSoftness;
      for (int k = 0; k < 3; ++k) {
        rows.r0[static_cast<std::size_t>(k)] = b[3 * i + k];
        for (int j = 0; j < kDofs; ++j)
          solver.problem.jacobian(rows)[static_cast<std::size_t>(k * kDofs + j)] = J(3 * i + k, j);
      }
    }
    const NewtonReport report = solver.solve(1e-9);
    ASSERT_TRUE(report.solved) << trial << ": " << report.residual;
    EXPECT_LT(report.iterations, 150);
    Eigen::VectorXd p(3 * kContacts), x(kDofs);
    for (int i = 0; i < kDofs; ++i) x[i] = solver.problem.x[static_cast<std::size_t>(i)];
    for (int i = 0; i < 3 * kContacts; ++i)
      p[i] =
          solver.problem.contacts[static_cast<std::size_t>(i / 3)].impulse[static_cast<std::size_t>(i % 3)];
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

/// A random problem: trees of `dofs` unknowns each with the identity for inertia, contacts between
/// neighbours.
struct RandomProblem {
  int trees, dofs;
  Eigen::MatrixXd J;  ///< three rows a contact
  Eigen::VectorXd b;
  std::vector<int> tree_of;  ///< first of the two trees of each contact

  RandomProblem(int seed, int tree_count, int dof_count, int contacts, bool chained)
      : trees(tree_count), dofs(dof_count) {
    std::mt19937 random(static_cast<unsigned>(seed));
    std::normal_distribution<double> normal;
    J = Eigen::MatrixXd::Zero(3 * contacts, trees * dofs);
    for (int c = 0; c < contacts; ++c) {
      tree_of.push_back(c % (chained ? trees - 1 : trees));
      const int width = chained ? 2 * dofs : dofs;
      J.block(3 * c, tree_of.back() * dofs, 3, width) =
          Eigen::MatrixXd::NullaryExpr(3, width, [&] { return normal(random); });
    }
    b = J * Eigen::VectorXd::NullaryExpr(trees * dofs, [&] { return normal(random); });
  }
  void load(Solver& solver, double friction) const {
    std::vector<int> first;
    for (int i = 0; i < trees * dofs; ++i) first.push_back(i / dofs * dofs);
    solver.resize(first);
    fill(solver, friction);
  }
  /// Into a solver of the same unknowns, from the active set and the solution of another problem.
  void load_next(Solver& solver, double friction, const std::vector<ContactRows>& last,
                 const Eigen::VectorXd& start) const {
    if (solver.system.all.size() == 0)
      load(solver, friction);
    else
      fill(solver, friction);
    std::copy(start.begin(), start.end(), solver.problem.start.begin());
    for (std::size_t c = 0; c < last.size(); ++c) {
      ContactRows& rows = solver.problem.contacts.at(c);
      rows.open = last[c].open;
      rows.impulse = last[c].impulse;
      const double coefficient = rows.discs[0].coefficient;
      rows.discs = last[c].discs;
      rows.discs[0].coefficient = coefficient;
    }
  }
  void fill(Solver& solver, double friction) const {
    solver.begin();
    for (int i = 0; i < trees * dofs; ++i) solver.problem.inertia(i, i) = 1;
    for (std::size_t c = 0; c < tree_of.size(); ++c) {
      std::vector<int> places;
      const auto row = static_cast<Eigen::Index>(3 * c);
      for (int i = 0; i < trees * dofs; ++i)
        if (!J.block(row, i, 3, 1).isZero(0)) places.push_back(i);
      ContactRows& rows = solver.problem.add(places, 3);
      rows.open = false;
      rows.regularization = rows.discs[0].regularization = 1e-5;
      rows.disc_count = 1;
      rows.discs[0].coefficient = friction;
      for (Eigen::Index k = 0; k < 3; ++k) {
        rows.r0[static_cast<std::size_t>(k)] = b[row + k];
        for (std::size_t j = 0; j < places.size(); ++j)
          solver.problem.jacobian(rows)[static_cast<std::size_t>(k) * places.size() + j] =
              J(row + k, places[j]);
      }
    }
  }
  Eigen::VectorXd rates(const Solver& solver) const {
    return Eigen::Map<const Eigen::VectorXd>(solver.problem.x.data(), trees * dofs);
  }
  /// Kinetic energy before, and after a step x.
  double energy(const Eigen::VectorXd& start, const Eigen::VectorXd& x) const {
    return 0.5 * (start + x).squaredNorm();
  }
};

// Oracle: the contract: a problem that has no solution is not solved, and its unknowns are as many as before.
TEST(ContactSolver, KeepsItsUnknownsWhereNothingIsANumber) {
  Solver solver;
  solver.resize(std::vector<int>{0, 1, 2});
  solver.begin();
  const std::vector<int> dofs = {0, 1, 2};
  for (int i = 0; i < 3; ++i) solver.problem.inertia(i, i) = 1;
  ContactRows& rows = solver.problem.add(dofs, 3);
  rows.open = false;
  rows.regularization = 1e-5;
  rows.disc_count = 1;
  rows.discs[0].coefficient = 0.4;
  rows.discs[0].regularization = 1e-5;
  rows.r0[0] = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < 3; ++k) solver.problem.jacobian(rows)[k * 3 + k] = 1;
  EXPECT_FALSE(solver.solve(1e-9).solved);
  EXPECT_EQ(solver.problem.x.size(), 3U);
  EXPECT_EQ(solver.problem.limits.size(), 3U);
}

// Oracle: each island solved alone.
TEST(ContactSolver, IslandsAreSolvedAsIfAlone) {
  for (int seed = 0; seed < 20; ++seed) {
    const RandomProblem problem(seed, 5, 6, 10, false);
    Solver all;
    problem.load(all, 0.5);
    ASSERT_TRUE(all.solve(1e-9).solved);
    const Eigen::VectorXd x = problem.rates(all);
    for (int tree = 0; tree < 5; ++tree) {
      RandomProblem one = problem;
      one.trees = 1;
      one.tree_of.clear();
      std::vector<Eigen::Index> rows;
      for (Eigen::Index c = 0; c < 10; ++c)
        if (c % 5 == tree)
          for (Eigen::Index k = 0; k < 3; ++k) rows.push_back(3 * c + k);
      one.J.resize(static_cast<Eigen::Index>(rows.size()), 6);
      one.b.resize(static_cast<Eigen::Index>(rows.size()));
      for (Eigen::Index i = 0; i < one.b.size(); ++i) {
        one.J.row(i) = problem.J.row(rows[static_cast<std::size_t>(i)]).segment(6 * tree, 6);
        one.b[i] = problem.b[rows[static_cast<std::size_t>(i)]];
        if (i % 3 == 0) one.tree_of.push_back(0);
      }
      Solver alone;
      one.load(alone, 0.5);
      ASSERT_TRUE(alone.solve(1e-9).solved);
      EXPECT_EQ(one.rates(alone), x.segment(6 * tree, 6)) << seed << ", " << tree;
    }
  }
}

// Problems that wedge: friction of 1.5 with rows that have nothing to do with a body's shape. Oracle:
// contacts push and friction works against the slip; a step that is not Coulomb's is still one of friction
// with fixed limits, whose own equation holds: A x = J^T p.
TEST(ContactSolver, EveryStepIsASoundOneHoweverHard) {
  int by_updates = 0, unsolved = 0;
  for (int seed = 0; seed < 300; ++seed) {
    const RandomProblem problem(seed, 2, 6, 8, true);
    Solver solver;
    problem.load(solver, 1.5);
    const NewtonReport report = solver.solve(1e-7);
    by_updates += report.limit_updates > 0;
    unsolved += !report.solved;
    const Eigen::VectorXd x = problem.rates(solver);
    ASSERT_TRUE(x.allFinite()) << seed;
    Eigen::VectorXd p(problem.b.size());
    for (Eigen::Index i = 0; i < p.size(); ++i)
      p[i] =
          solver.problem.contacts[static_cast<std::size_t>(i / 3)].impulse[static_cast<std::size_t>(i % 3)];
    EXPECT_LT((x - problem.J.transpose() * p).cwiseAbs().maxCoeff(), 1e-6) << seed;
    const Eigen::VectorXd v = problem.b + problem.J * x;
    for (Eigen::Index c = 0; c < p.size() / 3; ++c) {
      EXPECT_GE(p[3 * c], 0) << seed;
      EXPECT_GT(v[3 * c], -1e-5 * p[3 * c] - 1e-7) << seed;
      // Friction works against the slip.
      EXPECT_LT(v.segment<2>(3 * c + 1).dot(p.segment<2>(3 * c + 1)), 1e-7) << seed;
    }
  }
  EXPECT_GT(by_updates, 30);
  EXPECT_LE(unsolved, 15);
}

// Oracle: a force that is no number has no solution, whichever solver the size of the problem takes.
TEST(ContactSolver, WhatIsNoNumberIsNotSolved) {
  for (const int trees : {2, 20}) {
    const RandomProblem problem(4, trees, 6, 3 * trees, true);
    Solver solver;
    problem.load(solver, 0.5);
    solver.problem.g[1] = NAN;
    EXPECT_FALSE(solver.solve(1e-7).solved) << trees;
  }
}

// Oracle: the law's conditions, which hold to what twenty sweeps leave, on a chain larger than a heap.
TEST(ContactSolver, HeapsAreRelaxedTowardsTheLaw) {
  const RandomProblem problem(4, 20, 6, 57, true);
  Solver solver;
  problem.load(solver, 0.5);
  NewtonReport report;
  // Each step starts from the impulses of the last one, as in a simulation.
  std::vector<std::array<double, kMostRows>> impulses;
  double first = 0;
  for (int step = 0; step < 40; ++step) {
    problem.load(solver, 0.5);
    for (std::size_t i = 0; i < impulses.size(); ++i) solver.problem.contacts.at(i).impulse = impulses[i];
    report = solver.solve(1e-12);
    impulses.clear();
    for (const ContactRows& contact : solver.problem.contacts) impulses.push_back(contact.impulse);
    if (step == 0) first = report.residual;
  }
  const Eigen::VectorXd v = problem.b + problem.J * problem.rates(solver);
  EXPECT_TRUE(report.iterative);
  EXPECT_LT(report.residual, 1e-2 * first);
  for (std::size_t c = 0; c < impulses.size(); ++c) {
    EXPECT_GE(impulses[c][0], 0);
    EXPECT_GT(v[static_cast<Eigen::Index>(3 * c)], -1e-4);
    EXPECT_LE(std::hypot(impulses[c][1], impulses[c][2]), 0.5 * impulses[c][0] * (1 + 1e-9));
  }
}

// Oracle: a dense solution of the same linear system. Random trees of unknowns with random branches and
// bilateral rows on random unknowns, of one branch with gaps, too: the sparse factor has all their fill-in.
TEST(ContactSolver, SparseSolutionIsTheDenseOne) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 300; ++trial) {
    const int n = 4 + trial % 20;
    // Parents come later, as a tree's unknowns stand: children first, its root last.
    std::vector<int> first(static_cast<std::size_t>(n)), open;
    std::vector<std::vector<int>> below(static_cast<std::size_t>(n));
    for (int i = 0; i < n; ++i) {
      auto& own = below[static_cast<std::size_t>(i)];
      first[static_cast<std::size_t>(i)] = i;
      for (auto children = random() % 3; children > 0 && !open.empty(); --children) {
        const int child = open.back();
        open.pop_back();
        own.insert(own.end(), below[static_cast<std::size_t>(child)].begin(),
                   below[static_cast<std::size_t>(child)].end());
        own.push_back(child);
        first[static_cast<std::size_t>(i)] = first[static_cast<std::size_t>(child)];
      }
      open.push_back(i);
    }
    Eigen::MatrixXd A = 10 * Eigen::MatrixXd::Identity(n, n);
    for (int i = 0; i < n; ++i)
      for (const int j : below[static_cast<std::size_t>(i)]) A(i, j) = A(j, i) = normal(random) / n;
    Solver solver;
    solver.resize(first);
    solver.begin();
    Eigen::VectorXd g(n);
    for (int i = 0; i < n; ++i) {
      solver.problem.g[static_cast<std::size_t>(i)] = g[i] = normal(random);
      for (const int j : below[static_cast<std::size_t>(i)]) solver.problem.inertia(j, i) = A(i, j);
      solver.problem.inertia(i, i) = A(i, i);
    }
    for (int row = 0; row < 3; ++row) {
      std::vector<int> dofs;
      for (int i = 0; i < n; ++i)
        if (random() % 3 == 0) dofs.push_back(i);
      if (dofs.empty()) dofs.push_back(row);
      ContactRows& rows = solver.problem.add(dofs, 1);
      rows.bilateral = true;
      rows.regularization = 0.1;
      rows.r0[0] = normal(random);
      Eigen::VectorXd J = Eigen::VectorXd::Zero(n);
      for (std::size_t k = 0; k < dofs.size(); ++k)
        solver.problem.jacobian(rows)[k] = J[dofs[k]] = normal(random);
      A += J * J.transpose() / rows.regularization;
      g -= J * rows.r0[0] / rows.regularization;
    }
    const NewtonReport report = solver.solve(1e-12);
    ASSERT_TRUE(report.solved) << trial;
    // One Newton step per island solves a linear problem; rounding may ask for another.
    EXPECT_LE(report.iterations, 2 * n) << trial;
    const Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(solver.problem.x.data(), n);
    EXPECT_LT((x - A.ldlt().solve(g)).cwiseAbs().maxCoeff(), 1e-11) << trial;
  }
}

// Oracle: the same problem with all unknowns, to the bit; after it and before it in the same solver.
TEST(ContactSolver, WhatIsNotSelectedChangesNothingElse) {
  const RandomProblem problem(1, 5, 6, 10, false);
  Solver all, some;
  problem.load(all, 0.5);
  const NewtonReport whole = all.solve(1e-9);
  problem.load(some, 0.5);
  some.solve(1e-9);
  RandomProblem chosen = problem;
  chosen.trees = 3;
  chosen.tree_of.clear();
  std::vector<int> unknowns;
  std::vector<Eigen::Index> rows, columns;
  for (const int tree : {0, 2, 3})
    for (int i = 6 * tree; i < 6 * (tree + 1); ++i) {
      unknowns.push_back(i);
      columns.push_back(i);
    }
  for (std::size_t c = 0; c < problem.tree_of.size(); ++c) {
    if (problem.tree_of[c] == 1 || problem.tree_of[c] == 4) continue;
    chosen.tree_of.push_back(problem.tree_of[c]);
    for (std::size_t k = 0; k < 3; ++k) rows.push_back(static_cast<Eigen::Index>(3 * c + k));
  }
  chosen.J = problem.J(rows, columns);
  chosen.b = problem.b(rows);
  EXPECT_TRUE(some.system.chosen.choose(some.system.all, unknowns));
  EXPECT_FALSE(some.system.chosen.choose(some.system.all, unknowns));
  chosen.fill(some, 0.5);
  const NewtonReport rest = some.solve(1e-9);
  EXPECT_TRUE(rest.solved);
  EXPECT_LT(rest.iterations, whole.iterations);
  EXPECT_EQ(Eigen::VectorXd(problem.rates(all)(columns)), chosen.rates(some));
  std::vector<int> every(30);
  std::iota(every.begin(), every.end(), 0);
  EXPECT_TRUE(some.system.chosen.choose(some.system.all, every));
  problem.fill(some, 0.5);
  some.solve(1e-9);
  EXPECT_EQ(problem.rates(all), problem.rates(some));
}

// Oracle: bit equality. Islands of several trees, with open, sticking and sliding contacts.
TEST(ContactSolver, EveryInstructionSetGivesTheSameBits) {
  for (int seed = 0; seed < 10; ++seed) {
    const RandomProblem problem(seed, 4, 7, 9, true);
    Solver first(*row_kernels().front());
    problem.load(first, 0.5);
    first.solve(1e-9);
    for (const RowKernel* kernel : row_kernels()) {
      Solver solver(*kernel);
      problem.load(solver, 0.5);
      solver.solve(1e-9);
      EXPECT_EQ(problem.rates(solver), problem.rates(first)) << seed;
    }
  }
}

// Oracle: the solution itself. The same problem once more, from its solution and active set, takes no step;
// nor does one that differs by less than a tenth of the tolerance, while one that differs by more does.
TEST(ContactSolver, ASolutionThatStillHoldsTakesNoStep) {
  constexpr double kTolerance = 1e-6;
  int held = 0;
  for (int seed = 0; seed < 20; ++seed) {
    const RandomProblem problem(seed, 2, 8, 6, true);
    Solver solver;
    problem.load(solver, 0.5);
    if (!solver.solve(kTolerance).solved) continue;
    std::vector<ContactRows> last(solver.problem.contacts.begin(), solver.problem.contacts.end());
    Eigen::VectorXd x = problem.rates(solver);
    // Once more, to far within the tolerance.
    problem.load_next(solver, 0.5, last, x);
    if (!(solver.solve(1e-3 * kTolerance).residual < 1e-2 * kTolerance)) continue;
    last.assign(solver.problem.contacts.begin(), solver.problem.contacts.end());
    x = problem.rates(solver);
    ++held;
    for (const double change : {0.0, 0.05, 2.0}) {
      problem.load_next(solver, 0.5, last, x);
      solver.problem.g[3] = change * kTolerance;
      const NewtonReport report = solver.solve(kTolerance);
      EXPECT_TRUE(report.solved) << seed;
      EXPECT_EQ(report.iterations == 0, change < 1) << seed << ", " << change;
      EXPECT_EQ(problem.rates(solver) == x, change < 1) << seed;
    }
  }
  EXPECT_GT(held, 5);
}

// Oracle: a solver that has no factor yet. The second problem differs from the first by a millionth and
// starts from its active set and solution, as the next step of a hold does.
TEST(ContactSolver, AFactorUsedAgainFindsTheSolutionOfTheNewProblem) {
  int used = 0;
  for (int seed = 0; seed < 20; ++seed) {
    RandomProblem problem(seed, 2, 8, 6, true);
    Solver again, fresh;
    problem.load(again, 0.5);
    if (!again.solve(1e-9).solved) continue;
    const std::vector<ContactRows> last(again.problem.contacts.begin(), again.problem.contacts.end());
    const Eigen::VectorXd start = problem.rates(again);
    // A factor of this active set: of a problem that the start does not solve.
    RandomProblem near = problem;
    near.b *= 1 + 1e-5;
    near.load_next(again, 0.5, last, start);
    again.solve(1e-9);
    problem.J *= 1 + 1e-6;
    problem.b *= 1 + 5e-7;
    ArchiveWriter before;
    again.system.save(before);
    for (Solver* solver : {&again, &fresh}) {
      problem.load_next(*solver, 0.5, last, start);
      const NewtonReport report = solver->solve(1e-9);
      ASSERT_TRUE(report.solved) << seed;
    }
    ArchiveWriter after;
    again.system.save(after);
    used += before.bytes() == after.bytes() ? 1 : 0;
    EXPECT_LT((problem.rates(again) - problem.rates(fresh)).cwiseAbs().maxCoeff(), 1e-8) << seed;
  }
  EXPECT_GT(used, 5);
}

}  // namespace
}  // namespace handsim::engine::articulated
