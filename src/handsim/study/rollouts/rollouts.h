// The unit of work of `handsim rollouts`: rows [from, to) of a study, a pure function of study, seed and
// range. A row is the same whichever thread, process or machine computes it. Who calls this function, who
// keeps the rows and what is made of them, is the package's business: python/handsim/_rollouts.py.
#pragma once

#include <atomic>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "handsim/study/rollouts/rollout_study.h"

namespace handsim::study {

/// A study as a command names it.
struct RolloutsAsked {
  std::filesystem::path file;
  bool uncertain = false;                    ///< the file is a scene, whose uncertain hands are drawn
  std::vector<std::string> overrides;        ///< of the scene
  std::optional<int> count = {}, seed = {};  ///< in place of the study's
  bool bands = true;                         ///< of uncertain hands: keeps curves
};

/// @throws Error (input) with every problem of the file.
RolloutsSpec asked_rollouts(const RolloutsAsked& asked);

struct RolloutRows {
  long from = 0, to = 0;  ///< shorter than asked for where the work was stopped
  std::string csv;        ///< a line for each
  std::vector<std::pair<long, TimeSeries>> trajectories = {};  ///< of those that are written whole
  std::vector<TimeSeries> curves = {};                         ///< of each rollout, for bands
};

/// @param stop ends the work within a step once it is true
RolloutRows rollout_rows(const RolloutStudy& study, long from, long to, const std::atomic<bool>& stop);

/// The line of a rollout that has ended the process that computed it.
std::string crashed_row(const RolloutStudy& study, long rollout, const std::string& error);

}  // namespace handsim::study
