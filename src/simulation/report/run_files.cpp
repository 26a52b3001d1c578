#include <fmt/format.h>

#include "handsim/core/index.h"
#include "handsim/core/input_file.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/simulation/report/run_data.h"

namespace handsim::simulation {

namespace {

constexpr std::size_t kLargestText = 64UL << 20U;

Json read_summary(const std::filesystem::path& path) {
  Json out = Json::parse(read_input_file(path, "a run's summary.json", kLargestText), nullptr, false);
  if (!out.is_object() || !out.contains("criteria"))
    throw input_error(path.string(), "no summary of a run", "summary.json of handsim run");
  return out;
}

}  // namespace

std::size_t RunFiles::first_pose() const { return 1 + 2 * at(scene.model.dof_count()); }

model::State RunFiles::state(std::size_t row) const {
  model::State out = model::initial_state(scene.model);
  out.time = times[row];
  std::size_t column = first_pose();
  for (std::size_t b = 1; b < out.bodies.size(); ++b, column += 7) {
    const auto value = [&](std::size_t i) { return trajectory.at(row, column + i); };
    out.bodies[b].p = {value(0), value(1), value(2)};
    out.bodies[b].q = Quat(value(3), value(4), value(5), value(6)).normalized();
  }
  return out;
}

RunFiles read_run(const std::filesystem::path& folder) {
  const std::filesystem::path resolved = folder / "resolved.yaml";
  if (!std::filesystem::exists(folder / "trajectory.csv"))
    throw input_error(folder.string(), "a folder without trajectory.csv", "the folder of a run");
  RunFiles run{folder,
               read_input_file(resolved, "a run's resolved.yaml", kLargestText),
               scene::load_scene(resolved),
               read_summary(folder / "summary.json"),
               output::read_numbers(folder / "trajectory.csv"),
               {}};
  if (run.trajectory.columns != output::trajectory_columns(run.scene.model))
    throw input_error((folder / "trajectory.csv").string(), "columns of another scene",
                      "the table of the run beside it");
  if (run.trajectory.rows() == 0)
    throw input_error((folder / "trajectory.csv").string(), "no rows", "a run that has started");
  for (std::size_t row = 0; row < run.trajectory.rows(); ++row)
    run.times.push_back(run.trajectory.at(row, 0));
  return run;
}

}  // namespace handsim::simulation
