// A scene file into all that a run needs: the Model, the solver settings with their effects, the run settings
// and the resolved text that repeats it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "handsim/scene/read/inputs.h"
#include "handsim/scene/read/scene_spec.h"

namespace handsim::scene {

/// A compiled scene.
struct Scene {
  SceneSpec spec;
  model::Model model;
  std::optional<control::Plan> control;  ///< where the scene drives its hands
  YamlNode resolved;                     ///< the scene with defaults filled in and references inlined
  std::vector<InputFile> inputs;         ///< meshes and motion files that `resolved` names
  std::vector<std::string> warnings;     ///< e.g. a person outside the survey
};

/// @param overrides `key.path=value`, applied before reading.
/// @throws Error (input) with every problem of the file and the files it names.
Scene load_scene(const std::filesystem::path& path, const std::vector<std::string>& overrides = {});

/// The same from a tree in memory.
Scene compile_scene(YamlNode root);

/// The scene with an effect taken away, and with it what it leaves nothing to act on: friction goes with the
/// last contact, control with actuation. What the effect acted on stays: stops without force, a driven palm
/// that stands still. `resolved` stays that of the whole scene.
/// @throws Error (input) where what drives the hands cannot do without the effect.
Scene without_effect(const Scene& scene, model::Effect effect);

}  // namespace handsim::scene
