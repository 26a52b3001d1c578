// The point of a convex polyhedron's surface that is nearest to another, found by going over the surface from
// face to face. It costs the corners of a few faces, however many there are.
//
// Seen from outside, distance has no least value on the surface but the least of all: where no edge and no
// face that meets the nearest point of a face leads nearer, that point is the nearest. Space outside has a
// cell of planar sides for each feature (face, edge, corner) in which the nearest point lies on it.
#pragma once

#include <optional>
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

/// @param hint any face; one near the foot may save steps. Inside: a loop over all faces.
Foot nearest_foot(const model::ConvexMesh& mesh, const Vec3& p, int hint);

/// Where on a line a foot's feature is nearest, if that lies in its cell: share of the line's length.
std::optional<double> least_in_cell(const model::ConvexMesh& mesh, const Foot& foot, const Vec3& start,
                                    const Vec3& along);

/// The part of a line that lies in the cell of a foot's feature: shares of its length, 0 to 1.
std::pair<double, double> cell_of(const model::ConvexMesh& mesh, const Foot& foot, const Vec3& start,
                                  const Vec3& along);

/// A place on a line, as share of its length, and its foot.
struct LineFoot {
  double t = 0;
  Foot foot;
};

/// Edges of cells at which the foot leaves a face or comes to one, as shares of a line's length.
struct Bends {
  std::optional<double> inner;  ///< that of the nearest place's cell, if it is one
  std::optional<double> outer;  ///< the outermost within reach
  bool end_off = false;         ///< the line's end is further off than the reach
};

/// From the place where a line is nearest to its end (0 or 1). @param reach largest distance [m]
Bends bends_from(const model::ConvexMesh& mesh, const Vec3& start, const Vec3& along, const LineFoot& nearest,
                 double reach, bool forward);

}  // namespace handsim::engine
