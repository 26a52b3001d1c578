// A scene and its plans into the Model.
#pragma once

#include <vector>

#include "handsim/scene/task/tasks.h"

namespace handsim::scene {

/// @throws Error (input) where a person and a model make no hand.
std::vector<hand::BuiltHand> build_hands(const std::vector<HandEntry>& hands);

/// @throws Error (input) with all that is wrong with the model, each with the place of its part in the file.
model::Model build_model(const SceneSpec& scene, const std::vector<hand::BuiltHand>& hands,
                         const Plans& plans);

}  // namespace handsim::scene
