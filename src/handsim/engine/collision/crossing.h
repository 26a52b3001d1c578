// Whether a point that goes straight passes through a shape.
#pragma once

#include "handsim/model/model.h"

namespace handsim::engine {

/// True where both ends lie outside the shape and the line between them passes through it; never of a plane,
/// which has no far side. @param from, to in the shape's frame [m]
bool crosses(const model::Shape& shape, const Vec3& from, const Vec3& to);

}  // namespace handsim::engine
