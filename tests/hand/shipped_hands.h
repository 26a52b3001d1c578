// Hands and people of the tests.
#pragma once

#include <string>

#include "handsim/hand/hand_file.h"
#include "places.h"

namespace handsim::hand {

inline HandSpec shipped(const std::string& name) {
  YamlNode node = load_yaml(test::in_source("handmodels/") + name + ".yaml");
  Diagnostics diagnostics;
  HandSpec spec = read_hand_spec(node, "", diagnostics);
  diagnostics.throw_if_any();
  return spec;
}

inline Person person(double stature, double mass, Sex sex) {
  Person out;
  out.stature = stature;
  out.mass = mass;
  out.sex = sex;
  return out;
}

}  // namespace handsim::hand
