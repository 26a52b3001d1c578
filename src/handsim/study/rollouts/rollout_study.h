// A rollout study that has been held against its scene: any of its rollouts can be run, by any thread.
#pragma once

#include <atomic>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "handsim/scene/compile/overruled.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/study/rollouts/rollout_draw.h"
#include "handsim/study/rollouts/rollout_table.h"
#include "handsim/study/rollouts/rollouts_file.h"

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
  /// The scene with the first of each key's values that it takes: about as large as the others.
  const scene::Scene& sample() const { return *sample_; }
  /// Warnings of keys that act on less than they say.
  const std::vector<std::string>& warnings() const { return warnings_; }
  /// Files that it reads.
  const std::vector<std::filesystem::path>& files() const { return files_; }

  /// @throws Error (input) where the scene refuses what was drawn, or there is no such rollout.
  scene::Scene scene(long rollout) const;
  /// The scene's overrides, as `handsim run --set` takes them.
  std::vector<std::string> overrides(long rollout) const;
  /// Runs one. A scene that is refused and a run that diverges are rows with their reasons.
  /// @return nothing where `stop` has become true.
  std::optional<RolloutRow> run(long rollout, const std::atomic<bool>& stop) const;
  /// The row of one that was not run to its end. @param ended why, in a word
  RolloutRow ended_row(long rollout, const std::string& ended, const std::string& error) const;

 private:
  struct Choice {
    std::vector<std::string> overrides;
    std::vector<Cell> cells;
  };
  Choice choose(long rollout) const;
  std::vector<Cell> cells_of(long rollout, const Choice& choice, std::map<std::string, Cell> outcome) const;
  scene::Scene compile(const std::vector<std::string>& overrides) const;
  void add_at_set(const Error& error, const std::string& path, Diagnostics& diagnostics) const;
  void check_paths(Diagnostics& diagnostics) const;
  void check_keys();
  void note_overruled(const scene::Scene& scene);
  std::vector<Problem> idle_keys();
  void check_record_and_stop() const;
  void take_sample(const scene::Scene& scene);
  void add_uncertain(const scene::Scene& scene);
  void collect_outcomes();
  void make_head();

  RolloutsSpec spec_;
  YamlNode root_;  ///< of the scene, with the files that it names
  std::vector<BoundKey> keys_;
  long combinations_ = 1;
  TableHead head_;
  std::vector<std::filesystem::path> files_;
  std::optional<scene::Scene> sample_;
  std::vector<Column> figures_;                             ///< of all samples
  bool reads_summary_ = false;                              ///< an outcome is a figure of summary.json
  std::uint64_t scene_hash_ = 0;                            ///< of all samples
  std::optional<Error> refused_;                            ///< why one cannot be run
  std::optional<std::vector<scene::Overruled>> overruled_;  ///< in all samples
  std::vector<std::string> warnings_;
};

}  // namespace handsim::study
