// Contact manifolds of capsules, against the least distance along the capsule.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

#include "engine/models.h"
#include "handsim/engine/collision/manifold.h"
#include "handsim/engine/collision/ode_library.h"

namespace handsim::engine {
namespace {

double box_distance(const Vec3& p, const Vec3& half) {
  const Vec3 beyond = p.cwiseAbs() - half;
  return beyond.maxCoeff() <= 0 ? beyond.maxCoeff() : beyond.cwiseMax(0.0).norm();
}

double cylinder_distance(const Vec3& p, double radius, double half) {
  const double side = std::hypot(p.x(), p.y()) - radius;
  const double end = std::abs(p.z()) - half;
  return side <= 0 && end <= 0 ? std::max(side, end) : std::hypot(std::max(side, 0.0), std::max(end, 0.0));
}

/// Greatest penetration of a capsule into a convex solid: the signed distance is convex along its segment,
/// whose least value is closed in on by thirds.
template <class Distance>
double searched_depth(const CapsuleAt& capsule, const Pose& solid, const Distance& distance) {
  const auto at = [&](double z) { return distance(solid.inverse() * (capsule.pose * Vec3(0, 0, z))); };
  double low = -capsule.length / 2, high = capsule.length / 2;
  for (int i = 0; i < 80; ++i) {
    const double third = (high - low) / 3;
    if (at(low + third) < at(high - third))
      high -= third;
    else
      low += third;
  }
  return capsule.radius - std::min({at(low), at(-capsule.length / 2), at(capsule.length / 2)});
}

template <class Make, class Distance>
void check_random(const Make& make, const Distance& distance) {
  std::mt19937 random(7);
  int touching = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    CapsuleAt capsule;
    capsule.pose = test::random_pose(random, 0.06);
    capsule.radius = 0.008;
    capsule.length = 0.04;
    const Pose solid = test::random_pose(random, 0.01);
    const Manifold found = make(capsule, solid);
    const double depth = searched_depth(capsule, solid, distance);
    double deepest = 0;
    for (int i = 0; i < found.count; ++i) {
      const ManifoldPoint& point = found.points[static_cast<std::size_t>(i)];
      deepest = std::max(deepest, point.depth);
      ASSERT_GT(point.depth, 0);
      ASSERT_NEAR(point.normal.norm(), 1, 1e-12);
      // The point lies midway between the surfaces: half the depth along the normal to the solid's.
      const Vec3 on_solid = point.position + 0.5 * point.depth * point.normal;
      ASSERT_NEAR(distance(solid.inverse() * on_solid), 0, 1e-9) << trial;
    }
    if (depth > 1e-7) ++touching;
    ASSERT_NEAR(deepest, std::max(depth, 0.0), 1e-9) << trial;
  }
  EXPECT_GT(touching, 300);
}

// Oracle: the definition of depth; shallow contacts only (a capsule whose axis is inside has no one
// way out).
TEST(CapsuleOnBox, FindsTheDeepestPointOfAnyPlacement) {
  const Vec3 edges(0.05, 0.03, 0.02);
  check_random(
      [&](const CapsuleAt& capsule, const Pose& box) {
        const Manifold found = capsule_on_box(capsule, box, edges);
        return found;
      },
      [&](const Vec3& p) { return box_distance(p, 0.5 * edges); });
}

TEST(CapsuleOnCylinder, FindsTheDeepestPointOfAnyPlacement) {
  check_random([&](const CapsuleAt& capsule,
                   const Pose& cylinder) { return capsule_on_cylinder(capsule, cylinder, 0.015, 0.04); },
               [&](const Vec3& p) { return cylinder_distance(p, 0.015, 0.02); });
}

// Oracle: geometry; both ends of the line of rest, whatever rounding tilts the capsule by.
TEST(CapsuleOnBox, LiesOnBothEndsOfItsLineOfRest) {
  for (const double tilt : {0.0, 1e-12, -1e-9, 1e-6}) {
    CapsuleAt capsule;
    capsule.pose.p = Vec3(0.004, 0, 0.01 + 0.008 - 1e-5);
    capsule.pose.q = rotation_quaternion({0, M_PI / 2 + tilt, 0});
    capsule.radius = 0.008;
    capsule.length = 0.04;
    const Manifold found = capsule_on_box(capsule, {}, Vec3(0.03, 0.03, 0.02));
    ASSERT_EQ(found.count, 2) << tilt;
    // The capsule's segment reaches from -16 to 24 mm, the face from -15 to 15 mm.
    EXPECT_NEAR(found.points[0].position.x() + found.points[1].position.x(), 0, 1e-6);
    EXPECT_NEAR(std::abs(found.points[0].position.x()), 0.015, 1e-6);
    for (int i = 0; i < 2; ++i)
      EXPECT_NEAR(found.points[static_cast<std::size_t>(i)].depth, 1e-5, 0.03 * std::abs(tilt) + 1e-9);
  }
}

TEST(CapsuleOnCylinder, LiesAlongItOnTwoPointsAndAcrossItOnOne) {
  CapsuleAt capsule;
  capsule.radius = 0.008;
  capsule.length = 0.04;
  capsule.pose.p = Vec3(0.0229, 0, 0.01);
  EXPECT_EQ(capsule_on_cylinder(capsule, {}, 0.015, 0.04).count, 2);
  capsule.pose.q = rotation_quaternion({M_PI / 2, 0, 0});
  const Manifold across = capsule_on_cylinder(capsule, {}, 0.015, 0.04);
  ASSERT_EQ(across.count, 1);
  EXPECT_NEAR(across.points[0].depth, 1e-4, 1e-12);
  EXPECT_LT((across.points[0].normal - Vec3::UnitX()).norm(), 1e-6);
}

double deepest(const Manifold& m) {
  double most = 0;
  for (int i = 0; i < m.count; ++i) most = std::max(most, m.points[static_cast<std::size_t>(i)].depth);
  return most;
}

/// How far a manifold reaches along x beyond the points that are shallower than `depth`.
std::pair<double, double> reach(const Manifold& m, double depth) {
  std::pair<double, double> out{1, -1};
  for (int i = 0; i < m.count; ++i) {
    const ManifoldPoint& point = m.points[static_cast<std::size_t>(i)];
    if (point.depth < depth) continue;
    out.first = std::min(out.first, point.position.x());
    out.second = std::max(out.second, point.position.x());
  }
  return out;
}

// Oracle: continuity; a capsule rolled and slid in small steps changes its deepest point's depth by no more
// than it moves, and no point that is not shallow comes or goes.
TEST(CapsuleOnBox, ChangesContinuously) {
  CapsuleAt capsule;
  capsule.radius = 0.008;
  capsule.length = 0.04;
  Manifold before;
  for (int i = 0; i <= 40000; ++i) {
    const double s = i / 40000.0;
    capsule.pose.p = Vec3(-0.05 + 0.1 * s, 0.003, 0.0175);
    capsule.pose.q = rotation_quaternion({0, 1.2 + 0.7 * s, 0.2});
    const Manifold now = capsule_on_box(capsule, {}, Vec3(0.05, 0.03, 0.02));
    if (i > 0) {
      ASSERT_NEAR(deepest(before), deepest(now), 5e-6) << i;
      // Points come and go at no depth, or where another one is within 2 % of the radius.
      const auto old_reach = reach(before, 1e-5);
      const auto all = reach(now, 0);
      ASSERT_LT(all.first, old_reach.first + 2e-4) << i;
      ASSERT_GT(all.second, old_reach.second - 2e-4) << i;
    }
    before = now;
  }
}

// Oracle: ODE's own point, to the bit; the sphere beside, beyond the ends and on the axis.
TEST(CapsuleOnSphere, IsOdesOwnPoint) {
  enter_ode();
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  model::Shape capsule, sphere;
  capsule.kind = model::ShapeKind::capsule;
  sphere.kind = model::ShapeKind::sphere;
  capsule.radius = 0.008;
  capsule.length = 0.03;
  sphere.radius = 0.02;
  const std::unique_ptr<dxGeom, Destroyer<dGeomDestroy>> a(make_geom(nullptr, capsule, 0)),
      b(make_geom(nullptr, sphere, 1));
  int touching = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    Pose at{{normal(random), normal(random), normal(random)}, Quat::Identity()};
    Vec3 centre = at.p;
    if (trial > 0) {
      at.q = Quat(normal(random), normal(random), normal(random), normal(random)).normalized();
      centre += 0.02 * Vec3(normal(random), normal(random), normal(random));
    }
    place_shape(a.get(), capsule, at);
    place_shape(b.get(), sphere, {centre, Quat::Identity()});
    dContactGeom point;
    const int count = dCollide(a.get(), b.get(), 1, &point, sizeof point);
    const auto found = capsule_on_sphere({at, capsule.radius, capsule.length}, centre, sphere.radius);
    ASSERT_EQ(found.has_value(), count == 1) << trial;
    if (!found) continue;
    ++touching;
    EXPECT_EQ(found->position, Vec3(point.pos[0], point.pos[1], point.pos[2])) << trial;
    EXPECT_EQ(found->normal, Vec3(point.normal[0], point.normal[1], point.normal[2])) << trial;
    EXPECT_EQ(found->depth, point.depth) << trial;
  }
  EXPECT_GT(touching, 100);
}

}  // namespace
}  // namespace handsim::engine
