// Checks whether an engine can step a Model. Every defect is reported, none is corrected.
#pragma once

#include <optional>
#include <vector>

#include "handsim/core/error.h"
#include "handsim/model/model.h"

namespace handsim::model {

/// Places of a model's parts in a file, by index; parts beyond the ends have none.
struct Origins {
  std::vector<std::optional<Place>> bodies, joints, shapes, materials;

  /// Gives this place to all that the model got since the last call.
  void add(const Model& model, const std::optional<Place>& place);
};

/// All defects, each with the place of its part: non-finite numbers, masses and sizes out of bounds, inertias
/// that no body can have, axes not unit or not perpendicular, stops out of order, indices out of range,
/// parents after children.
std::vector<Problem> defects(const Model& model, const Origins& origins = {});

}  // namespace handsim::model
