// Builds the Model of a scene from its content and plans.
#pragma once

#include <vector>

#include "handsim/scene/task/tasks.h"

namespace handsim::scene {

/// @throws Error (input) if a person and a hand model do not give a valid hand.
std::vector<hand::BuiltHand> build_hands(const std::vector<HandEntry>& hands);

/// @throws Error (input) with all defects of the model, each with the place of its part in the file.
model::Model build_model(const SceneSpec& scene, const std::vector<hand::BuiltHand>& hands,
                         const Plans& plans);

}  // namespace handsim::scene
