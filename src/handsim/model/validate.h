// Checks that an engine can step a Model. Reports every defect and corrects none.
#pragma once

#include <optional>
#include <vector>

#include "handsim/core/error.h"
#include "handsim/model/model.h"

namespace handsim::model {

/// Places in a file of a model's parts, by index; parts beyond the end of a list have no place.
struct Origins {
  std::vector<std::optional<Place>> bodies, joints, shapes, materials;

  /// Assigns this place to all parts that were added to the model since the last call.
  void add(const Model& model, const std::optional<Place>& place);
};

/// All defects with their places: non-finite numbers, masses and sizes out of bounds, inertias against the
/// triangle inequality, axes not unit or perpendicular, stops out of order, bad indices, children first.
std::vector<Problem> defects(const Model& model, const Origins& origins = {});

}  // namespace handsim::model
