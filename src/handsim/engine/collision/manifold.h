// Contact manifolds of capsules on boxes, cylinders and convex meshes, for any engine. ODE gives a single
// point at one end of a capsule, and rounding decides which; these give a capsule that lies on a face both
// ends of the line on which it rests.
//
// A capsule is a sphere swept along a segment, and its distance from a convex solid is convex along the
// segment. The points of contact are those of the sphere where that distance is least and at the outermost
// of the places where it can bend: ends of the segment, and where it passes from above one feature (face,
// edge, corner) of the solid to above the next. Each moves and deepens continuously with the bodies.
#pragma once

#include <array>
#include <optional>

#include "handsim/core/pose.h"
#include "handsim/model/convex_mesh.h"

namespace handsim::engine {

struct ManifoldPoint {
  Vec3 position = Vec3::Zero();  ///< world, midway between the two surfaces [m]
  Vec3 normal = Vec3::Zero();    ///< world, unit, out of the solid into the capsule
  double depth = 0;              ///< penetration, > 0 [m]
};

struct Manifold {
  std::array<ManifoldPoint, 4> points;
  int count = 0;
};

/// A capsule along its local z axis. @param length between the cap centres [m]
struct CapsuleAt {
  Pose pose;  ///< X_WS
  double radius = 0;
  double length = 0;
};

/// @param edges full edge lengths [m]; @param pose X_WS of the box
Manifold capsule_on_box(const CapsuleAt& capsule, const Pose& pose, const Vec3& edges);

/// @param pose X_WS of the mesh
Manifold capsule_on_mesh(const CapsuleAt& capsule, const Pose& pose, const model::ConvexMesh& mesh);

/// Equal to ODE's contact point, to the bit, but without ODE geometries. @param centre of a sphere [m]
std::optional<ManifoldPoint> capsule_on_sphere(const CapsuleAt& capsule, const Vec3& centre, double radius);

/// @param radius, length (full height, along z) of the cylinder [m]; @param pose X_WS of the cylinder
Manifold capsule_on_cylinder(const CapsuleAt& capsule, const Pose& pose, double radius, double length);

}  // namespace handsim::engine
