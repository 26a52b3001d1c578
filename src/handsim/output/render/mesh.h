// Triangle meshes of unit solids. A vertex has a point of the core and a normal; the shader places it at
// core * half + round * normal, so one mesh serves all sizes of its kind and roundings stay circular.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "handsim/model/convex_mesh.h"

namespace handsim::output {

struct Vertex {
  Eigen::Vector3f core;    ///< in units of the core's half extents, each -1..1
  Eigen::Vector3f normal;  ///< unit, outward
  float finger = 0;        ///< of skin: beyond 0.3 it has the finger's colour
};

/// Triangles, counter-clockwise seen from outside.
struct Mesh {
  std::vector<Vertex> vertices;
  std::vector<std::uint32_t> indices;
};

/// Core: the segment z = -1..1 (with half height 0: a sphere). `sides`: of its circles.
Mesh capsule_mesh(int sides);
/// Core: the cube of edge 2.
Mesh box_mesh();
/// Core: the cylinder of radius 1, z = -1..1.
Mesh cylinder_mesh(int sides);
/// The faces of a polyhedron, flat; `half` must be (1, 1, 1) and `round` 0.
Mesh faceted_mesh(const model::ConvexMesh& polyhedron);
/// A cone: base circle of radius 1 at z = 0, tip at z = 1, normals for a scale (1, 1, length); `round` is 0.
Mesh cone_mesh(float length);
/// The flat ring between the circles of radius `inner` and 1 at z = 0, seen from above; `round` must be 0.
Mesh ring_mesh(float inner);

}  // namespace handsim::output
