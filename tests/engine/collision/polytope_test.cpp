// Contact manifolds of convex meshes: against boxes, spheres and samples, and at rest.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "engine/models.h"
#include "handsim/engine/collision/narrow_phase.h"
#include "handsim/engine/collision/polytope.h"
#include "handsim/engine/collision/surface_walk.h"
#include "handsim/scene/read/mesh_file.h"

namespace handsim::engine {
namespace {

using model::ConvexMesh;
using model::Effect;
using model::ShapeKind;

ConvexMesh mesh_of(const std::vector<Vec3>& points) {
  const scene::Surface hull = scene::convex_hull(points);
  Vec3 centroid;
  return model::make_convex_mesh(hull.vertices, hull.faces, centroid);
}

ConvexMesh icosahedron(double circumradius) {
  const double golden = (1 + std::sqrt(5.0)) / 2;
  std::vector<Vec3> points;
  for (const double a : {-1.0, 1.0})
    for (const double b : {-golden, golden}) {
      points.emplace_back(0, a, b);
      points.emplace_back(a, b, 0);
      points.emplace_back(b, 0, a);
    }
  for (Vec3& point : points) point *= circumradius / std::hypot(1, golden);
  return mesh_of(points);
}

model::Shape mesh_shape(const std::string& name, ConvexMesh mesh) {
  model::Shape shape = test::shape(name, ShapeKind::convex_mesh, 0);
  shape.mesh = std::make_shared<const ConvexMesh>(std::move(mesh));
  return shape;
}

double depth_of(const Manifold& found) {
  double most = 0;
  for (int i = 0; i < found.count; ++i)
    most = std::max(most, found.points[static_cast<std::size_t>(i)].depth);
  return most;
}

// Oracle: closed forms of the regular icosahedron (Coxeter): 20 faces, 30 edges, V = 5/12 (3 + sqrt 5) a^3, I
// = (3 + sqrt 5) / 20 m a^2.
TEST(ConvexMesh, HasTheMassPropertiesOfTheIcosahedron) {
  const ConvexMesh mesh = icosahedron(1);
  const double edge = 1 / std::sin(2 * M_PI / 5);
  EXPECT_EQ(mesh.face_count(), 20);
  EXPECT_EQ(mesh.edges.size(), 30U);
  EXPECT_EQ(mesh.vertices.size(), 12U);
  EXPECT_NEAR(mesh.volume, 5.0 / 12 * (3 + std::sqrt(5.0)) * edge * edge * edge, 1e-12);
  const double inertia = (3 + std::sqrt(5.0)) / 20 * edge * edge;
  EXPECT_LT((mesh.unit_inertia - inertia * Mat3::Identity()).norm(), 1e-12);
}

// Oracle: the closed form of a box, wherever it lies; its hull's triangles are merged into six faces.
TEST(ConvexMesh, OfABoxesCornersIsTheBox) {
  const Vec3 edges(0.2, 0.5, 0.03);
  const Pose at{Vec3(3, -2, 5), rotation_quaternion({0.3, 0.7, -0.2})};
  std::vector<Vec3> points;
  for (int i = 0; i < 8; ++i)
    points.push_back(at *
                     Vec3(0.5 * edges.cwiseProduct(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1))));
  const scene::Surface hull = scene::convex_hull(points);
  Vec3 centroid;
  const ConvexMesh mesh = model::make_convex_mesh(hull.vertices, hull.faces, centroid);
  EXPECT_EQ(mesh.face_count(), 6);
  EXPECT_EQ(mesh.edges.size(), 12U);
  EXPECT_LT((centroid - at.p).norm(), 1e-12);
  EXPECT_NEAR(mesh.volume, edges.prod(), 1e-14);
  const Vec3 e2 = edges.cwiseAbs2() / 12;
  const Mat3 R = at.q.toRotationMatrix();
  const Mat3 inertia =
      R * Vec3(e2.y() + e2.z(), e2.z() + e2.x(), e2.x() + e2.y()).asDiagonal() * R.transpose();
  EXPECT_LT((mesh.unit_inertia - inertia).norm(), 1e-14);
}

// Oracle: another way to the same figure; a box as a mesh against the box by its own formulas.
TEST(CapsuleOnMesh, IsTheCapsuleOnTheBoxOfTheSameForm) {
  std::mt19937 random(11);
  const Vec3 edges(0.05, 0.03, 0.02);
  const ConvexMesh mesh = model::box_polyhedron(edges);
  int touching = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const CapsuleAt capsule{test::random_pose(random, 0.06), 0.008, 0.04};
    const Pose box = test::random_pose(random, 0.01);
    const Manifold by_mesh = capsule_on_mesh(capsule, box, mesh);
    const Manifold by_box = capsule_on_box(capsule, box, edges);
    ASSERT_EQ(by_mesh.count > 0, by_box.count > 0) << trial;
    // Shallow ones: with its axis inside, a capsule has several ways out.
    if (by_box.count == 0 || depth_of(by_box) > 0.008) continue;
    ++touching;
    ASSERT_NEAR(depth_of(by_mesh), depth_of(by_box), 1e-8) << trial;
  }
  EXPECT_GT(touching, 200);
}

/// Hulls of 8 to 432 corners: round, flat and long ones, with faces of many corners and of few.
std::vector<ConvexMesh> some_hulls(std::mt19937& random) {
  std::vector<ConvexMesh> out = {icosahedron(0.03), model::box_polyhedron({0.05, 0.03, 0.02})};
  for (const Vec3& size : {Vec3(0.03, 0.03, 0.03), Vec3(0.05, 0.04, 0.004), Vec3(0.004, 0.004, 0.06)})
    for (const int count : {8, 60, 400}) {
      std::vector<Vec3> points;
      for (int i = 0; i < count; ++i)
        points.emplace_back(test::random_vector(random).normalized().cwiseProduct(size));
      out.push_back(mesh_of(points));
    }
  for (const int around : {5, 48, 216}) {
    std::vector<Vec3> points;
    for (int i = 0; i < around; ++i)
      for (const double z : {-0.04, 0.04})
        points.emplace_back(0.02 * std::cos(2 * M_PI * i / around), 0.02 * std::sin(2 * M_PI * i / around),
                            z);
    out.push_back(mesh_of(points));
  }
  return out;
}

/// Distance from a mesh by a loop over all faces: the highest of those below, the nearest of those above. By
/// numbers alone, since tests are compiled without optimisation and this is most of their time.
std::pair<double, Vec3> distance_over_all(const ConvexMesh& mesh, const Vec3& point) {
  std::pair<double, Vec3> nearest{1, {}};
  double highest = -1;
  int below = 0;
  const double* p = point.data();
  for (int f = 0; f < mesh.face_count(); ++f) {
    const double* n = mesh.planes[static_cast<std::size_t>(f)].data();
    const double height = n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - n[3];
    if (f == 0 || height > highest) highest = height, below = f;
    // A face is no nearer than its plane.
    if (height <= 0 || height >= nearest.first) continue;
    bool above = true;
    const auto corners = mesh.corners(f);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const double* a = mesh.vertex(corners[i]).data();
      const double* b = mesh.vertex(corners[i + 1 < corners.size() ? i + 1 : 0]).data();
      const double s[] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]},
                   r[] = {p[0] - a[0], p[1] - a[1], p[2] - a[2]};
      // r . (s x n)
      if (r[0] * (s[1] * n[2] - s[2] * n[1]) + r[1] * (s[2] * n[0] - s[0] * n[2]) +
              r[2] * (s[0] * n[1] - s[1] * n[0]) <=
          0)
        continue;
      above = false;
      const double along =
          (r[0] * s[0] + r[1] * s[1] + r[2] * s[2]) / (s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
      const double t = std::clamp(along, 0.0, 1.0);
      const double away[] = {r[0] - t * s[0], r[1] - t * s[1], r[2] - t * s[2]};
      const double distance = std::sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2]);
      if (distance < nearest.first) nearest = {distance, Vec3(away[0], away[1], away[2]) / distance};
    }
    if (above && height < nearest.first) nearest = {height, mesh.normal(f)};
  }
  return highest <= 0 ? std::pair(highest, mesh.normal(below)) : nearest;
}

// Oracle: the loop over all faces.
TEST(NearestFoot, IsTheNearestOfAllFacesFromAnyFaceOn) {
  std::mt19937 random(17);
  for (const ConvexMesh& mesh : some_hulls(random)) {
    EXPECT_EQ(std::ranges::count(mesh.twins, -1), mesh.face_count());  // the numbers of corners have none
    std::uniform_int_distribution<int> any(0, mesh.face_count() - 1);
    int inside = 0;
    for (int trial = 0; trial < 2000; ++trial) {
      const Vec3 p = (trial % 2 == 0 ? 0.04 : 0.015) * test::random_vector(random);
      const auto [distance, normal] = distance_over_all(mesh, p);
      const Foot foot = nearest_foot(mesh, p, any(random));
      ASSERT_NEAR(foot.distance, distance, 1e-14) << trial << " of " << mesh.face_count();
      ASSERT_NEAR((foot.at + foot.distance * foot.normal - p).norm(), 0, 1e-14);
      if (std::abs(distance) > 1e-6) {
        ASSERT_LT((foot.normal - normal).norm(), 1e-7);
      }
      if (distance < 0) ++inside;
    }
    EXPECT_LT(inside, 1999);
  }
}

// Oracle: loops over all faces; along the capsule the least distance by golden section, and the outermost of
// the ends and of the places where its segment enters or leaves the space above a face.
TEST(CapsuleOnMesh, HasTheDeepestPointAndTheOutermostOfAllFaces) {
  std::mt19937 random(19);
  for (const ConvexMesh& mesh : some_hulls(random)) {
    int touching = 0, lines = 0;
    for (int trial = 0; trial < 400 && !(touching > 20 && lines > 4); ++trial) {
      const CapsuleAt capsule{test::random_pose(random, 0.036), 0.008, 0.04};
      const auto along = [&](double t) -> Vec3 {
        return capsule.pose * Vec3(0, 0, capsule.length * (t - 0.5));
      };
      const auto distance = [&](double t) { return distance_over_all(mesh, along(t)).first; };
      // No point of the segment is further from its middle than half its length.
      if (distance(0.5) > capsule.radius + capsule.length / 2) {
        ASSERT_EQ(capsule_on_mesh(capsule, {}, mesh).count, 0) << trial;
        continue;
      }
      double low = 0, high = 1;
      constexpr double kGolden = 0.6180339887498949;
      double first = 1 - kGolden, second = kGolden;
      double at_first = distance(first), at_second = distance(second);
      while (high - low > 1e-11) {
        if (at_first < at_second) {
          high = second, second = first, at_second = at_first;
          first = high - kGolden * (high - low), at_first = distance(first);
        } else {
          low = first, first = second, at_first = at_second;
          second = low + kGolden * (high - low), at_second = distance(second);
        }
      }
      const double best = distance(low) < distance(0) ? (distance(low) < distance(1) ? low : 1)
                          : distance(0) < distance(1) ? 0
                                                      : 1;
      const double least = distance(best);
      const Manifold found = capsule_on_mesh(capsule, {}, mesh);
      ASSERT_EQ(found.count > 0, least < capsule.radius) << trial;
      if (found.count == 0 || least <= 1e-6) continue;
      ++touching;
      // A bend that is as deep but for a millionth of the radius stands for the deepest point.
      ASSERT_NEAR(depth_of(found), capsule.radius - least, 1e-6 * capsule.radius) << trial;
      std::vector<double> bends = {0, 1};
      for (int f = 0; f < mesh.face_count(); ++f) {
        double enter = 0, leave = 1;
        const auto corners = mesh.corners(f);
        for (std::size_t i = 0; i < corners.size(); ++i) {
          const Vec3 a = mesh.vertex(corners[i]);
          const Vec3 out = (mesh.vertex(corners[(i + 1) % corners.size()]) - a).cross(mesh.normal(f));
          const double start = out.dot(along(0) - a), rise = out.dot(along(1) - along(0));
          if (rise > 0) leave = std::min(leave, -start / rise);
          if (rise < 0) enter = std::max(enter, -start / rise);
        }
        for (const double t : {enter, leave})
          if (enter < leave && mesh.height(f, along(t)) > 0) bends.push_back(t);
      }
      for (const double sign : {-1.0, 1.0}) {
        double outermost = best;
        for (const double t : bends)
          if (sign * (t - outermost) > 0 && distance(t) < capsule.radius - 1e-9) outermost = t;
        if (sign * (outermost - best) * capsule.length < 0.1 * capsule.radius) continue;
        ++lines;
        double nearest = 1;
        for (int i = 0; i < found.count; ++i) {
          const ManifoldPoint& point = found.points[static_cast<std::size_t>(i)];
          const Vec3 centre = point.position + (capsule.radius - 0.5 * point.depth) * point.normal;
          nearest = std::min(nearest, (centre - along(outermost)).norm());
        }
        ASSERT_LT(nearest, 1e-9) << trial << " of " << mesh.face_count();
      }
    }
    EXPECT_GT(touching, 20);
    EXPECT_GT(lines, 4);
  }
}

// Oracle: geometry; both ends of the line of rest, whatever rounding tilts the capsule by.
TEST(CapsuleOnMesh, LiesOnBothEndsOfItsLineOfRest) {
  const ConvexMesh mesh = icosahedron(0.03);
  // A face up.
  const Quat up = Quat::FromTwoVectors(mesh.normal(0), Vec3::UnitZ());
  const double inradius = mesh.planes[0].w();
  for (const double tilt : {0.0, 1e-12, -1e-9, 1e-6}) {
    CapsuleAt capsule{
        {Vec3(0, 0, inradius + 0.008 - 1e-5), rotation_quaternion({0, M_PI / 2 + tilt, 0})}, 0.008, 0.1};
    const Manifold found = capsule_on_mesh(capsule, {Vec3::Zero(), up}, mesh);
    ASSERT_EQ(found.count, 2) << tilt;
    EXPECT_GT((found.points[0].position - found.points[1].position).norm(), 0.015);
    for (int i = 0; i < 2; ++i)
      EXPECT_NEAR(found.points[static_cast<std::size_t>(i)].depth, 1e-5, 0.05 * std::abs(tilt) + 1e-9);
  }
}

// Oracle: distance of a point from a convex body by alternating projections onto its half-spaces (Dykstra),
// which knows nothing of faces and edges.
TEST(SphereOnMesh, HasTheDepthOfItsDistance) {
  std::mt19937 random(5);
  const ConvexMesh mesh = icosahedron(0.03);
  model::Model model = model::make_model();
  model.shapes = {test::shape("ball", ShapeKind::sphere, 0), mesh_shape("mesh", mesh)};
  model.shapes[0].radius = 0.01;
  const NarrowPhase narrow(model);
  int touching = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Vec3 p = 0.045 * test::random_vector(random);
    std::vector<Vec3> corrections(mesh.planes.size(), Vec3::Zero());
    Vec3 x = p;
    double moved = 1;
    for (int sweep = 0; sweep < 400 && moved > 1e-14; ++sweep) {
      moved = 0;
      for (int f = 0; f < mesh.face_count(); ++f) {
        Vec3& correction = corrections[static_cast<std::size_t>(f)];
        const Vec3 y = x + correction;
        x = y - std::max(0.0, mesh.height(f, y)) * mesh.normal(f);
        moved += (y - x - correction).norm();
        correction = y - x;
      }
    }
    const double distance = (p - x).norm();
    if (distance < 1e-4) continue;
    const Manifold found = *narrow.manifold(0, {p, Quat::Identity()}, 1, {});
    ASSERT_EQ(found.count, distance < 0.01 ? 1 : 0) << distance;
    if (found.count == 0) continue;
    ++touching;
    EXPECT_NEAR(found.points[0].depth, 0.01 - distance, 1e-7);
    EXPECT_LT((found.points[0].normal - (p - x) / distance).norm(), 1e-3);
  }
  EXPECT_GT(touching, 100);
}

// Oracle: the definition of penetration depth; moved apart by it along the normal the two just touch, and
// moved by less they still overlap.
TEST(MeshOnMesh, PartsWhenMovedByItsDepth) {
  std::mt19937 random(3);
  const ConvexMesh a = icosahedron(0.03);
  const ConvexMesh b = model::box_polyhedron({0.05, 0.03, 0.02});
  int touching = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    Pose x_WA = test::random_pose(random, 0.03);
    const Pose x_WB = test::random_pose(random, 0.03);
    const Manifold found = mesh_on_mesh(a, x_WA, b, x_WB);
    if (found.count == 0) continue;
    ++touching;
    const double depth = depth_of(found);
    const Vec3 n = found.points[0].normal;
    const Vec3 start = x_WA.p;
    x_WA.p = start + 1.0002 * depth * n + 1e-5 * n;
    ASSERT_EQ(mesh_on_mesh(a, x_WA, b, x_WB).count, 0) << trial;
    x_WA.p = start + (0.97 * depth - 1e-5) * n;
    if (depth > 1e-4) {
      ASSERT_GT(mesh_on_mesh(a, x_WA, b, x_WB).count, 0) << trial;
    }
    // Newton's third law of geometry: turned round, the same points.
    x_WA.p = start;
    const Manifold turned = mesh_on_mesh(b, x_WB, a, x_WA);
    ASSERT_NEAR(depth_of(turned), depth, 2e-4 * 0.03) << trial;
  }
  EXPECT_GT(touching, 500);
}

/// A mesh dropped flat from 1 cm onto a plane (`on` plane) or a still solid of the same world.
model::Model dropped(ShapeKind on) {
  model::Model model = model::make_model();
  model.groups = {{"all"}};
  model.contact_rules = {{}};
  model.materials = {test::material("rubber", 0.8)};
  const ConvexMesh mesh = icosahedron(0.03);
  const double inradius = mesh.planes[0].w();
  model::Shape floor = test::shape("floor", on, 0);
  if (on == ShapeKind::box) floor.edges = Vec3(0.3, 0.3, 0.02), floor.pose.p.z() = -0.01;
  if (on == ShapeKind::convex_mesh) {
    floor = mesh_shape("floor", model::box_polyhedron({0.3, 0.3, 0.02}));
    floor.pose.p.z() = -0.01;
  }
  model.shapes.push_back(floor);
  const Mat3 inertia = 0.1 * mesh.unit_inertia;
  test::add_body(
      model, test::body("stone", 0.1, inertia.diagonal(),
                        {Vec3(0, 0, inradius + 0.01), Quat::FromTwoVectors(mesh.normal(0), -Vec3::UnitZ())}));
  model::Shape stone = mesh_shape("stone", mesh);
  stone.body = 1;
  model.shapes.push_back(stone);
  return model;
}

// Oracle: free fall in closed form up to the touch, as for a sphere of the insphere's radius; then statics on
// three points, at the inradius but for the layer that contacts keep.
TEST(Icosahedron, FallsAndRestsLikeTheSphereInIt) {
  for (const ShapeKind on : {ShapeKind::plane, ShapeKind::box, ShapeKind::convex_mesh}) {
    const model::Model model = dropped(on);
    const double inradius = model.shapes[1].mesh->planes[0].w();
    Settings how = test::settings({Effect::gravity, Effect::object_contact, Effect::friction});
    how.contact_forces = true;
    const auto engine = make_engine(model, how);
    const model::BodyState& stone = engine->state().bodies[1];
    const double fall = std::sqrt(2 * 0.01 / 9.80665);
    while (engine->state().time < fall - 2e-3) engine->step({});
    // Semi-implicit Euler falls g t h / 2 further than the parabola.
    const double t = engine->state().time;
    EXPECT_NEAR(stone.p.z(), inradius + 0.01 - 0.5 * 9.80665 * t * (t + 1e-3), 1e-12);
    test::run(*engine, 1500);
    double fastest = 0;
    Vec3 force = Vec3::Zero();
    for (int i = 0; i < 500; ++i) {
      engine->step({});
      fastest = std::max(fastest, stone.v.norm());
    }
    for (const Contact& contact : engine->contacts())
      force += contact.shape_a == 1 ? contact.force : Vec3(-contact.force);
    EXPECT_EQ(engine->contacts().size(), 3U);
    EXPECT_NEAR(stone.p.z(), inradius - 1e-5, 1e-5);
    EXPECT_LT(fastest, 1e-6) << "on " << static_cast<int>(on);
    EXPECT_NEAR(force.z(), 0.1 * 9.80665, 1e-3 * 0.1 * 9.80665);
  }
}

// Oracle: statics; a finger-sized capsule across an icosahedron's upper face, and one on a mesh cylinder pair
// that ODE tests itself, stay finite.
TEST(RestingCapsule, StaysStillOnAMesh) {
  model::Model model = model::make_model();
  model.groups = {{"all"}};
  model.contact_rules = {{}};
  model.materials = {test::material("rubber", 0.8)};
  const ConvexMesh mesh = icosahedron(0.03);
  model::Shape stone = mesh_shape("stone", mesh);
  stone.pose.q = Quat::FromTwoVectors(mesh.normal(0), Vec3::UnitZ());
  model.shapes.push_back(stone);
  test::add_body(model,
                 test::body("finger", 0.01, {2e-6, 2e-6, 3e-7},
                            {Vec3(0, 0, mesh.planes[0].w() + 0.008),
                             rotation_quaternion({0, 0, 0.3}) * rotation_quaternion({0, M_PI / 2, 0})}));
  model::Shape finger = test::shape("finger", ShapeKind::capsule, 1);
  finger.radius = 0.008;
  finger.length = 0.04;
  model.shapes.push_back(finger);
  const auto engine =
      make_engine(model, test::settings({Effect::gravity, Effect::object_contact, Effect::friction}));
  test::run(*engine, 1000);
  double square = 0;
  for (int i = 0; i < 3000; ++i) {
    engine->step({});
    square += engine->state().bodies[1].v.squaredNorm();
  }
  EXPECT_LT(std::sqrt(square / 3000), 1e-5);
  EXPECT_EQ(engine->contacts().size(), 2U);
}

}  // namespace
}  // namespace handsim::engine
