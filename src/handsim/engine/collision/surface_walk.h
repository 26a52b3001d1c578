// The point of a convex polyhedron's surface that is nearest to another, found by going over the surface from
// face to face. It costs the corners of a few faces, however many there are.
//
// Seen from outside, distance has no least value on the surface but the least of all: where no edge and no
// face that meets the nearest point of a face leads nearer, that point is the nearest. Space outside has a
// cell of planar sides for each feature (face, edge, corner) in which the nearest point lies on it.
#pragma once

#include <utility>

#include "handsim/model/convex_mesh.h"

namespace handsim::engine {

struct Foot {
  double distance = 0;          ///< of the point from the surface, negative inside [m]
  Vec3 normal = Vec3::UnitZ();  ///< the way out of the solid there
  Vec3 at = Vec3::Zero();       ///< the nearest point
  int face = 0;                 ///< it lies on this face
  int edge = -1;                ///< and on this edge, as index of `loops`, or -1
  bool corner = false;          ///< the edge's start
};

/// @param hint any face; one near the foot saves steps. Inside: a loop over all faces.
Foot nearest_foot(const model::ConvexMesh& mesh, const Vec3& p, int hint);

/// The part of a line that lies in the cell of a foot's feature: shares of its length, 0 to 1.
std::pair<double, double> cell_of(const model::ConvexMesh& mesh, const Foot& foot, const Vec3& start,
                                  const Vec3& along);

}  // namespace handsim::engine
