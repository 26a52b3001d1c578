#include "handsim/study/rollouts/rollouts.h"

namespace handsim::study {

RolloutsSpec asked_rollouts(const RolloutsAsked& asked) {
  RolloutsSpec spec = asked.uncertain ? uncertain_rollouts(asked.file) : load_rollouts(asked.file);
  spec.set.insert(spec.set.end(), asked.overrides.begin(), asked.overrides.end());
  spec.bands = spec.bands && asked.bands;
  spec.count = asked.count.value_or(spec.count);
  spec.seed = asked.seed.value_or(spec.seed);
  return spec;
}

RolloutRows rollout_rows(const RolloutStudy& study, long from, long to, const std::atomic<bool>& stop) {
  RolloutRows out{from, from, ""};
  for (; out.to < to; ++out.to) {
    std::optional<RolloutRow> row = study.run(out.to, stop);
    if (!row) break;
    out.csv += csv_row(study.head(), *row);
    if (row->trajectory && !row->trajectory->columns.empty())
      out.trajectories.emplace_back(out.to, std::move(*row->trajectory));
    if (!row->curves.columns.empty()) out.curves.push_back(std::move(row->curves));
  }
  return out;
}

std::string crashed_row(const RolloutStudy& study, long rollout, const std::string& error) {
  return csv_row(study.head(), study.ended_row(rollout, "crashed", error));
}

}  // namespace handsim::study
