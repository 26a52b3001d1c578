#include "handsim/study/accuracy/accuracy.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/units.h"
#include "handsim/model/energy.h"
#include "handsim/model/kinematics.h"
#include "handsim/simulation/simulation.h"
#include "handsim/study/report.h"

namespace handsim::study {

/// Exact motions of the slider, rows of x and its rate; tests/support/slider_crank_reference.h makes them.
namespace references {
extern const std::string_view slider_crank_iftomm_csv, slider_crank_torque_csv;
}

namespace {

using model::Effect;

/// Longest simulated time over which a row is timed [s].
constexpr double kTimedSpan = 1;
/// Steps before the timed ones, which warm up caches and branch prediction.
constexpr long kWarmUpSteps = 500;

/// True if the scene conserves mechanical energy, except for the work of constant torques.
bool keeps_energy(const scene::Scene& scene) {
  const model::Effects& effects = scene.spec.solver.effects;
  if (effects.any_contact() || effects.has(Effect::joint_stops) || effects.has(Effect::wrist_motion))
    return false;
  if (!effects.has(Effect::passive_tissue)) return true;
  for (const model::Joint& joint : scene.model.joints)
    for (const model::JointAxis& axis : joint.axes)
      if (axis.tissue && axis.tissue->damping > 0) return false;
  return true;
}

/// A coordinate of a joint, or of a body's centre of mass along a world axis.
struct Observed {
  std::optional<std::size_t> dof;
  std::size_t body = 0;
  int axis = 0;

  double place(const model::State& s) const { return dof ? s.q[*dof] : s.bodies[body].p[axis]; }
  double rate(const model::State& s) const { return dof ? s.u[*dof] : s.bodies[body].v[axis]; }
};

/// The coordinates of a name, or all. @throws Error (input) if the model has nothing of this name.
std::vector<Observed> observed(const std::optional<std::string>& name, const model::Model& model) {
  std::vector<Observed> out;
  for (int i = 0; i < model.dof_count() && !name; ++i) out.push_back({static_cast<std::size_t>(i)});
  if (!name) return out;
  for (const model::Joint& joint : model.joints)
    if (joint.name == *name) out.push_back({static_cast<std::size_t>(joint.first_dof)});
  for (std::size_t i = 1; i < model.bodies.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      if (*name == model.bodies[i].name + "." + "xyz"[axis]) out.assign(1, {std::nullopt, i, axis});
  if (out.empty()) throw input_error("observe", *name, "a joint of the scene, or a body with .x, .y or .z");
  return out;
}

struct Motion {
  Series series;
  double gap = 0;
  std::optional<double> energy_error;
  std::string engine;  ///< name and version
};

/// Records a motion from the states after each step.
class MotionRecorder {
 public:
  MotionRecorder(const scene::Scene& scene, const std::optional<std::string>& name, double sample_every,
                 const model::State& start)
      : scene_(scene),
        observed_(observed(name, scene.model)),
        stride_(std::max(1L, std::lround(sample_every / scene.spec.solver.step))),
        start_(start),
        last_q_(start.q),
        start_energy_(energy(start)),
        largest_(model::kinetic_energy(scene.model, start)) {
    add(start);
  }

  void update(const model::State& state) {
    if (scene_.spec.solver.effects.has(Effect::actuation)) add_work(state.q);
    if (++steps_ % stride_ != 0) return;
    add(state);
    imbalance_ = std::max(imbalance_, std::abs(energy(state) - start_energy_));
    largest_ = std::max(largest_, model::kinetic_energy(scene_.model, state));
  }

  Motion finish(double gap) {
    out_.gap = gap;
    if (keeps_energy(scene_) && largest_ > 0) out_.energy_error = imbalance_ / largest_;
    return std::move(out_);
  }

 private:
  /// Adds a sample; coordinates are relative to their start.
  void add(const model::State& state) {
    Series& series = out_.series;
    series.time.push_back(state.time);
    std::vector<double>&q = series.q.emplace_back(), &rate = series.rate.emplace_back();
    for (const Observed& each : observed_) {
      q.push_back(each.place(state) - each.place(start_));
      rate.push_back(each.rate(state));
    }
  }

  /// Adds the work of the constant joint torques in a step.
  void add_work(const std::vector<double>& q) {
    for (const model::Joint& joint : scene_.model.joints)
      for (std::size_t a = 0; a < joint.axes.size(); ++a) {
        const auto i = static_cast<std::size_t>(joint.first_dof) + a;
        double moved = q[i] - last_q_[i];
        if (!joint.slides(a)) moved = std::remainder(moved, 2 * M_PI);
        work_ += joint.axes[a].torque * moved;
      }
    last_q_ = q;
  }

  double energy(const model::State& state) const {
    return model::kinetic_energy(scene_.model, state) +
           model::potential_energy(scene_.model, state, scene_.spec.solver.effects) - work_;
  }

  const scene::Scene& scene_;
  std::vector<Observed> observed_;
  long stride_, steps_ = 0;
  model::State start_;
  std::vector<double> last_q_;
  double work_ = 0, imbalance_ = 0;
  double start_energy_, largest_;
  Motion out_;
};

Motion record_motion(const scene::Scene& scene, const std::optional<std::string>& observe,
                     double sample_every) {
  simulation::Simulation simulation(scene);
  MotionRecorder recorder(scene, observe, sample_every, simulation.state());
  for (long i = 1; i <= simulation.step_count(); ++i) {
    simulation.step();
    recorder.update(simulation.state());
  }
  Motion motion = recorder.finish(simulation.get<simulation::Monitor>().joint_gap().value);
  motion.engine = simulation.engine().version();
  return motion;
}

/// Runs a part of a row, unless an earlier part failed; a fault of the physics becomes the row's.
template <class Part>
void attempt(AccuracyRow& row, const Part& part) {
  if (row.fault) return;
  try {
    part();
  } catch (const Error& error) {
    if (!error.fault()) throw;
    row.fault = error.what();
  }
}

/// A row that is not finished.
struct Job {
  const AccuracyMethod* method = nullptr;
  scene::Scene scene;
  AccuracyRow row;
  std::vector<double> costs;  ///< CPU seconds for a simulated second, of each round
};

Motion record_job(const AccuracySpec& spec, const Job& job) {
  const std::optional<std::string>& observe = job.method->observe ? job.method->observe : spec.observe;
  if (!job.method->outside) return record_motion(job.scene, observe, spec.sample_every);
  simulation::Monitor monitor(job.scene.model, job.scene.spec.solver.step, false);
  std::optional<MotionRecorder> recorder;
  const auto update = [&](const model::State& state) {
    if (!recorder) {
      recorder.emplace(job.scene, observe, spec.sample_every, state);
    } else {
      monitor.update(state);
      recorder->update(state);
    }
  };
  const std::string engine = job.method->outside->simulate(job.scene, update);
  Motion motion = recorder->finish(monitor.joint_gap().value);
  motion.engine = engine;
  return motion;
}

/// CPU seconds per simulated second of the simulation loop alone.
double cost(const Job& job) {
  const double h = job.scene.spec.solver.step;
  const long steps = std::max(1L, std::lround(std::min(job.scene.spec.duration, kTimedSpan) / h));
  const double simulated = static_cast<double>(steps) * h;
  if (job.method->outside) return job.method->outside->cpu_seconds(job.scene, steps) / simulated;
  return cpu_seconds(job.scene, std::min(steps, kWarmUpSteps), steps) / simulated;
}

Series slider_crank_series(std::string_view rows, double duration, double every) {
  constexpr double kRowEvery = 0.01;
  const long stride = std::lround(every / kRowEvery), count = std::lround(duration / every) + 1;
  if (stride < 1 || std::abs(static_cast<double>(stride) * kRowEvery - every) > 1e-9)
    throw input_error("sample_every", fmt::format("{:g} s", every),
                      "a multiple of 10 ms, as the reference has");
  Series out;
  double start = 0;
  rows.remove_prefix(rows.find('\n') + 1);
  for (long row = 0; !rows.empty() && std::ssize(out.time) < count; ++row) {
    double x = 0, rate = 0;
    const char* const comma = std::from_chars(rows.data(), rows.data() + rows.size(), x).ptr;
    std::from_chars(comma + 1, rows.data() + rows.size(), rate);
    rows.remove_prefix(rows.find('\n') + 1);
    if (row == 0) start = x;
    if (row % stride != 0) continue;
    out.time.push_back(static_cast<double>(out.time.size()) * every);
    out.q.push_back({x - start});
    out.rate.push_back({rate});
  }
  if (std::ssize(out.time) < count)
    throw input_error("duration", fmt::format("{:g} s", duration),
                      fmt::format("at most {:g} s, as the reference has", out.time.back()));
  return out;
}

/// RMS of the differences up to a time.
double rms(const std::vector<std::vector<double>>& a, const std::vector<std::vector<double>>& b,
           const std::vector<double>& time, double until) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    if (time[i] > until * (1 + 1e-9)) break;
    for (std::size_t k = 0; k < a[i].size(); ++k, ++count) sum += (a[i][k] - b[i][k]) * (a[i][k] - b[i][k]);
  }
  return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0;
}

void compare(AccuracyRow& row, const Series& reference, double early) {
  const double all = reference.time.back();
  row.rate_error = rms(row.series.rate, reference.rate, reference.time, all);
  row.early_rate_error = rms(row.series.rate, reference.rate, reference.time, early);
  row.position_error = rms(row.series.q, reference.q, reference.time, all);
}

std::optional<Series> make_reference(const AccuracySpec& spec) {
  if (spec.reference == Reference::smallest_step) return std::nullopt;
  const scene::Scene scene = scene::load_scene(spec.scene, spec.reference_set);
  if (spec.reference == Reference::method)
    return record_motion(scene, spec.observe, spec.sample_every).series;
  return slider_crank_series(spec.reference == Reference::slider_crank_iftomm
                                 ? references::slider_crank_iftomm_csv
                                 : references::slider_crank_torque_csv,
                             scene.spec.duration, spec.sample_every);
}

Job make_job(const AccuracySpec& spec, const AccuracyMethod& method, double step) {
  std::vector<std::string> set = method.set;
  set.push_back("solver.step=" + number_text(step));
  Job job;
  job.method = &method;
  job.scene = scene::load_scene(method.scene.value_or(spec.scene), set);
  if (!method.outside)
    job.row.command = command_text({"run", method.scene.value_or(spec.scene).string()}, set);
  job.row.method = method.name;
  job.row.step = step;
  return job;
}

/// Compares the rows of one method with the reference, and drops motions that no plot shows.
void compare_all(const AccuracySpec& spec, std::vector<Job>& jobs, std::size_t first, std::size_t end,
                 const Series& reference) {
  for (std::size_t i = first; i < end; ++i) {
    AccuracyRow& row = jobs[i].row;
    if (!row.fault && !reference.time.empty()) compare(row, reference, spec.early);
    const bool plotted =
        std::ranges::any_of(spec.plot_steps, [&](double step) { return std::abs(step - row.step) < 1e-12; });
    if (!plotted || jobs[i].method->scene) row.series = {};
  }
}

/// Number of steps of a row's motion, or of one timing, for the progress bar.
double work(const Job& job, bool motion) {
  const double duration = job.scene.spec.duration;
  return (motion ? duration : std::min(duration, kTimedSpan)) / job.scene.spec.solver.step;
}

std::string unit_of(const AccuracySpec& spec) {
  const scene::Scene scene = scene::load_scene(spec.scene);
  for (const model::Joint& joint : scene.model.joints)
    if (spec.observe && joint.name == *spec.observe) return joint.unit(0);
  return "rad";
}

/// The rates of the first observed coordinate, which a plot shows.
Json series_json(const Series& series) {
  Json rates = Json::array();
  for (const std::vector<double>& each : series.rate) rates.push_back(each.at(0));
  return {{"time", series.time}, {"rate", rates}};
}

Json row_json(const AccuracyRow& row) {
  return {{"method", row.method},
          {"step", row.step},
          {"fault", row.fault ? Json(*row.fault) : Json()},
          {"own_reference", row.own_reference},
          {"is_reference", row.is_reference},
          {"rate_error", row.rate_error},
          {"early_rate_error", row.early_rate_error},
          {"position_error", row.position_error},
          {"gap", row.gap},
          {"energy_error", row.energy_error ? Json(*row.energy_error) : Json()},
          {"cpu", row.cpu_per_second},
          {"series", series_json(row.series)},
          {"command", row.command}};
}

}  // namespace

double cpu_seconds(const scene::Scene& scene, long warm_up, long steps) {
  if (warm_up > 0) {
    simulation::Simulation simulation(scene);
    for (long i = 0; i < warm_up; ++i) simulation.step();
  }
  simulation::Simulation simulation(scene);
  const double start = cpu_now();
  for (long i = 0; i < steps; ++i) simulation.step();
  return cpu_now() - start;
}

AccuracyResult run_accuracy(const AccuracySpec& spec, const std::function<void(double)>& progress) {
  AccuracyResult result;
  result.unit = unit_of(spec);
  std::vector<Job> jobs;
  double total = 0, done = 0;
  for (const AccuracyMethod& method : spec.methods)
    for (const double step : method.steps) {
      jobs.push_back(make_job(spec, method, step));
      total += work(jobs.back(), true) + spec.repeats * work(jobs.back(), false);
    }
  // After the jobs, whose scenes may be refused.
  result.reference = make_reference(spec);
  const auto report = [&](const Job& job, bool motion) {
    done += work(job, motion);
    if (progress) progress(done / total);
  };

  for (std::size_t first = 0, end = 0; first < jobs.size(); first = end) {
    for (end = first; end < jobs.size() && jobs[end].method == jobs[first].method; ++end) {
      Job& job = jobs[end];
      attempt(job.row, [&] {
        Motion motion = record_job(spec, job);
        job.row.series = std::move(motion.series);
        job.row.gap = motion.gap;
        job.row.energy_error = motion.energy_error;
        if (std::ranges::find(result.engines, motion.engine) == result.engines.end())
          result.engines.push_back(motion.engine);
      });
      report(job, true);
    }
    const bool own = !result.reference || jobs[first].method->scene;
    for (std::size_t i = first; i < end; ++i) jobs[i].row.own_reference = own;
    jobs[end - 1].row.is_reference = own;
    compare_all(spec, jobs, first, end, own ? Series(jobs[end - 1].row.series) : *result.reference);
  }
  for (int round = 0; round < spec.repeats; ++round)
    for (Job& job : jobs) {
      attempt(job.row, [&] { job.costs.push_back(cost(job)); });
      report(job, false);
    }
  for (Job& job : jobs) {
    if (!job.row.fault) job.row.cpu_per_second = median(std::move(job.costs));
    result.rows.push_back(std::move(job.row));
  }
  return result;
}

std::string rows_text(const AccuracySpec& spec, const AccuracyResult& result) {
  Json out = {{"title", spec.title},
              {"early", spec.early},
              {"plot_steps", spec.plot_steps},
              {"unit", result.unit},
              {"engines", result.engines},
              {"reference", result.reference ? series_json(*result.reference) : Json()},
              {"methods", Json::array()},
              {"rows", Json::array()}};
  for (const AccuracyMethod& method : spec.methods)
    out["methods"].push_back({{"name", method.name},
                              {"line", method.line ? Json(*method.line) : Json()},
                              {"own_scene", method.scene.has_value()},
                              {"outside", method.outside.has_value()}});
  for (const AccuracyRow& row : result.rows) out["rows"].push_back(row_json(row));
  return out.dump();
}

}  // namespace handsim::study
