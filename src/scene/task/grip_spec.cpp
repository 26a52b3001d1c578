#include "handsim/scene/task/grip_spec.h"

#include "handsim/hand/hand_spec.h"
#include "handsim/scene/read/blocks.h"
#include "handsim/scene/task/tasks.h"

namespace handsim::scene {

GripSpec read_grip(MapReader reader) {
  GripSpec out;
  MapReader forces = reader.required_map("forces", "a mapping of fingers to forces");
  for (const auto& [name, part] : hand::kFingers)
    if (forces.has(name)) out.forces[part] = forces.number(name, {Dimension::force, 0, 1e3});
  if (forces.sound() && out.forces.empty()) forces.problem("", "no finger", "a force of at least one finger");
  forces.finish();
  if (YamlNode* table = referenced(reader, "strength", FileKind::grip_norms))
    out.strength = hand::read_grip_table(*table, reader.path_of("strength"), reader.diagnostics());
  out.squeeze = reader.number("squeeze", kSpan, out.squeeze);
  out.friction = reader.maybe_number("friction", {Dimension::none, 1e-3, 100});
  out.search = reader.number("search", {Dimension::none, 0, 0.5}, out.search);
  reader.finish();
  return out;
}

std::string_view part_name(model::Part part) {
  for (const auto& [name, finger] : hand::kFingers)
    if (finger == part) return name;
  return "palm";
}

}  // namespace handsim::scene
