#include "handsim/scene/task/grip_spec.h"

#include <array>

#include "handsim/scene/read/blocks.h"
#include "handsim/scene/task/tasks.h"

namespace handsim::scene {

namespace {

struct FingerName {
  const char* name;
  model::Part part;
};
constexpr std::array kFingers = {
    FingerName{"thumb", model::Part::thumb}, FingerName{"index", model::Part::index},
    FingerName{"middle", model::Part::middle}, FingerName{"ring", model::Part::ring},
    FingerName{"little", model::Part::little}};

}  // namespace

GripSpec read_grip(MapReader reader) {
  GripSpec out;
  MapReader forces = reader.required_map("forces", "a mapping of fingers to forces");
  for (const FingerName& finger : kFingers)
    if (forces.has(finger.name))
      out.forces[finger.part] = forces.number(finger.name, {Dimension::force, 0, 1e3});
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

const char* part_name(model::Part part) {
  for (const FingerName& finger : kFingers)
    if (finger.part == part) return finger.name;
  return "palm";
}

}  // namespace handsim::scene
