// A rollout study that has been held against its scene: any of its rollouts can be run, by any thread.
#pragma once

#include <atomic>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "handsim/scene/compile/scene.h"
#include "handsim/study/rollouts/rollout_draw.h"
#include "handsim/study/rollouts/rollout_table.h"
#include "handsim/study/rollouts/rollouts_spec.h"

namespace handsim::study {

class RolloutStudy {
 public:
  /// Compiles the scene, and once more with every end and level of what is varied.
  /// @throws Error (input) with the problems of the scene, at the study's keys where these cause them.
  explicit RolloutStudy(RolloutsSpec spec);

  const RolloutsSpec& spec() const { return spec_; }
  const TableHead& head() const { return head_; }
  /// Draws times the combinations of levels. Rollout i is of draw i / combinations.
  long size() const { return head_.size; }
  /// Files that it reads.
  const std::vector<std::filesystem::path>& files() const { return files_; }

  /// @throws Error (input) where the scene refuses what was drawn, or there is no such rollout.
  scene::Scene scene(long rollout) const;
  /// The scene's overrides, as `handsim run --set` takes them.
  std::vector<std::string> overrides(long rollout) const;
  /// Runs one. A scene that is refused and a run that diverges are rows with their reasons.
  /// @return nothing where `stop` has become true.
  std::optional<Row> run(long rollout, const std::atomic<bool>& stop) const;

 private:
  struct Choice {
    std::vector<std::string> overrides;
    std::vector<Cell> cells;
  };
  Choice choose(long rollout) const;
  scene::Scene compile(const std::vector<std::string>& overrides) const;
  void check_keys();
  void take_sample(const scene::Scene& scene);
  void make_head();

  RolloutsSpec spec_;
  YamlNode root_;  ///< of the scene, with the files that it names
  std::vector<BoundKey> keys_;
  long combinations_ = 1;
  TableHead head_;
  std::vector<std::filesystem::path> files_;
  std::vector<Column> figures_;   ///< of all samples
  std::uint64_t scene_hash_ = 0;  ///< of all samples
  std::optional<Error> refused_;  ///< why one cannot be run
};

}  // namespace handsim::study
