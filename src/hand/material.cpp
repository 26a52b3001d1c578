#include "handsim/hand/material.h"

namespace handsim::hand {

model::Material read_material(MapReader& reader, std::string name) {
  model::Material material;
  material.name = std::move(name);
  material.friction = reader.number("friction", {Dimension::none, 0, 10}, material.friction);
  material.restitution = reader.number("restitution", {Dimension::none, 0, 1}, material.restitution);
  material.restitution_speed =
      reader.number("restitution_speed", {Dimension::speed, 0, 100}, material.restitution_speed);
  const Quantity lever = {Dimension::length, 0, 1};
  material.rolling_friction = reader.number("rolling_friction", lever, material.rolling_friction);
  material.spinning_friction = reader.number("spinning_friction", lever, material.spinning_friction);
  const auto stiffness = reader.maybe_number("stiffness", {Dimension::stiffness, 1, 1e9});
  const auto damping = reader.maybe_number("damping", {Dimension::damping, 0, 1e6});
  if (damping && !stiffness) reader.problem("damping", "a damping without a stiffness", "both or neither");
  if (stiffness) material.compliance = model::Compliance{*stiffness, damping.value_or(0)};
  return material;
}

}  // namespace handsim::hand
