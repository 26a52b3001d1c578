// Is this Model one that an engine can step? Every defect is named, none is mended.
#pragma once

#include <vector>

#include "handsim/core/error.h"
#include "handsim/model/model.h"

namespace handsim::model {

/// All defects: non-finite numbers, masses and sizes out of bounds, inertias that no body can have,
/// axes not unit or not perpendicular, stops out of order, indices out of range, parents after children.
std::vector<Problem> defects(const Model& model);

}  // namespace handsim::model
