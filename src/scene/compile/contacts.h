// Contact groups and rules of a scene as parts of its Model. A group's name in YAML: hand-right, hand-left
// (hands: all), palm, fingers, fingertips, each also of one hand (palm-right), objects, an object's own name,
// ground, mechanism.
#pragma once

#include "handsim/scene/read/scene_spec.h"

namespace handsim::scene {

/// Reads a material file as it stands.
model::Material read_material_file(YamlNode& root, Diagnostics& diagnostics);

/// Index of the group of an object's shapes: of its own where a rule names it, or that of all objects.
int object_group(const SceneSpec& scene, const ObjectSpec& object);

/// Appends the rules: those of the contacts block, the later one where two speak of a pair, or else every
/// pair that the effects let meet. The model has its groups already, in the order palm, fingers, fingertips
/// of each hand, objects, objects with rules of their own, ground, mechanism.
void add_contact_rules(model::Model& model, const SceneSpec& scene);

}  // namespace handsim::scene
