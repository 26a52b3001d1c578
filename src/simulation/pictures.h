// Pictures of a scene: snapshots of a run drawn with one camera that sees all of them.
#pragma once

#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/output/image.h"
#include "handsim/scene/scene.h"

namespace handsim::simulation {

/// What a picture needs of a moment.
struct Snapshot {
  model::State state;
  std::vector<engine::Contact> contacts;
};

Snapshot snapshot(const engine::Engine& engine);

/// One image per snapshot, in the scene's size, view and options. Creates one OpenGL context.
std::vector<output::Image> draw(const scene::Scene& scene, const std::vector<Snapshot>& snapshots);

}  // namespace handsim::simulation
