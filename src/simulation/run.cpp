#include "handsim/simulation/run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "handsim/output/atomic_file.h"
#include "handsim/output/contact_sheet.h"
#include "handsim/simulation/pictures.h"
#include "handsim/simulation/plots.h"
#include "handsim/simulation/recorder.h"
#include "handsim/simulation/simulation.h"
#include "handsim/simulation/summary.h"

namespace handsim::simulation {

namespace {

void write_pictures(const scene::Scene& scene, const Recorder& recorder, const std::filesystem::path& out) {
  const std::vector<Snapshot>& snapshots = recorder.snapshots();
  if (snapshots.empty()) return;
  const std::vector<output::Image> images = draw(scene, snapshots);
  std::vector<output::SheetCell> cells;
  for (std::size_t i = 0; i < images.size(); ++i) {
    output::write_png(images[i], out / fmt::format("frame_{:03d}.png", i));
    cells.push_back({images[i], recorder.captions()[i]});
  }
  output::write_png(output::contact_sheet(cells, scene.spec.title), out / "contact_sheet.png");
}

/// Steps to the end of the scene or to the fault that stops it.
void loop(Simulation& simulation, Recorder& recorder, const RunOptions& options, RunResult& result) {
  const long steps = simulation.step_count();
  const long report_every = std::max(1L, steps / 200);
  recorder.see(0);
  for (long i = 1; i <= steps; ++i) {
    try {
      simulation.step();
    } catch (const Error& error) {
      if (!error.fault()) throw;
      result.fault = error.fault();
      return;
    }
    recorder.see(i);
    if (options.progress && i % report_every == 0)
      options.progress(static_cast<double>(i) / static_cast<double>(steps));
  }
}

/// What only a controlled scene can show.
void check_controlled(const scene::Scene& scene, const RunOptions& options) {
  if (!scene.control)
    throw input_error(options.plots ? "--plots" : "--poses", "a scene without a control block",
                      "a scene that drives its hands");
  if (options.plots) need_gnuplot();
}

}  // namespace

bool RunResult::passed() const {
  return !fault && std::all_of(verdicts.begin(), verdicts.end(), [](const Verdict& v) { return v.held(); });
}

RunResult run(const scene::Scene& scene, const RunOptions& options) {
  if (options.plots || options.pose_pictures) check_controlled(scene, options);
  Simulation simulation(scene);
  output::make_folder(options.out);
  Recorder recorder(scene, options, simulation);
  RunResult result;
  const auto start = std::chrono::steady_clock::now();
  loop(simulation, recorder, options, result);
  result.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.simulated = simulation.state().time;
  result.tracking = simulation.tracking();
  result.grasps = simulation.grasps();
  result.verdicts = verdicts(simulation, scene.spec.criteria);
  result.summary = summary_json(scene, simulation, result);
  recorder.finish();
  write_pictures(scene, recorder, options.out);
  if (options.plots) write_plots(scene, options.out);
  output::write_file(options.out / "resolved.yaml", emit_yaml(scene.resolved));
  output::write_file(options.out / "summary.json", result.summary);
  return result;
}

output::Image picture(const scene::Scene& scene, double time) {
  Simulation simulation(scene);
  const long steps = std::lround(time / scene.spec.solver.step);
  for (long i = 0; i < steps; ++i) simulation.step();
  return draw(scene, {snapshot(simulation.engine())}).front();
}

}  // namespace handsim::simulation
