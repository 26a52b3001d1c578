// Convex polyhedra as shapes, built once from a hull: vertices, faces, edges, mass of the uniform solid.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "handsim/core/index.h"
#include "handsim/core/pose.h"

namespace handsim::model {

/// A bounded convex polyhedron about its centroid. Its faces are planar polygons.
struct ConvexMesh {
  struct Edge {
    int from = 0, to = 0;     ///< vertices
    int left = 0, right = 0;  ///< faces left and right of it, seen from outside
  };

  std::vector<Vec3> vertices;           ///< [m]
  std::vector<Eigen::Vector4d> planes;  ///< of each face: unit outward normal n, and d of n . x = d [m]
  /// For each face: its number of vertices, then their indices counter-clockwise seen from outside.
  std::vector<unsigned> loops;
  std::vector<int> loop_starts;  ///< of each face: index of its number in `loops`
  std::vector<Edge> edges;
  /// As `loops`, of the edge from each corner to the next one of its face: the face, and where the face
  /// beside it has the same edge; -1 where none has.
  std::vector<int> owners, twins;
  /// Of the same edges the side plane of the face: unit n in its plane, out of it, and d of n . x = d [m].
  std::vector<Eigen::Vector4d> rims;
  static constexpr int kCells = 8;  ///< Along the edges of the cube of `pierced`.
  /// The face that a ray from the centroid leaves by, for the middles of the cells on the sides of a cube.
  std::vector<int> pierced;
  double volume = 0;                 ///< [m^3]
  Mat3 unit_inertia = Mat3::Zero();  ///< about the centroid, per mass [m^2]
  double reach = 0;                  ///< largest distance of a vertex from the centroid [m]
  double inner = 0;                  ///< radius of the largest sphere about the centroid that lies in it [m]

  int face_count() const { return static_cast<int>(planes.size()); }
  Vec3 normal(int face) const { return planes[as_index(face)].head<3>(); }
  /// Signed distance of a point from a face's plane, positive outside [m].
  double height(int face, const Vec3& point) const {
    return normal(face).dot(point) - planes[as_index(face)].w();
  }
  std::span<const unsigned> corners(int face) const {
    const auto start = as_index(loop_starts[as_index(face)]);
    return {&loops[start + 1], loops[start]};
  }
  const Vec3& vertex(unsigned index) const { return vertices[index]; }
  /// A face about where the ray from the centroid to a point leaves the solid.
  int face_towards(const Vec3& point) const;
  /// Largest n . x over the solid [m].
  double support(const Vec3& n) const;
};

/// A polyhedron of these vertices and faces, moved to its centroid, with edges and exact mass properties.
/// @param faces vertices of each, counter-clockwise seen from outside. Not checked: closed and convex.
/// @param centroid set to its position in the given coordinates.
ConvexMesh make_convex_mesh(std::vector<Vec3> vertices, const std::vector<std::vector<int>>& faces,
                            Vec3& centroid);

/// A box with these full edge lengths [m].
ConvexMesh box_polyhedron(const Vec3& edges);

}  // namespace handsim::model
