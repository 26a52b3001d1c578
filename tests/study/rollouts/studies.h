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

/// Results and texts of a whole study.
struct StudyRun {
  study::RolloutsResult result;
  std::string csv, h5, summary;
};

inline StudyRun run_study(const std::filesystem::path& file, const std::filesystem::path& out,
                          int threads = 1, int chunk = 8) {
  const study::RolloutStudy study(study::load_rollouts(file));
  study::RolloutOptions options;
  options.out = out;
  options.threads = threads;
  options.chunk = chunk;
  StudyRun run;
  run.result = study::run_rollouts(study, options, false);
  run.csv = text_of(out / "rollouts.csv");
  run.h5 = text_of(out / "rollouts.h5");
  run.summary = text_of(out / "summary.json");
  return run;
}

}  // namespace handsim::test
