#include "handsim/model/convex_mesh.h"

#include <random>
#include <set>

#include <gtest/gtest.h>

#include "engine/models.h"
#include "handsim/model/mass_properties.h"

namespace handsim::model {
namespace {

// Oracle: the pyramid over the square of edge 2 with height 1: volume 4/3, centroid at 1/4 of the height,
// which is not the mean of its corners, and second moments about it of 1/5, 1/5 and 3/80 per volume; under a
// linear map. Far from the origin, too: positions of 100 m have 1e-14 m.
TEST(ConvexMesh, OfAPyramidHasTheMassPropertiesOfItsLinearMap) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 100; ++trial) {
    Mat3 map;
    for (int k = 0; k < 3; ++k) map.col(k) = 0.1 * engine::test::random_vector(random);
    if (map.determinant() < 0) map.col(0) *= -1;
    if (map.determinant() < 1e-5) continue;
    const Vec3 far = 100 * engine::test::random_vector(random);
    std::vector<Vec3> corners;
    for (const Vec3& corner : {Vec3(-1, -1, 0), Vec3(1, -1, 0), Vec3(1, 1, 0), Vec3(-1, 1, 0), Vec3(0, 0, 1)})
      corners.push_back(far + map * corner);
    Vec3 centroid;
    const ConvexMesh mesh =
        make_convex_mesh(corners, {{0, 3, 2, 1}, {0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}}, centroid);
    const Vec3 want = far + 0.25 * map.col(2);
    EXPECT_NEAR(mesh.volume, 4.0 / 3 * map.determinant(), 1e-10 * mesh.volume);
    EXPECT_LT((centroid - want).norm(), 1e-12);
    const Mat3 spread = map * Vec3(0.2, 0.2, 3.0 / 80).asDiagonal() * map.transpose();
    const Mat3 inertia = spread.trace() * Mat3::Identity() - spread;
    EXPECT_LT((mesh.unit_inertia - inertia).norm(), 1e-10 * inertia.norm());
    for (std::size_t i = 0; i < corners.size(); ++i)
      EXPECT_LT((mesh.vertices[i] - (corners[i] - want)).norm(), 1e-12);
  }
}

/// That faces, planes and edges agree: planes hold their corners and have all others below; an edge has its
/// left face to the left of the way from its start, and its right face to the right.
void expect_sound(const ConvexMesh& mesh) {
  for (int face = 0; face < mesh.face_count(); ++face) {
    EXPECT_NEAR(mesh.normal(face).norm(), 1, 1e-14);
    for (const Vec3& vertex : mesh.vertices) EXPECT_LE(mesh.height(face, vertex), 1e-15);
    for (const unsigned corner : mesh.corners(face))
      EXPECT_NEAR(mesh.height(face, mesh.vertex(corner)), 0, 1e-15);
    EXPECT_LT(mesh.height(face, Vec3::Zero()), 0);
  }
  const auto middle = [&](int face) {
    Vec3 sum = Vec3::Zero();
    for (const unsigned corner : mesh.corners(face)) sum += mesh.vertex(corner);
    return Vec3(sum / static_cast<double>(mesh.corners(face).size()));
  };
  std::set<std::pair<int, int>> seen;
  for (const ConvexMesh::Edge& edge : mesh.edges) {
    EXPECT_TRUE(seen.insert(std::minmax(edge.from, edge.to)).second);
    const Vec3& from = mesh.vertices[as_index(edge.from)];
    const Vec3 way = mesh.vertices[as_index(edge.to)] - from;
    EXPECT_GT(mesh.normal(edge.left).cross(way).dot(middle(edge.left) - from), 0);
    EXPECT_LT(mesh.normal(edge.right).cross(way).dot(middle(edge.right) - from), 0);
    for (const int face : {edge.left, edge.right}) EXPECT_NEAR(mesh.height(face, from + way), 0, 1e-15);
  }
  // Euler's formula.
  EXPECT_EQ(mesh.vertices.size() + as_index(mesh.face_count()), mesh.edges.size() + 2);
}

// Oracle: formulas of a box, whose faces here are two triangles each, away from the origin.
TEST(ConvexMesh, OfTrianglesOfABoxIsTheBox) {
  const Vec3 edges(0.2, 0.5, 0.03), off(3, -2, 5);
  std::vector<Vec3> corners;
  for (int i = 0; i < 8; ++i)
    corners.push_back(off + Vec3(i & 1 ? edges.x() : 0, i & 2 ? edges.y() : 0, i & 4 ? edges.z() : 0));
  std::vector<std::vector<int>> triangles;
  const int quads[][4] = {{1, 3, 7, 5}, {0, 4, 6, 2}, {2, 6, 7, 3}, {0, 1, 5, 4}, {4, 5, 7, 6}, {0, 2, 3, 1}};
  for (const auto& [a, b, c, d] : quads) triangles.insert(triangles.end(), {{a, b, c}, {a, c, d}});
  Vec3 centroid;
  const ConvexMesh mesh = make_convex_mesh(corners, triangles, centroid);
  EXPECT_LT((centroid - off - 0.5 * edges).norm(), 1e-14);
  EXPECT_NEAR(mesh.volume, edges.prod(), 1e-16);
  EXPECT_LT((mesh.unit_inertia - Mat3((box_moments(edges) / 12).asDiagonal())).norm(), 1e-15);
  EXPECT_NEAR(mesh.reach, 0.5 * edges.norm(), 1e-15);
  EXPECT_EQ(mesh.edges.size(), 18U);
  expect_sound(mesh);
}

// Oracle: as above; the support of a box in closed form.
TEST(ConvexMesh, BoxPolyhedronIsTheBoxWithItsEdges) {
  const Vec3 edges(0.06, 0.02, 0.11);
  const ConvexMesh mesh = box_polyhedron(edges);
  EXPECT_NEAR(mesh.volume, edges.prod(), 1e-18);
  EXPECT_LT((mesh.unit_inertia - Mat3((box_moments(edges) / 12).asDiagonal())).norm(), 1e-17);
  EXPECT_EQ(mesh.face_count(), 6);
  EXPECT_EQ(mesh.edges.size(), 12U);
  expect_sound(mesh);
  std::mt19937 random(2);
  for (int trial = 0; trial < 50; ++trial) {
    const Vec3 n = engine::test::random_vector(random);
    EXPECT_NEAR(mesh.support(n), 0.5 * edges.dot(n.cwiseAbs()), 1e-16);
  }
}

}  // namespace
}  // namespace handsim::model
