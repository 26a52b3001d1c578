#include "handsim/simulation/run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "handsim/output/atomic_file.h"
#include "handsim/output/contact_sheet.h"
#include "handsim/output/trajectory.h"
#include "handsim/simulation/pictures.h"
#include "handsim/simulation/simulation.h"
#include "handsim/simulation/summary.h"

namespace handsim::simulation {

namespace {

/// Steps after which the k-th of n pictures is taken, the first at the start and the last at the end.
std::vector<long> frame_steps(int frames, long steps) {
  std::vector<long> out;
  for (int k = 0; k < frames; ++k)
    out.push_back(frames == 1
                      ? steps
                      : std::lround(static_cast<double>(k) * static_cast<double>(steps) / (frames - 1)));
  return out;
}

/// Keeps what a run leaves behind: rows of the trajectory and moments for pictures.
class Recorder {
 public:
  Recorder(const scene::Scene& scene, const RunOptions& options, long steps)
      : trajectory_(options.out / "trajectory.csv", scene.model),
        every_(std::max(1L, std::lround(scene.spec.record_every / scene.spec.solver.step))),
        frames_(frame_steps(options.frames, steps)) {}

  void see(long step, const engine::Engine& engine) {
    if (step % every_ == 0) trajectory_.add(engine.state());
    while (taken_ < frames_.size() && frames_[taken_] == step) {
      snapshots_.push_back(snapshot(engine));
      ++taken_;
    }
  }

  void finish() { trajectory_.finish(); }
  const std::vector<Snapshot>& snapshots() const { return snapshots_; }

 private:
  output::TrajectoryWriter trajectory_;
  long every_;
  std::vector<long> frames_;
  std::size_t taken_ = 0;
  std::vector<Snapshot> snapshots_;
};

void write_pictures(const scene::Scene& scene, const std::vector<Snapshot>& snapshots,
                    const std::filesystem::path& out) {
  if (snapshots.empty()) return;
  const std::vector<output::Image> images = draw(scene, snapshots);
  std::vector<output::SheetCell> cells;
  for (std::size_t i = 0; i < images.size(); ++i) {
    output::write_png(images[i], out / fmt::format("frame_{:03d}.png", i));
    cells.push_back({images[i], fmt::format("t = {:.3f} s", snapshots[i].state.time)});
  }
  output::write_png(output::contact_sheet(cells, scene.spec.title), out / "contact_sheet.png");
}

/// Steps to the end of the scene or to the fault that stops it.
void loop(Simulation& simulation, Recorder& recorder, const RunOptions& options, RunResult& result) {
  const long steps = simulation.step_count();
  const long report_every = std::max(1L, steps / 200);
  recorder.see(0, simulation.engine());
  for (long i = 1; i <= steps; ++i) {
    try {
      simulation.step();
    } catch (const Error& error) {
      if (!error.fault()) throw;
      result.fault = error.fault();
      return;
    }
    recorder.see(i, simulation.engine());
    if (options.progress && i % report_every == 0)
      options.progress(static_cast<double>(i) / static_cast<double>(steps));
  }
}

}  // namespace

bool RunResult::passed() const {
  return !fault && std::all_of(verdicts.begin(), verdicts.end(), [](const Verdict& v) { return v.held(); });
}

RunResult run(const scene::Scene& scene, const RunOptions& options) {
  Simulation simulation(scene);
  output::make_folder(options.out);
  Recorder recorder(scene, options, simulation.step_count());
  RunResult result;
  const auto start = std::chrono::steady_clock::now();
  loop(simulation, recorder, options, result);
  result.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.simulated = simulation.state().time;
  result.verdicts = verdicts(simulation, scene.spec.criteria);
  result.summary = summary_json(scene, simulation, result);
  recorder.finish();
  write_pictures(scene, recorder.snapshots(), options.out);
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
