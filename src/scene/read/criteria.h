// Limits that decide whether a run has succeeded: read, and refused where the scene can never measure their
// figure.
#pragma once

#include "handsim/scene/read/scene_spec.h"

namespace handsim::scene {

Criteria read_criteria(MapReader reader);

/// Problems: limits of what the scene has not. Its content, effects and solver have to be read.
void check_criteria(MapReader reader, const SceneSpec& scene);

/// Problems: limits of poses and movements that the hands' programs have not. @param root of the scene.
void check_tracked(YamlNode& root, const SceneSpec& scene, const control::Plan& plan,
                   Diagnostics& diagnostics);

}  // namespace handsim::scene
