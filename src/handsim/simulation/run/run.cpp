#include "handsim/simulation/run/run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <new>

#include <fmt/format.h>

#include "handsim/model/kinematics.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/child.h"
#include "handsim/output/render/contact_sheet.h"
#include "handsim/output/video/video.h"
#include "handsim/simulation/run/output_size.h"
#include "handsim/simulation/run/recorder.h"
#include "handsim/simulation/run/snapshot_file.h"
#include "handsim/simulation/simulation.h"

namespace handsim::simulation {

namespace {

/// Pictures on a contact sheet at most; more are thinned out evenly, the first and the last among them.
constexpr std::size_t kSheetCells = 100;

Drawing drawing_of(const RunOptions& options) {
  return {options.gl, options.draw_apart ? output::core_count() : 1, 0};
}

/// Each picture goes to its file, and smaller onto the sheet, as it is drawn.
void draw_pictures(const scene::Scene& scene, const Recorder& recorder, const RunOptions& options,
                   const output::Progress& progress) {
  const std::span<const PictureState> moments = recorder.moments();
  const std::size_t count = moments.size(), cells = std::min(count, kSheetCells);
  const scene::PictureSpec& pictures = scene.spec.pictures;
  const auto [width, height] = pictures.size;
  output::SheetFormat format = {static_cast<int>(cells), width, height, scene.spec.title};
  format.force_scale = force_scale(pictures, moments);
  output::ContactSheet sheet(format);
  const std::size_t digits = std::max<std::size_t>(3, std::to_string(count - 1).size());
  const auto store = [&](std::size_t i, const output::Image& image) {
    output::write_png(image, options.out / fmt::format("frame_{:0{}d}.png", i, digits));
  };
  std::size_t cell = 0;
  draw({scene.model, pictures}, moments, drawing_of(options), store,
       [&](std::size_t i, const Picture& picture) {
         if (cells == 1 || i * (cells - 1) >= cell * (count - 1)) {
           sheet.add(picture.image, moments[i].caption, picture.scale);
           ++cell;
         }
         if (progress) progress(static_cast<double>(i + 1) / static_cast<double>(count));
       });
  output::write_png(sheet.image(), options.out / "contact_sheet.png");
}

/// Why something could not be drawn.
template <class Draw>
std::optional<std::string> failure_of(const Draw& draw) {
  try {
    draw();
  } catch (const std::bad_alloc&) {
    return "out of memory";
  } catch (const std::exception& error) {
    return error.what();
  }
  return std::nullopt;
}

/// Draws what was asked for; what cannot be drawn is missing, the run's other files are there.
void draw_all(const scene::Scene& scene, const Recorder& recorder, const RunOptions& options,
              RunResult& result) {
  result.missing.clear();
  const auto made = [&](const char* what, const std::function<void(const output::Progress&)>& job) {
    const std::optional<std::string> failure = options.draw_apart
                                                   ? output::run_in_child(job, options.progress)
                                                   : failure_of([&] { job(options.progress); });
    if (failure) result.missing.push_back(std::string(what) + ": " + *failure);
  };
  if (!recorder.moments().empty())
    made("pictures", [&](const auto& progress) { draw_pictures(scene, recorder, options, progress); });
  if (const Film* film = recorder.film())
    made("video", [&](const output::Progress& progress) {
      film->write(scene.spec.pictures, drawing_of(options), progress);
    });
  if (!options.plots) return;
  if (const auto failure = failure_of([&] { write_plots(scene, options.out); }))
    result.missing.push_back("plots: " + *failure);
}

/// All that has to be there whatever becomes of the pictures; then those.
void write_files(const Simulation& simulation, const RunOptions& options, const std::string& resolved,
                 Recorder& recorder, RunResult& result) {
  const scene::Scene& scene = simulation.scene();
  recorder.finish();
  if (!scene.inputs.empty()) output::make_folder(options.out / "inputs");
  for (const auto& input : scene.inputs) output::write_file(options.out / input.copy, *input.bytes);
  output::write_file(options.out / "resolved.yaml", resolved);
  if (!recorder.moments().empty()) result.missing.emplace_back("pictures: not drawn yet");
  if (recorder.film()) result.missing.emplace_back("video: not drawn yet");
  if (options.plots) result.missing.emplace_back("plots: not drawn yet");
  const bool draws = !result.missing.empty();
  const auto write_summary = [&] {
    result.summary = summary_json(simulation, result);
    output::write_file(options.out / "summary.json", result.summary);
  };
  write_summary();
  if (!draws) return;
  draw_all(scene, recorder, options, result);
  // The first summary stays where pictures have filled the disk.
  if (const auto failure = failure_of(write_summary)) result.missing.push_back("summary: " + *failure);
}

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

void continue_from(Simulation& simulation, const std::filesystem::path& file, double duration,
                   RunResult& result) {
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

/// The caller's scene, which outlives the run.
Simulation simulation_of(const scene::Scene& scene, MakeWatchers watchers) {
  return Simulation(std::shared_ptr<const scene::Scene>(std::shared_ptr<void>(), &scene),
                    std::move(watchers));
}

/// Steps to the end of the scene or to the fault that stops it.
void loop(Simulation& simulation, Recorder& recorder, const RunOptions& options, double step,
          RunResult& result) {
  const long steps = simulation.step_count();
  const long report_every = std::clamp(steps / 200, 1L, 50L);
  const std::optional<long> snapshot = snapshot_step(simulation, options, step);
  const auto record = [&](long i) {
    recorder.record(i);
    if (snapshot == i) write_snapshot(simulation.snapshot(), options.out / "snapshot.bin");
  };
  record(simulation.steps());
  for (long i = simulation.steps() + 1; i <= steps && !over(simulation, options.stop_lost); ++i) {
    try {
      simulation.step();
    } catch (const Error& error) {
      if (!error.fault()) throw;
      result.fault = error.fault();
      return;
    }
    record(i);
    if (options.progress && i % report_every == 0)
      options.progress(static_cast<double>(i) / static_cast<double>(steps));
  }
}

/// Refuses options that only a controlled scene has.
void check_controlled(const scene::Scene& scene, const RunOptions& options) {
  if (!scene.control)
    throw input_error(options.plots ? "--plots" : "--poses", "a scene without a control block",
                      "a scene that drives its hands");
  if (options.plots) need_gnuplot();
}

}  // namespace

bool over(const Simulation& simulation, bool stop_lost) {
  const Grasps* grasps = simulation.find<Grasps>();
  if (stop_lost && grasps && grasps->decided(simulation.state().time)) return true;
  const Climbs* climbs = simulation.find<Climbs>();
  return climbs && climbs->over() && !grasps;
}

bool RunResult::judged() const {
  return std::ranges::any_of(verdicts, [](const Verdict& v) { return v.limit.has_value(); });
}

bool RunResult::failed() const { return std::ranges::any_of(verdicts, std::mem_fn(&Verdict::failed)); }

bool RunResult::missed() const { return std::ranges::any_of(verdicts, std::mem_fn(&Verdict::missed)); }

bool RunResult::passed() const { return !fault && hash_as_expected() && !failed() && !missed(); }

output::OutputFolder run_folder(const scene::Scene& scene, const RunOptions& options) {
  const auto read = [&] {
    std::vector<std::filesystem::path> out = scene::files_read(scene);
    if (options.from_snapshot) out.push_back(*options.from_snapshot);
    return out;
  };
  std::vector<std::string> names = {"trajectory.csv",    "trajectory.mot", "control.sto",   "muscles.sto",
                                    "contacts.csv",      "summary.json",   "resolved.yaml", "snapshot.bin",
                                    "contact_sheet.png", "monitor.csv",    "report.html"};
  for (std::string& name : extra_table_files()) names.push_back(std::move(name));
  // At least three digits, and five for the most pictures that there may be.
  for (const char* digits : {"[0-9][0-9][0-9]", "[0-9][0-9][0-9][0-9]", "[0-9][0-9][0-9][0-9][0-9]"})
    names.push_back(fmt::format("frame_{}.png", digits));
  for (const char* plot : {"angles", "errors", "torques"})
    for (const char* kind : {"gp", "png"}) names.push_back(fmt::format("plots/*_{}.{}", plot, kind));
  for (const scene::ReferencedFile& input : scene.inputs) names.push_back(input.copy);
  for (std::string& copy : scene::copies_named_in(options.out / "resolved.yaml"))
    names.push_back(std::move(copy));
  if (options.video && options.video->file.parent_path() == options.out)
    names.push_back(options.video->file.filename().string());
  return {options.out, std::move(names), read};
}

RunResult run(const scene::Scene& scene, const RunOptions& options) { return run(scene, options, nullptr); }

RunResult run(const scene::Scene& scene, const RunOptions& options, const output::OutputFolder* held) {
  if (options.plots || options.pose_pictures) check_controlled(scene, options);
  if (options.video)
    output::check_video(options.video->file, options.video->fps, [&] { return scene::files_read(scene); });
  Simulation simulation = simulation_of(scene, standard_watchers);
  RunResult result;
  const double step = scene.spec.solver.step;
  if (options.from_snapshot) continue_from(simulation, *options.from_snapshot, scene.spec.duration, result);
  static_cast<void>(snapshot_step(simulation, options, step));
  const std::string resolved = scene::standalone_text(scene.resolved, scene.inputs);
  const int pictures = options.pose_pictures
                           ? static_cast<int>(scene.control->hands.front().trajectory.phases().size())
                           : options.frames;
  const OutputSize size = output_size(scene, simulation.steps(), simulation.step_count(), pictures);
  if (const auto note = check_room(scene, size, options.out); note && options.note) options.note(*note);
  std::optional<output::OutputFolder> own;
  if (!held) own.emplace(run_folder(scene, options));
  (held ? *held : *own).clear();
  Recorder recorder(simulation, options);
  const auto start = std::chrono::steady_clock::now();
  const double from = simulation.state().time;
  loop(simulation, recorder, options, step, result);
  result.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.simulated = simulation.state().time - from;
  result.tracking = simulation.figures<Tracking>();
  result.state_hash = simulation.state_hash();
  result.warnings = simulation.warnings();
  result.expected_hash = options.expected_hash;
  result.grasps = simulation.figures<Grasps>();
  result.climbs = simulation.figures<Climbs>();
  result.verdicts = simulation.verdicts();
  result.overlaps = engine::initial_overlaps(scene.model, model::initial_state(scene.model));
  write_files(simulation, options, resolved, recorder, result);
  return result;
}

PictureState picture_state_at(const scene::Scene& scene, double time) {
  Simulation simulation = simulation_of(scene, only<Monitor>);
  const long steps = std::lround(time / scene.spec.solver.step);
  for (long i = 0; i < steps; ++i) simulation.step();
  return picture_state(simulation.engine());
}

}  // namespace handsim::simulation
