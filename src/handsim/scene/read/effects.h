// The `effects` of a scene: those that its content needs, and whether those that it lists have something to
// act on.
#pragma once

#include "handsim/core/yaml_reader.h"
#include "handsim/engine/settings.h"

namespace handsim::scene {

struct SceneSpec;

/// The `effects` list; `auto` is replaced by the effects that the scene's content needs.
model::Effects read_effects(MapReader& reader, const SceneSpec& scene);

/// Problems: effects that the solver's engine or method does not have.
void check_engine(MapReader& reader, const engine::Settings& solver);

}  // namespace handsim::scene
