// Contact manifolds of convex meshes on each other, on boxes and on planes, for any engine.
#pragma once

#include "handsim/engine/collision/manifold.h"

namespace handsim::engine {

/// Two polyhedra by their separating axis of least penetration (faces of both, pairs of edges that can meet;
/// D. Gregorius, The Separating Axis Test between Convex Polyhedra, GDC 2013): where a face is nearest, the
/// other's most opposed face clipped to it, four points at most; where two edges are, their nearest points.
/// Normals out of b into a. @param pad compliant surfaces: faces stand for the contact unless edges are much
/// nearer; an edge along a face would flip between one point and two.
Manifold mesh_on_mesh(const model::ConvexMesh& a, const Pose& x_WA, const model::ConvexMesh& b,
                      const Pose& x_WB, bool pad = false);

/// The corners below a plane (z = 0 of x_WP, the solid below), four at most. Normals out of the plane.
Manifold mesh_on_plane(const model::ConvexMesh& mesh, const Pose& x_WS, const Pose& x_WP);

}  // namespace handsim::engine
