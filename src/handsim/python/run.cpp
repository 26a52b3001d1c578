#include "handsim/simulation/run/run.h"

#include <chrono>

#include "handsim/app/commands.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/report/page.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"
#include "handsim/python/frame.h"
#include "handsim/python/signals.h"
#include "handsim/scene/read/engine_choice.h"
#include "handsim/simulation/run/output_size.h"
#include "handsim/simulation/run/step_choice.h"
#include "handsim/simulation/simulation.h"
#include "handsim/study/rollouts/rollout_figures.h"

namespace handsim::python {

namespace {

/// A run without files.
struct Finished {
  simulation::RunResult result;
  std::vector<double> rows;  ///< of trajectory_columns
  std::vector<Frame> frames;
  study::NamedCells figures;
};

/// The run of a scene in memory: as simulation::run, whose files are tables and frames here.
class MemoryRun {
 public:
  MemoryRun(const ScenePtr& scene, int frames, bool stop_lost)
      : scene_(scene), simulation_(scene), frames_(frames), stop_lost_(stop_lost) {}

  Finished run(Signals& signals) {
    const auto start = std::chrono::steady_clock::now();
    loop(signals);
    simulation::RunResult& result = out_.result;
    result.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    result.simulated = simulation_.state().time;
    result.tracking = simulation_.figures<simulation::Tracking>();
    result.state_hash = simulation_.state_hash();
    result.warnings = simulation_.warnings();
    result.grasps = simulation_.figures<simulation::Grasps>();
    result.climbs = simulation_.figures<simulation::Climbs>();
    result.verdicts = simulation_.verdicts();
    result.overlaps = engine::initial_overlaps(scene_->model, model::initial_state(scene_->model));
    result.summary = simulation::summary_json(simulation_, result);
    out_.figures = study::figures_of(simulation_);
    return std::move(out_);
  }

 private:
  void loop(Signals& signals) {
    const long steps = simulation_.step_count();
    record();
    try {
      while (simulation_.steps() < steps && !simulation::over(simulation_, stop_lost_)) {
        simulation_.step();
        record();
        signals.poll(static_cast<double>(simulation_.steps()) / static_cast<double>(steps));
      }
    } catch (const Error& error) {
      if (!error.fault()) throw;
      out_.result.fault = error.fault();
    }
  }
  void record() {
    const long step = simulation_.steps(), steps = simulation_.step_count();
    if (step % simulation::record_steps(scene_->spec) == 0) {
      const std::vector<double> row = output::trajectory_values(simulation_.state());
      out_.rows.insert(out_.rows.end(), row.begin(), row.end());
    }
    // The first frame is of the start, the last of the end.
    const auto taken = static_cast<long>(out_.frames.size());
    if (taken < frames_ && step * (frames_ - 1) >= taken * steps)
      out_.frames.push_back({simulation::picture_state(simulation_.engine())});
  }

  ScenePtr scene_;
  simulation::Simulation simulation_;
  long frames_;
  bool stop_lost_;
  Finished out_;
};

py::object cell(const study::Cell& of) {
  if (const auto* number = std::get_if<double>(&of)) return py::float_(*number);
  if (const auto* text = std::get_if<std::string>(&of)) return py::str(*text);
  return py::none();
}

py::dict result_dict(const simulation::RunResult& result) {
  py::dict out;
  out["verdicts"] = verdict_list(result.verdicts);
  out["passed"] = result.passed();
  out["fault"] = result.fault ? py::object(py::make_tuple(result.fault->time, result.fault->where,
                                                          result.fault->quantity, result.fault->detail))
                              : py::none();
  out["simulated"] = result.simulated;
  out["wall"] = result.wall;
  out["summary"] = result.summary;
  out["warnings"] = result.warnings;
  out["state_hash"] = simulation::hash_text(result.state_hash);
  out["missing"] = result.missing;
  return out;
}

/// The scene itself, if it names its step.
ScenePtr at_its_step(const ScenePtr& scene, Signals& signals) {
  if (!scene::asks_for_step(scene->resolved)) return scene;
  return std::make_shared<const scene::Scene>(simulation::with_chosen_step(*scene, [&] { signals.poll(0); }));
}

py::dict run_scene(const SceneHandle& of, int frames, bool stop_lost, const py::object& progress) {
  Signals signals(progress);
  const Finished run =
      without_gil([&] { return MemoryRun(at_its_step(of.scene, signals), frames, stop_lost).run(signals); });
  py::dict out = result_dict(run.result);
  const std::vector<std::string> columns = output::trajectory_columns(of.scene->model);
  out["columns"] = columns;
  out["rows"] = array_of(run.rows, columns.size());
  py::dict figures;
  for (const auto& [name, value] : run.figures) figures[py::str(name)] = cell(value);
  out["figures"] = figures;
  out["frames"] = run.frames;
  return out;
}

/// With files, as `handsim run`. @param video file, frames in a second, and speed; or None.
py::dict run_to_folder(const SceneHandle& of, const std::filesystem::path& folder, int frames, bool poses,
                       bool plots, bool report, const std::optional<VideoChoice>& video, bool stop_lost,
                       const py::object& progress) {
  Signals signals(progress);
  simulation::RunOptions options;
  options.out = folder;
  options.frames = frames;
  options.pose_pictures = poses;
  options.plots = plots;
  options.monitor = report;
  if (video) options.video = video_of(*video);
  options.stop_lost = stop_lost;
  options.progress = [&signals](double share) { signals.poll(share); };
  return result_dict(without_gil([&] {
    const ScenePtr own = at_its_step(of.scene, signals);
    if (!report) return simulation::run(*own, options);
    output::require_three();
    scene::Scene scene = *own;
    app::record_contacts(scene);
    return simulation::run(scene, options);
  }));
}

}  // namespace

py::list verdict_list(const std::vector<simulation::Verdict>& verdicts) {
  py::list out;
  for (const simulation::Verdict& v : verdicts)
    out.append(py::make_tuple(v.name, v.unit, v.measured, v.limit, v.least, v.held(), v.time, v.where));
  return out;
}

void bind_run(py::module_& module) {
  module.def("run", &run_scene);
  module.def("run_to_folder", &run_to_folder);
}

}  // namespace handsim::python
