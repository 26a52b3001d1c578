#include "handsim/simulation/watch/wrench_space.h"

#include <cmath>
#include <random>
#include <vector>
#include "support/sanitized.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>

namespace handsim::simulation {
namespace {

constexpr double kRadius = 0.03;

std::vector<WrenchContact> opposed(double friction, double spinning) {
  return {{Vec3(kRadius, 0, 0), -Vec3::UnitX(), friction, spinning},
          {Vec3(-kRadius, 0, 0), Vec3::UnitX(), friction, spinning}};
}

/// Fingers at the corners of a regular tetrahedron on a ball.
std::vector<WrenchContact> tetrahedral(double friction) {
  std::vector<WrenchContact> out;
  for (const Vec3& corner : {Vec3(1, 1, 1), Vec3(1, -1, -1), Vec3(-1, 1, -1), Vec3(-1, -1, 1)}) {
    const Vec3 n = corner.normalized();
    out.push_back({kRadius * n, -n, friction, 0});
  }
  return out;
}

// Oracle: two hard points cannot hold a body against a torque about the line between them (Nguyen 1988).
TEST(WrenchSpace, TwoHardPointsHaveNoForceClosure) {
  const WrenchSpace space = wrench_space(opposed(0.8, 0), kRadius);
  EXPECT_FALSE(space.force_closure);
  EXPECT_EQ(space.epsilon, 0);
  EXPECT_EQ(space.volume, 0);
}

// Oracle: by hand. With m the smallest reach of the pyramid's octagon and s the spinning friction over the
// length, the least support lies, for small s, between the twist about the line and a sideways force (of
// which the unit of normal force can give only one): s m / sqrt(s^2 + m^2); for large s, where one contact is
// pushed off by a force along the line, and the other resists sideways force and torque at once: m / sqrt(2 +
// m^2).
TEST(WrenchSpace, TwoSoftPointsHaveTheEpsilonOfTheirClosedForm) {
  const double friction = 0.5;
  const double m = friction * std::cos(M_PI / kConeEdges);
  for (const double s : {0.01, 0.05, 0.2})
    EXPECT_NEAR(wrench_space(opposed(friction, s * kRadius), kRadius).epsilon, s * m / std::hypot(s, m),
                1e-9);
  EXPECT_NEAR(wrench_space(opposed(friction, 0.9 * kRadius), kRadius).epsilon, m / std::sqrt(2 + m * m),
              1e-9);
}

// Oracle: a force pushes, so contacts on one side of a body hold nothing, whatever their friction.
TEST(WrenchSpace, ContactsOnOneSideHaveNoForceClosure) {
  std::vector<WrenchContact> contacts;
  for (const Vec3& p : {Vec3(0.02, 0, 0), Vec3(-0.02, 0.01, 0), Vec3(0, -0.02, 0)})
    contacts.push_back({p, Vec3::UnitZ(), 0.5, 0});
  const WrenchSpace space = wrench_space(contacts, kRadius);
  EXPECT_FALSE(space.force_closure);
  EXPECT_EQ(space.epsilon, 0);
}

// Oracle: Ferrari & Canny's epsilon is the least support of the hull over all directions; here by descent
// from many directions, with the wrenches written down anew.
TEST(WrenchSpace, EpsilonIsTheLeastSupport) {
  HANDSIM_SKIP_WITH_SANITIZER("the time is the oracle's; other tests make hulls");
  const double friction = 0.6;
  std::vector<Eigen::Matrix<double, 6, 1>> wrenches;
  for (const WrenchContact& contact : tetrahedral(friction)) {
    const Vec3 u = contact.normal.unitOrthogonal(), v = contact.normal.cross(u);
    for (int i = 0; i < kConeEdges; ++i) {
      const double angle = 2 * M_PI * i / kConeEdges;
      const Vec3 f = contact.normal + friction * (std::cos(angle) * u + std::sin(angle) * v);
      Eigen::Matrix<double, 6, 1> wrench;
      wrench << f, contact.position.cross(f) / kRadius;
      wrenches.push_back(wrench);
    }
  }
  const auto support = [&](const Eigen::Matrix<double, 6, 1>& direction, std::size_t& at) {
    double most = -1e9;
    for (std::size_t i = 0; i < wrenches.size(); ++i)
      if (const double s = wrenches[i].dot(direction); s > most) {
        most = s;
        at = i;
      }
    return most;
  };
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  double least = 1e9;
  for (int start = 0; start < 60; ++start) {
    Eigen::Matrix<double, 6, 1> direction;
    for (int k = 0; k < 6; ++k) direction[k] = normal(random);
    direction.normalize();
    for (int i = 1; i <= 4000; ++i) {
      std::size_t at = 0;
      least = std::min(least, support(direction, at));
      direction = (direction - 0.3 / i * wrenches[at]).normalized();
    }
  }
  const WrenchSpace space = wrench_space(tetrahedral(friction), kRadius);
  EXPECT_TRUE(space.force_closure);
  EXPECT_LE(space.epsilon, least + 1e-12);
  EXPECT_NEAR(space.epsilon, least, 5e-3 * least);
}

// Oracle: seven frictionless contacts span a simplex: its volume is a determinant over 6!, and the distance
// of the origin from each facet follows from the plane through six of its corners.
TEST(WrenchSpace, OfSevenFrictionlessContactsIsASimplex) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  int closed = 0;
  for (int trial = 0; trial < 400; ++trial) {
    std::vector<WrenchContact> contacts;
    Eigen::Matrix<double, 6, 7> w;
    for (int i = 0; i < 7; ++i) {
      const Vec3 p(normal(random), normal(random), normal(random));
      const Vec3 n = Vec3(normal(random), normal(random), normal(random)).normalized();
      contacts.push_back({p, n, 0, 0});
      w.col(i) << n, p.cross(n);
    }
    Eigen::Matrix<double, 6, 6> edges;
    for (int i = 0; i < 6; ++i) edges.col(i) = w.col(i + 1) - w.col(0);
    double nearest = 1e9;
    for (int left_out = 0; left_out < 7; ++left_out) {
      Eigen::Matrix<double, 6, 6> corners;
      for (int i = 0, k = 0; i < 7; ++i)
        if (i != left_out) corners.row(k++) = w.col(i).transpose();
      const Eigen::Matrix<double, 6, 1> plane =
          corners.fullPivLu().solve(Eigen::Matrix<double, 6, 1>::Ones());
      const bool same_side = plane.dot(w.col(left_out)) < 1;
      nearest = std::min(nearest, (same_side ? 1 : -1) / plane.norm());
    }
    const WrenchSpace space = wrench_space(contacts, 1);
    EXPECT_NEAR(space.volume, std::abs(edges.determinant()) / 720,
                1e-9 * std::abs(edges.determinant()) + 1e-12);
    EXPECT_NEAR(space.epsilon, std::max(0.0, nearest), 1e-9);
    EXPECT_EQ(space.force_closure, nearest > 1e-9);
    closed += space.force_closure ? 1 : 0;
  }
  EXPECT_GT(closed, 0);
}

// Oracle: the ball about the origin cannot shrink when a contact is added.
TEST(WrenchSpace, GrowsWithContactsAndFriction) {
  std::vector<WrenchContact> contacts = tetrahedral(0.4);
  const double four = wrench_space(contacts, kRadius).epsilon;
  contacts.push_back({kRadius * Vec3::UnitZ(), -Vec3::UnitZ(), 0.4, 0});
  EXPECT_GE(wrench_space(contacts, kRadius).epsilon, four - 1e-12);
  EXPECT_GT(wrench_space(tetrahedral(0.8), kRadius).epsilon, four);
}

}  // namespace
}  // namespace handsim::simulation
