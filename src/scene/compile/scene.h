// A scene file into all that a run needs: the Model, the solver settings with their effects, the run settings
// and the resolved text that repeats it.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "handsim/scene/read/inputs.h"
#include "handsim/scene/task/tasks.h"

namespace handsim::scene {

/// A compiled scene.
struct Scene {
  SceneSpec spec;                      ///< as it was read
  std::vector<hand::BuiltHand> hands;  ///< right hands, at the indices of SceneSpec::hands
  Plans plans;                         ///< where hands and objects start, and what they are to do
  model::Model model;
  std::optional<control::Plan> control;  ///< where the scene drives its hands
  YamlNode resolved;                     ///< the scene with defaults filled in and references inlined
  std::vector<InputFile> inputs;         ///< meshes and motion files that `resolved` names
  std::vector<std::string> warnings;     ///< e.g. a person outside the survey
  /// The same in all copies of one compilation: their motions can be exchanged.
  std::shared_ptr<const char> lineage = std::make_shared<const char>();
};

/// @param overrides `key.path=value`, applied before reading.
/// @throws Error (input) with every problem of the file and the files it names.
Scene load_scene(const std::filesystem::path& path, const std::vector<std::string>& overrides = {});

/// The same from a tree in memory.
Scene compile_scene(YamlNode root);

/// The same from what was read. @param root that it was read from; without one `resolved` is empty.
Scene compile_scene(SceneSpec spec, YamlNode root = {});

/// The scene with an effect taken away, and with it what it leaves nothing to act on: friction goes with the
/// last contact, control with actuation. What the effect acted on stays: stops without force, a driven palm
/// that stands still. `resolved` stays that of the whole scene.
/// @throws Error (input) where what drives the hands cannot do without the effect.
Scene without_effect(const Scene& scene, model::Effect effect);

/// The files that the scene was read from: scene, persons, hand models, meshes, motions; each once, as the
/// resolved scene names them.
std::vector<std::filesystem::path> files_read(const Scene& scene);

}  // namespace handsim::scene
