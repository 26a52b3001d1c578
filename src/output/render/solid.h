// The convex solid behind a drawn shape: a core (box or cylinder, possibly flat to a line or a point) grown
// by a radius. One form for all kinds serves meshes, shadows, bounds and the framing of cameras.
#pragma once

#include "handsim/model/model.h"

namespace handsim::output {

enum class Core { box, cylinder, hull };

/// All points within `round` of the core, which lies about the origin of `pose`. A hull is that of its mesh,
/// with no rounding; where only size counts, the box about it stands for it.
struct Solid {
  Core core = Core::box;
  Vec3 half = Vec3::Zero();  ///< half edges of the core [m]; cylinder: (radius, radius, half height);
                             ///< hull: of the box about it, as far as it reaches from the centroid
  double round = 0;          ///< [m]
  Pose pose;                 ///< X_WS
  std::shared_ptr<const model::ConvexMesh> mesh = {};  ///< of a hull

  /// Half its smallest full extent [m].
  double thickness() const { return round + half.minCoeff(); }
  /// Radius about its origin that holds all of it [m].
  double reach() const { return half.norm() + round; }
};

/// The exact solid of a shape that stands at x_WS.
Solid solid(const model::Shape& shape, const Pose& x_WS);
/// The same with its edges rounded by 6% of its thickness, so that they catch the light. It lies
/// inside the exact one.
Solid bevelled(Solid exact);

/// Is its core a line or a point (a capsule or a sphere)?
bool is_capsule(const Solid& solid);

/// Largest n . x over the solid, x in the world (support function; n need not be unit) [m].
double support(const Solid& solid, const Vec3& n);

}  // namespace handsim::output
