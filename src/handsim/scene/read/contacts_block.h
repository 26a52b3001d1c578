// The `contacts` of a scene: named materials, and which groups may touch: hand-right, hand-left (hands: all),
// palm, fingers, fingertips, also of one hand (palm-right), objects, an object's name, ground, mechanism.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/model/model.h"

namespace handsim::scene {

/// Two groups that may touch, by name.
struct ContactRuleSpec {
  std::array<std::string, 2> between;
  std::optional<std::string> material;  ///< absent: combined from the two surfaces
  Place place;
};

struct ContactsSpec {
  std::vector<model::Material> materials;             ///< by name
  std::optional<std::vector<ContactRuleSpec>> rules;  ///< absent: all pairs whose effect is on
};

ContactsSpec read_contacts(MapReader& reader);

/// The material that the key names; nothing, with a problem, if it does not exist.
std::optional<model::Material> named_material(MapReader& reader, std::string_view key,
                                              const std::vector<model::Material>& materials);

model::Material read_material_file(const YamlNode& root, Diagnostics& diagnostics);

}  // namespace handsim::scene
