// Thousands of runs, one table: `handsim rollouts`. Rollout i is the same whichever thread, process or
// machine computes it, and so are the files' bytes, however often the study was stopped and resumed.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "handsim/study/report.h"
#include "handsim/study/rollouts/rollout_study.h"
#include "handsim/study/study_run.h"

namespace handsim::study {

struct RolloutOptions {
  std::filesystem::path out;  ///< folder; a shard has one of its own within it
  int threads = 0;            ///< 0: as many as the machine has
  int chunk = 8;              ///< rollouts that are done and written down together
  bool resume = false;        ///< goes on from the journal of a run that was stopped
  Shard shard;
  /// Receives the share done, 0..1.
  std::function<void(double)> progress;
};

struct RolloutsResult {
  long done = 0;        ///< rollouts of this shard that are there
  long size = 0;        ///< rollouts of this shard
  long computed = 0;    ///< of those done, by this run
  double wall = 0;      ///< [s]
  bool plotted = true;  ///< gnuplot was there and drew
  Table table;          ///< of a whole study that is complete
};

/// Folder of a shard's journal: `OUT`, or `OUT/shard_03_of_16`.
std::filesystem::path shard_folder(const RolloutOptions& options);

/// Names of the files that a study writes into OUT, without journals.
std::vector<std::string> rollout_files();

/// Runs what is not done and, once a study without shards is complete, writes its files.
/// @param stop ends the run once it is true; what is done is kept.
/// @throws Error (input) where the folder has a journal and `resume` is not set, or one of another study, or
///         no room for what will be written. Error (output) where a file cannot be written.
/// @param clear is called before anything is computed: removes what an earlier study has left.
RolloutsResult run_rollouts(const RolloutStudy& study, const RolloutOptions& options,
                            const std::atomic<bool>& stop, const std::function<void()>& clear = {});

/// The folder has the files of the whole of this study, by this build.
/// @throws Error (input) where it has those of another, which would be lost.
bool is_complete(const RolloutStudy& study, const std::filesystem::path& folder);

/// The table of a study's shards, from the journals in these folders and in their `shard_*` folders.
/// @throws Error (input) where they are of different studies, or rollouts are missing.
Table merge_shards(const std::vector<std::filesystem::path>& folders);

/// Merges shards and writes the files of the study, with the commands that the shards have left.
/// @throws Error (input) as merge_shards.
StudyEnd merge_rollouts(const std::vector<std::filesystem::path>& folders, const StudyRun& run);

/// The commands that repeat the study and its rows. @param seed in place of the study's.
StudyCommands rollouts_commands(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                                std::optional<int> seed);

/// `held in 87 % of 200 hands, 82 to 91 % (95 % interval)`; empty where nothing is judged.
std::string held_text(const Table& table);

/// Lines of uncertain.csv after their head: figure, hands, mean or share, ends of the middle 90 % or of the
/// share's 95 % interval, owners of the variance.
std::string figure_rows(const std::string& head, const Table& table);

/// The commands that repeat `handsim run SCENE --uncertain count` and its rows.
StudyCommands uncertain_commands(const std::filesystem::path& scene,
                                 const std::vector<std::string>& overrides, int count);

/// Writes rollouts.csv, rollouts.h5, summary.json and, with gnuplot, rollouts.png and .svg.
/// @return false where gnuplot is missing or failed.
bool write_rollouts(const Table& table, const std::filesystem::path& out);

/// Text of summary.json: the share held, and what each varied key does to it.
std::string rollouts_summary(const Table& table);

/// Text for the screen: how the rollouts ended, and each outcome with what the varied keys do to it.
std::string rollouts_screen(const Table& table);

}  // namespace handsim::study
