// Which pairs of shapes have contact manifolds of handsim's own; the others are the engine's to test.
#pragma once

#include <optional>

#include "handsim/engine/contact/manifold.h"
#include "handsim/model/model.h"

namespace handsim::engine {

/// Contact points of two shapes, normals out of b into a; nothing for a pair without a manifold of its own:
/// capsules on boxes, cylinders and convex meshes, and convex meshes on all but cylinders have one.
/// @param x_WA, x_WB poses of the shapes' frames
std::optional<Manifold> own_manifold(const model::Shape& a, const Pose& x_WA, const model::Shape& b,
                                     const Pose& x_WB);

}  // namespace handsim::engine
