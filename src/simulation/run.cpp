#include "handsim/simulation/run.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "handsim/model/kinematics.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/contact_sheet.h"
#include "handsim/simulation/pictures.h"
#include "handsim/simulation/plots.h"
#include "handsim/simulation/recorder.h"
#include "handsim/simulation/simulation.h"
#include "handsim/simulation/summary.h"

namespace handsim::simulation {

namespace {

/// Pictures on a contact sheet at most; more are thinned out evenly, the first and the last among them.
constexpr std::size_t kSheetCells = 100;

/// Each picture goes to its file, and smaller onto the sheet, as it is drawn.
void write_pictures(const scene::Scene& scene, const Recorder& recorder, const RunOptions& options) {
  const std::span<const Snapshot> snapshots = recorder.snapshots();
  if (snapshots.empty()) return;
  const std::size_t count = snapshots.size(), cells = std::min(count, kSheetCells);
  const auto [width, height] = scene.spec.pictures.size;
  std::string title = scene.spec.title;
  if (const auto scale = force_scale(scene, snapshots))
    title += fmt::format(" (contact forces: {:g} mm for 1 N)", 1e3 * *scale);
  output::ContactSheet sheet({static_cast<int>(cells), width, height, title});
  const std::size_t digits = std::max<std::size_t>(3, std::to_string(count - 1).size());
  std::size_t cell = 0;
  draw(scene, snapshots, [&](std::size_t i, const output::Image& image) {
    output::write_png(image, options.out / fmt::format("frame_{:0{}d}.png", i, digits));
    if (cells == 1 || i * (cells - 1) >= cell * (count - 1)) {
      sheet.add(image, recorder.captions()[i]);
      ++cell;
    }
    if (options.progress) options.progress(static_cast<double>(i + 1) / static_cast<double>(count));
  });
  output::write_png(sheet.image(), options.out / "contact_sheet.png");
}

/// The step after which a snapshot is written.
std::optional<long> snapshot_step(const Simulation& simulation, const RunOptions& options, double step) {
  if (!options.snapshot_at) return std::nullopt;
  const double at = *options.snapshot_at / step;
  const auto first = static_cast<double>(simulation.steps());
  const auto last = static_cast<double>(simulation.step_count());
  if (!(at >= first - 0.5 && at <= last + 0.5))
    throw input_error("--snapshot-at", fmt::format("{:g} s", *options.snapshot_at),
                      fmt::format("{:g} s to {:g} s, which the run goes through", first * step, last * step));
  return std::clamp(std::lround(at), simulation.steps(), simulation.step_count());
}

void go_on(Simulation& simulation, const std::filesystem::path& file, double duration, RunResult& result) {
  const RunSnapshot snapshot = read_snapshot(file);
  if (!(snapshot.time < duration))
    throw input_error(file.string(), fmt::format("a snapshot at {:g} s", snapshot.time),
                      fmt::format("one before the scene's end at {:g} s", duration));
  try {
    simulation.restore(snapshot);
  } catch (const Error& error) {
    std::vector<Problem> problems = error.problems();
    for (Problem& problem : problems) problem.key = file.string();
    if (problems.empty()) throw;
    throw Error(std::move(problems));
  }
  result.continued_from = simulation.state().time;
}

/// Steps to the end of the scene or to the fault that stops it.
void loop(Simulation& simulation, Recorder& recorder, const RunOptions& options, double step,
          RunResult& result) {
  const long steps = simulation.step_count();
  const long report_every = std::max(1L, steps / 200);
  const std::optional<long> snapshot = snapshot_step(simulation, options, step);
  const auto see = [&](long i) {
    recorder.see(i);
    if (snapshot == i) write_snapshot(simulation.snapshot(), options.out / "snapshot.bin");
  };
  see(simulation.steps());
  for (long i = simulation.steps() + 1; i <= steps && !simulation.over(); ++i) {
    try {
      simulation.step();
    } catch (const Error& error) {
      if (!error.fault()) throw;
      result.fault = error.fault();
      return;
    }
    see(i);
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

/// Names that a run may give to files.
constexpr std::array kWritten = {"trajectory.csv", "trajectory.mot", "control.sto",  "contacts.csv",
                                 "summary.json",   "snapshot.bin",   "resolved.yaml"};

/// A run that writes over what its scene reads could not be run again.
void check_inputs_kept(const scene::Scene& scene, const RunOptions& options) {
  const auto canonical = [](const std::filesystem::path& path) {
    std::error_code failure;
    return std::filesystem::weakly_canonical(path, failure);
  };
  const auto check = [&](const std::filesystem::path& input, const std::string& written) {
    if (canonical(input) == canonical(options.out / written))
      throw input_error(
          "--out",
          fmt::format("{}, whose {} the run reads and would write over", options.out.string(), written),
          "another folder");
  };
  for (const scene::InputFile& input : scene.inputs) {
    for (const char* name : kWritten) check(input.path, name);
    for (const scene::InputFile& other : scene.inputs)
      if (&other != &input) check(input.path, other.copy);
  }
  if (options.from_snapshot && options.snapshot_at) check(*options.from_snapshot, "snapshot.bin");
}

void write_inputs(const scene::Scene& scene, const std::filesystem::path& out) {
  if (!scene.inputs.empty()) output::make_folder(out / "inputs");
  for (const scene::InputFile& input : scene.inputs) output::write_file(out / input.copy, *input.bytes);
}

}  // namespace

bool RunResult::judged() const {
  return std::any_of(verdicts.begin(), verdicts.end(), [](const Verdict& v) { return v.limit.has_value(); });
}

bool RunResult::failed() const {
  return std::any_of(verdicts.begin(), verdicts.end(), [](const Verdict& v) { return v.failed(); });
}

bool RunResult::missed() const {
  return std::any_of(verdicts.begin(), verdicts.end(), [](const Verdict& v) { return v.missed(); });
}

bool RunResult::passed() const { return !fault && hash_as_expected() && !failed() && !missed(); }

RunResult run(const scene::Scene& scene, const RunOptions& options) {
  if (options.plots || options.pose_pictures) check_controlled(scene, options);
  Simulation simulation(scene);
  RunResult result;
  const double step = scene.spec.solver.step;
  if (options.from_snapshot) go_on(simulation, *options.from_snapshot, scene.spec.duration, result);
  static_cast<void>(snapshot_step(simulation, options, step));
  check_inputs_kept(scene, options);
  const std::string resolved = scene::standalone_text(scene.resolved, scene.inputs);
  output::make_folder(options.out);
  Recorder recorder(scene, options, simulation);
  const auto start = std::chrono::steady_clock::now();
  loop(simulation, recorder, options, step, result);
  result.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.simulated = simulation.state().time;
  result.tracking = simulation.tracking();
  result.state_hash = simulation.state_hash();
  result.warnings = simulation.convergence().warnings(simulation.ledger(), scene.spec.solver);
  result.expected_hash = options.expected_hash;
  result.grasps = simulation.grasps();
  result.climbs = simulation.climbs();
  result.verdicts = verdicts(simulation, scene.spec.criteria);
  result.overlaps = engine::initial_overlaps(scene.model, model::initial_state(scene.model));
  result.summary = summary_json(scene, simulation, result);
  recorder.finish();
  write_pictures(scene, recorder, options);
  if (options.plots) write_plots(scene, options.out);
  write_inputs(scene, options.out);
  output::write_file(options.out / "resolved.yaml", resolved);
  output::write_file(options.out / "summary.json", result.summary);
  return result;
}

output::Image picture(const scene::Scene& scene, double time) {
  Simulation simulation(scene);
  const long steps = std::lround(time / scene.spec.solver.step);
  for (long i = 0; i < steps; ++i) simulation.step();
  return draw(scene, snapshot(simulation.engine()));
}

}  // namespace handsim::simulation
