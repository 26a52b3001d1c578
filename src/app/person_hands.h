// Hands straight from a person, without a scene.
#pragma once

#include <string>
#include <vector>

#include "handsim/app/commands.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::app {

struct PersonHands {
  hand::HandSpec model;
  hand::Person person;
  YamlNode files = yaml_map();  ///< trees of both files
  std::vector<std::string> warnings;
};

/// @throws Error (input) that names the files' keys or the options.
PersonHands read_person_hands(const HandArguments& arguments);

/// A scene with the requested hands: straight, side by side, backs up.
scene::Scene compile_hands(const std::string& side, hand::Mount mount, const model::Effects& effects,
                           PersonHands input);

}  // namespace handsim::app
