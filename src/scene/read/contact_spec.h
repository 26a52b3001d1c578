// The `contacts` block of a scene: named materials, and which groups may touch. A group's name in YAML:
// hand-right, hand-left (hands: all), palm, fingers, fingertips, each also of one hand (palm-right), objects,
// an object's own name, ground, mechanism.
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
  std::optional<std::vector<ContactRuleSpec>> rules;  ///< absent: all that the effects let meet
};

ContactsSpec read_contacts(MapReader& reader);

/// The material of a name; nothing, with a problem, where there is none.
std::optional<model::Material> named_material(MapReader& reader, std::string_view key,
                                              const std::vector<model::Material>& materials);

/// Reads a material file as it stands.
model::Material read_material_file(YamlNode& root, Diagnostics& diagnostics);

}  // namespace handsim::scene
