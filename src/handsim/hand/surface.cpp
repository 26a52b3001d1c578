#include "handsim/hand/surface.h"

#include <utility>

#include "handsim/hand/pad_law.h"

namespace handsim::hand {

model::Material read_material(MapReader& reader, std::string name) {
  model::Material material;
  material.name = std::move(name);
  reader.fields(material);
  read_pad_law(reader, material);
  // Standard deviations over the values, for studies of uncertainty.
  if (reader.has("spread")) {
    MapReader spread = reader.map("spread");
    for (const char* key : {"friction", "stiffness", "depth"})
      spread.maybe_number(key, {Dimension::none, 0, 1});
    spread.finish();
  }
  return material;
}

}  // namespace handsim::hand
