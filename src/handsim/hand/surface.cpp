#include "handsim/hand/surface.h"

#include <utility>

namespace handsim::hand {

model::Material read_material(MapReader& reader, std::string name) {
  model::Material material;
  material.name = std::move(name);
  reader.fields(material);
  if (reader.has("damping") && !reader.has("stiffness"))
    reader.problem("damping", "a damping without a stiffness", "both or neither");
  // Standard deviations over the values, for studies of uncertainty.
  if (reader.has("spread")) {
    MapReader spread = reader.map("spread");
    for (const char* key : {"friction", "stiffness"}) spread.maybe_number(key, {Dimension::none, 0, 1});
    spread.finish();
  }
  return material;
}

}  // namespace handsim::hand
