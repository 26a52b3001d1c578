// The size of several shapes together, for sizes that are hardly meant.
#pragma once

#include <vector>

#include "handsim/model/model.h"

namespace handsim::scene {

/// Edges of the box along the axes of the shapes' common frame that holds them [m].
Vec3 extent(const std::vector<model::Shape>& shapes);

}  // namespace handsim::scene
