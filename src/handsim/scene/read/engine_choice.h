// Engine `auto`: the cheapest engine, method and step for a stated accuracy, by measurements on four kinds.
#pragma once

#include <array>
#include <string_view>

#include "handsim/scene/read/scene_file.h"

namespace handsim::scene {

/// Kinds of scenes by methods and accuracy: free trees of bodies, with closed loops, stops, or contact.
enum class SceneKind { tree, loop, stops, contact };
inline constexpr std::array<std::string_view, 4> kSceneKindNames = {"tree", "loop", "stops", "contact"};

struct CostRow {
  double error = 0;  ///< RMS error of the rates over the RMS of the rates
  double cost = 0;   ///< CPU seconds per simulated second of the study's scene
  engine::Settings solver;
};

/// Measurements on a scene of one kind.
struct CostTable {
  SceneKind kind = SceneKind::tree;
  std::string scene;    ///< the scene measured
  double duration = 0;  ///< of the measurement [s]
  std::vector<CostRow> rows;
};

/// Reads the tables of an accuracy study (config/accuracy_costs.yaml).
std::vector<CostTable> read_costs(const YamlNode& root, const std::string& path, Diagnostics& diagnostics);

/// Reads a `solver` block with `engine: auto`: sets SceneSpec::solver from the table of costs and
/// SceneSpec::engine_choice to the choice and its reason, and writes the choice into the block. `seed`
/// and `speculative` apply if the chosen engine has them.
void choose_engine(MapReader& reader, SceneSpec& scene);

/// Whether a scene has `solver.step: auto`: runs choose its step (simulation/run/step_choice.h), and nothing
/// runs before. @param resolved text of the scene
bool asks_for_step(const YamlNode& resolved);

}  // namespace handsim::scene
