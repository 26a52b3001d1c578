// Compiles a scene file into the Model, solver settings, run settings and the resolved text that repeats it.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "handsim/control/muscle_drive.h"
#include "handsim/scene/read/inputs.h"
#include "handsim/scene/task/tasks.h"

namespace handsim::scene {

struct Scene {
  SceneSpec spec;                      ///< as it was read
  std::vector<hand::BuiltHand> hands;  ///< right hands, at the indices of SceneSpec::hands
  Plans plans;                         ///< start poses of hands and objects, and tasks
  model::Model model;
  std::optional<control::Plan> control;        ///< if the scene drives its hands
  std::optional<control::MusclePlan> muscles;  ///< if the scene drives its muscles
  YamlNode resolved;                           ///< the scene with defaults filled in and references inlined
  std::vector<ReferencedFile> inputs;          ///< meshes and motion files that `resolved` names
  std::vector<std::string> warnings;           ///< e.g. a person outside the survey
  /// One address for all copies of a compiled scene: these can exchange their motions.
  std::shared_ptr<const char> lineage = std::make_shared<const char>();
};

/// @param overrides `key.path=value`. @throws Error (input) with all problems of the file and its files
Scene load_scene(const std::filesystem::path& path, const std::vector<std::string>& overrides = {});

/// Compiles a scene from a tree in memory.
Scene compile_scene(YamlNode root);

/// Compiles a scene from its content. @param root from which it was read; without one `resolved` is empty.
Scene compile_scene(SceneSpec spec, YamlNode root = {});

/// The scene without an effect, and without effects that then have nothing to act on: friction is removed
/// with the last effect of contact, control with actuation. The content stays: stops without torque, a driven
/// palm at rest. `resolved` stays that of the whole scene.
/// @throws Error (input) if the hands cannot be controlled without the effect.
Scene without_effect(const Scene& scene, model::Effect effect);

/// The scene's files: scene, persons, hand models, meshes, motions; each once, as the resolved scene has it.
std::vector<std::filesystem::path> files_read(const Scene& scene);

}  // namespace handsim::scene
