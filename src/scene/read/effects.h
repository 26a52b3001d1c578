// Reads the `effects` of a scene and checks them against its content.
#pragma once

#include "handsim/scene/read/scene_spec.h"

namespace handsim::scene {

/// The `effects` list; `auto` is replaced by the effects that the scene's content needs.
model::Effects read_effects(MapReader& reader, const SceneSpec& scene);

/// Problems: effects that the solver's engine or method does not have.
void check_engine(MapReader& reader, const engine::Settings& solver);

}  // namespace handsim::scene
