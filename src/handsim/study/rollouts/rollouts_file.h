// A rollout study as its file says it.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/hand/person.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/study/rollouts/population.h"
#include "handsim/study/rollouts/rollout_table.h"

namespace handsim::study {

/// A number of the file.
struct Given {
  double value = 0;  ///< SI
  std::string unit;  ///< as written; empty for a bare number
};

/// One of some values.
struct Level {
  std::string yaml;
  std::string text;  ///< in tables
};

/// A key of the scene, and what its values are drawn from.
struct VariedKey {
  enum class From { uniform, log_uniform, normal, choice, population, levels };

  std::string key;  ///< dotted; `*` stands for every item of a list, which all get the same value
  From from = From::uniform;
  bool list = false;                       ///< a value is a list of numbers
  std::vector<Given> low, high;            ///< of uniform and log_uniform; the deviation of normal is `high`
  std::optional<std::vector<Given>> mean;  ///< of normal; absent: the scene's own value
  std::vector<Level> levels;               ///< of choice and levels
  const Population* population = nullptr;
  std::optional<hand::Sex> sex;  ///< absent: either
  Place place;
};

/// Measurements of a scene: figures by name, and curves.
struct Findings {
  std::vector<std::pair<std::string, Cell>> figures;
  TimeSeries curves;
};

struct RolloutsSpec {
  std::string title;
  std::filesystem::path scene;
  std::vector<std::string> set;  ///< overrides of the scene, for every rollout
  int count = 1;                 ///< draws; each is run with every combination of levels
  int seed = 1;
  std::vector<VariedKey> vary;
  /// Also varied: what persons, hand models and materials give a spread, normal around their values.
  bool uncertain = false;
  bool bands = false;                                         ///< of each rollout's curves: bands.csv
  std::function<Findings(const scene::Scene&)> measure = {};  ///< in place of a run
  /// Figures that are analysed beside the verdict: columns, or paths in summary.json.
  std::vector<std::string> outcomes;
  std::optional<Place> outcome_place;
  bool stop_lost = false;
  std::vector<std::string> figures;  ///< columns that are written; empty: all
  int trajectories = 0;              ///< of the first rollouts, which are written whole
  YamlNode resolved;                 ///< the file, with defaults
};

/// The key of an assignment, key=value.
inline std::string key_of(std::string_view assignment) {
  return std::string(assignment.substr(0, assignment.find('=')));
}

/// Reads a study; every defect goes into the diagnostics.
RolloutsSpec read_rollouts(const YamlNode& root, Diagnostics& diagnostics);

/// The study of `handsim run SCENE --uncertain`.
RolloutsSpec uncertain_rollouts(const std::filesystem::path& scene);

/// @throws Error (input) with every problem of the file.
RolloutsSpec load_rollouts(const std::filesystem::path& path);

}  // namespace handsim::study
