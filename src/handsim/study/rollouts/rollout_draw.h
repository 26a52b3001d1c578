// What one rollout changes in its scene.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/study/rollouts/rollout_table.h"
#include "handsim/study/rollouts/rollouts_file.h"

namespace handsim::study {

/// A number with any unit that handsim knows, in SI; nothing for another text.
std::optional<double> any_quantity(const std::string& text);

/// A varied key in one scene.
struct BoundKey {
  VariedKey key;
  std::vector<std::string> paths;  ///< of the scene; several where the key has `*`
  std::vector<double> mean;        ///< of normal
  std::vector<Column> columns;     ///< that it fills
  bool numbers = false;            ///< its levels are numbers, SI
};

/// A value of a key.
struct Drawn {
  std::string yaml;
  std::vector<Cell> cells;
};

/// @param scene the resolved scene without any of the changes.
/// @throws Error (input) at the key's place if its path has no list for `*`, or normal distribution no mean.
BoundKey bind(const VariedKey& key, const YamlNode& scene);

/// @param draw number of the draw. @param level of a key with levels.
Drawn draw(const BoundKey& key, int seed, long draw, std::size_t level);

/// Values that show whether the scene takes the key: ends of ranges, every level (of many numbers two).
std::vector<std::string> probes(const BoundKey& key);

}  // namespace handsim::study
