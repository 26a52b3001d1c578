// Small studies for tests: two limp hands for twenty steps, and a ball.
#pragma once

#include "handsim/study/rollouts/rollouts.h"
#include "scene_files.h"

namespace handsim::test {

/// Twelve rollouts of some milliseconds each: six draws on two engines.
inline std::filesystem::path write_study(const std::filesystem::path& folder, const std::string& more = "") {
  const std::filesystem::path path = folder / "study.yaml";
  std::ofstream(path) << "scene: " << source("config/two_hands.yaml").string() << R"(
set: {duration: 0.02 s, record.every: 5 ms}
count: 6
seed: 3
vary:
  hands.*.person: {population: ansur2}
  hands.0.tissue.damping: {log_uniform: [0.5, 2]}
  gravity: {normal: {sd: [0, 0.1 m/s2, 0]}}
  solver.engine: {each: [ode, articulated]}
record: {trajectories: 2}
)" << more;
  return path;
}

/// The table of a study, as rollouts.csv has it.
inline std::string table_of(const study::RolloutStudy& study) {
  const std::atomic<bool> stop = false;
  return study::csv_head(study.head()) + study::rollout_rows(study, 0, study.size(), stop).csv;
}
inline std::string table_of(const std::filesystem::path& file) {
  return table_of(study::RolloutStudy(study::load_rollouts(file)));
}

}  // namespace handsim::test
