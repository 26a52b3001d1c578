// Convex polyhedra as shapes: corners, flat faces and edges, and what a uniform solid of that form weighs.
// Made once, by whoever knows a hull (scene/read/convex_hull.h), and shared.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "handsim/core/pose.h"

namespace handsim::model {

/// A bounded convex polyhedron about its centroid. Faces are flat polygons with the solid below.
struct ConvexMesh {
  struct Edge {
    int from = 0, to = 0;     ///< vertices
    int left = 0, right = 0;  ///< faces; seen from outside the edge runs with `left` on its left
  };

  std::vector<Vec3> vertices;           ///< [m]
  std::vector<Eigen::Vector4d> planes;  ///< of each face: unit outward normal n, and d of n . x = d [m]
  /// Of each face: number of its corners, then these counter-clockwise seen from outside, face after face.
  std::vector<unsigned> loops;
  std::vector<int> loop_starts;  ///< of each face: where its number stands in `loops`
  std::vector<Edge> edges;
  double volume = 0;                 ///< [m^3]
  Mat3 unit_inertia = Mat3::Zero();  ///< about the centroid, per mass [m^2]
  double reach = 0;                  ///< largest distance of a vertex from the centroid [m]

  int face_count() const { return static_cast<int>(planes.size()); }
  Vec3 normal(int face) const { return planes[static_cast<std::size_t>(face)].head<3>(); }
  /// Of a point above a face's plane [m].
  double height(int face, const Vec3& point) const {
    return normal(face).dot(point) - planes[static_cast<std::size_t>(face)].w();
  }
  std::span<const unsigned> corners(int face) const {
    const auto start = static_cast<std::size_t>(loop_starts[static_cast<std::size_t>(face)]);
    return {&loops[start + 1], loops[start]};
  }
  const Vec3& vertex(unsigned index) const { return vertices[index]; }
  /// Largest n . x over the solid [m].
  double support(const Vec3& n) const;
};

/// A polyhedron of these corners and faces, moved to its centroid, with edges and mass properties by exact
/// integrals over the tetrahedra that its faces make with a point inside.
/// @param faces corners of each, counter-clockwise seen from outside; closed and convex: not checked.
/// @param centroid set to where it lay in the given coordinates.
ConvexMesh make_convex_mesh(std::vector<Vec3> vertices, const std::vector<std::vector<int>>& faces,
                            Vec3& centroid);

/// A box of these full edges.
ConvexMesh box_polyhedron(const Vec3& edges);

}  // namespace handsim::model
