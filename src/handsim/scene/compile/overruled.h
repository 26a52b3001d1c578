// Which overrides of a scene act on nothing: another key wins, or what they describe is not simulated.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/scene/compile/scene.h"

namespace handsim::scene {

struct Overruled {
  std::string path;    ///< of the override
  std::string by;      ///< `contacts.rules.0 gives hands and objects the material pad`
  bool wholly = true;  ///< False for a surface that acts where no contact rule names a material.

  std::string text() const;
};

/// In the order of the resolved scene.
std::vector<Overruled> overruled(const Scene& scene);

/// Why a number at this path acts on nothing, e.g. `objects.0.friction`; nothing where it acts.
std::optional<std::string> idle_because(const Scene& scene, const std::string& path);

/// load_scene() of a tree in memory. What is overruled is among the scene's warnings.
Scene load_scene(YamlNode root, const std::vector<std::string>& overrides, Diagnostics diagnostics = {});

}  // namespace handsim::scene
