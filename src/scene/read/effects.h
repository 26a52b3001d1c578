// The `effects` of a scene: which it asks for, which it needs, and whether the two agree.
#pragma once

#include "handsim/scene/read/scene_spec.h"

namespace handsim::scene {

/// The `effects` list, with `auto` resolved and written out. Reads nothing but the scene's content.
model::Effects read_effects(MapReader& reader, const SceneSpec& scene);

/// Effects that the solver's engine or method does not have.
void check_engine(MapReader& reader, const engine::Settings& solver);

}  // namespace handsim::scene
