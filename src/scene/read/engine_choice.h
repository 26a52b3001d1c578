// Engine `auto`: from what accuracy studies measured of scenes of four kinds, the cheapest engine, method and
// step that reaches a stated accuracy. Private to this folder but for the kinds' names.
#pragma once

#include <array>
#include <string_view>

#include "handsim/scene/read/scene_spec.h"

namespace handsim::scene {

/// What decides which methods apply and how well they do: trees of bodies in free motion, the same with
/// closed loops, motion that meets joint stops, and contact.
enum class SceneKind { tree, loop, stops, contact };
inline constexpr std::array<std::string_view, 4> kSceneKindNames = {"tree", "loop", "stops", "contact"};

/// A line of the table of costs.
struct CostRow {
  double error = 0;  ///< RMS of what the rates err by, over the RMS of the rates
  double cost = 0;   ///< CPU seconds per simulated second of the study's scene
  engine::Settings solver;
};

/// What was measured of scenes of one kind.
struct CostTable {
  SceneKind kind = SceneKind::tree;
  std::string scene;    ///< that it was measured on
  double duration = 0;  ///< of the measurement [s]
  std::vector<CostRow> rows;
};

/// `kinds`, by the accuracy study (config/accuracy_costs.yaml).
std::vector<CostTable> read_costs(YamlNode& root, const std::string& path, Diagnostics& diagnostics);
/// The same as a tree; steps in seconds.
YamlNode write_costs(const std::vector<CostTable>& tables);

/// The `solver` block that says `engine: auto`: sets SceneSpec::solver to what the table of costs has, and
/// SceneSpec::engine_choice to what was chosen and why; the block then holds the choice. Of `guard`, `seed`
/// and `speculative` the engine chosen takes what it has; a guard leaves engine ode alone to choose from.
void choose_engine(MapReader& reader, SceneSpec& scene);

}  // namespace handsim::scene
