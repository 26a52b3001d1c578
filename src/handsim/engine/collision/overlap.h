// Which shapes of a model penetrate each other at a state: a scene that starts so explodes or is refused.
//
#pragma once

#include <vector>

#include "handsim/model/model.h"
#include "handsim/model/state.h"

namespace handsim::engine {

struct Overlap {
  int shape_a = 0;  ///< index into Model::shapes, below shape_b
  int shape_b = 0;
  double depth = 0;  ///< deepest penetration [m]
};

/// Pairs of shapes that penetrate by more than 1e-9 m, by index; not of one body, jointed or two kinematic
/// ones. @param model free of defects. @throws Error (input) for a shape that cannot be tested
std::vector<Overlap> initial_overlaps(const model::Model& model, const model::State& state);

}  // namespace handsim::engine
