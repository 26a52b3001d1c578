#include "handsim/study/accuracy.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/units.h"
#include "handsim/model/energy.h"
#include "handsim/model/kinematics.h"
#include "handsim/simulation/simulation.h"
#include "handsim/study/machine.h"
#include "handsim/study/slider_crank_reference.h"

namespace handsim::study {

namespace {

using model::Effect;

/// Simulated time that a row is timed over, where the scene lasts longer [s].
constexpr double kTimedSpan = 1;

/// Whether the scene's effects keep mechanical energy but for the work of constant torques.
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

/// Work of the constant joint torques, from coordinates unwound step by step.
class WorkMeter {
 public:
  WorkMeter(const scene::Scene& scene, const model::State& start)
      : model_(scene.model),
        on_(scene.spec.solver.effects.has(Effect::actuation)),
        last_(model::coordinates(model_, start)) {}

  void look(const model::State& state) {
    if (!on_) return;
    const std::vector<double> q = model::coordinates(model_, state);
    for (const model::Joint& joint : model_.joints)
      for (std::size_t a = 0; a < joint.axes.size(); ++a) {
        const auto i = static_cast<std::size_t>(joint.first_dof) + a;
        double moved = q[i] - last_[i];
        if (joint.kind != model::JointKind::slider) moved = std::remainder(moved, 2 * M_PI);
        work_ += joint.axes[a].torque * moved;
      }
    last_ = q;
  }
  double work() const { return work_; }

 private:
  const model::Model& model_;
  bool on_;
  std::vector<double> last_;
  double work_ = 0;
};

/// What is compared of a state.
class Observer {
 public:
  Observer(const std::optional<std::string>& name, const model::Model& model) : model_(model) {
    if (!name) {
      for (int i = 0; i < model.dof_count(); ++i) dofs_.push_back(static_cast<std::size_t>(i));
      return;
    }
    for (const model::Joint& joint : model.joints)
      if (joint.name == *name) dofs_.push_back(static_cast<std::size_t>(joint.first_dof));
    for (std::size_t i = 1; i < model.bodies.size(); ++i)
      for (int axis = 0; axis < 3; ++axis)
        if (*name == model.bodies[i].name + "." + "xyz"[axis]) {
          body_ = i;
          axis_ = axis;
        }
    if (dofs_.empty() && !body_)
      throw input_error("observe", *name, "a joint of the scene, or a body with .x, .y or .z");
  }

  void add(Series& series, const model::State& state) const {
    std::vector<double> q, rate;
    if (body_) {
      q.push_back(state.bodies[*body_].p[axis_]);
      rate.push_back(state.bodies[*body_].v[axis_]);
    } else {
      const std::vector<double> all_q = model::coordinates(model_, state);
      const std::vector<double> all_rates = model::rates(model_, state);
      for (const std::size_t i : dofs_) {
        q.push_back(all_q[i]);
        rate.push_back(all_rates[i]);
      }
    }
    series.time.push_back(state.time);
    series.q.push_back(std::move(q));
    series.rate.push_back(std::move(rate));
  }

 private:
  const model::Model& model_;
  std::vector<std::size_t> dofs_;
  std::optional<std::size_t> body_;
  int axis_ = 0;
};

/// Positions are compared less their start.
void subtract_start(Series& series) {
  const std::vector<double> start = series.q.front();
  for (std::vector<double>& q : series.q)
    for (std::size_t i = 0; i < q.size(); ++i) q[i] -= start[i];
}

struct Motion {
  Series series;
  double gap = 0;
  std::optional<double> energy_error;
};

Motion follow(const scene::Scene& scene, const std::optional<std::string>& observe, double sample_every) {
  simulation::Simulation simulation(scene);
  const Observer observer(observe, scene.model);
  const long stride = std::max(1L, std::lround(sample_every / scene.spec.solver.step));
  const model::Effects& effects = scene.spec.solver.effects;
  WorkMeter meter(scene, simulation.state());
  const auto energy = [&] {
    return model::kinetic_energy(scene.model, simulation.state()) +
           model::potential_energy(scene.model, simulation.state(), effects) - meter.work();
  };
  Motion out;
  observer.add(out.series, simulation.state());
  const double start = energy();
  double imbalance = 0, largest = model::kinetic_energy(scene.model, simulation.state());
  for (long i = 1; i <= simulation.step_count(); ++i) {
    simulation.step();
    meter.look(simulation.state());
    if (i % stride != 0) continue;
    observer.add(out.series, simulation.state());
    imbalance = std::max(imbalance, std::abs(energy() - start));
    largest = std::max(largest, model::kinetic_energy(scene.model, simulation.state()));
  }
  subtract_start(out.series);
  out.gap = simulation.monitor().joint_gap().value;
  if (keeps_energy(scene) && largest > 0) out.energy_error = imbalance / largest;
  return out;
}

/// CPU seconds per simulated second of the bare loop: nothing recorded, nothing compared.
double cost(const AccuracySpec& spec, const scene::Scene& scene) {
  const double h = scene.spec.solver.step;
  const long steps = std::max(1L, std::lround(std::min(scene.spec.duration, kTimedSpan) / h));
  std::vector<double> runs;
  // The first run warms up and does not count.
  for (int run = 0; run <= spec.repeats; ++run) {
    simulation::Simulation simulation(scene);
    const double start = cpu_now();
    for (long i = 0; i < steps; ++i) simulation.step();
    if (run > 0) runs.push_back((cpu_now() - start) / (static_cast<double>(steps) * h));
  }
  return median(std::move(runs));
}

Series slider_crank_series(const SliderCrankSpec& spec, double duration, double every) {
  Series out;
  const std::vector<SliderCrankState> states = SliderCrankReference(spec).series(duration, every);
  for (const SliderCrankState& state : states) {
    out.time.push_back(state.time);
    out.q.push_back({state.x - states.front().x});
    out.rate.push_back({state.vx});
  }
  return out;
}

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
  const auto duration = [&] { return scene::load_scene(spec.scene).spec.duration; };
  switch (spec.reference) {
    case Reference::slider_crank_iftomm:
      return slider_crank_series(SliderCrankSpec::iftomm(), duration(), spec.sample_every);
    case Reference::slider_crank_torque:
      return slider_crank_series(SliderCrankSpec::constant_torque(), duration(), spec.sample_every);
    case Reference::method: {
      const scene::Scene scene = scene::load_scene(spec.scene, spec.reference_set);
      return follow(scene, spec.observe, spec.sample_every).series;
    }
    case Reference::smallest_step:
      return std::nullopt;
  }
  return std::nullopt;
}

AccuracyRow make_row(const AccuracySpec& spec, const AccuracyMethod& method, double step) {
  std::vector<std::string> set = method.set;
  set.push_back("solver.step=" + number_text(step));
  const scene::Scene scene = scene::load_scene(method.scene.value_or(spec.scene), set);
  AccuracyRow row;
  row.method = method.name;
  row.step = step;
  try {
    Motion motion = follow(scene, method.observe ? method.observe : spec.observe, spec.sample_every);
    row.series = std::move(motion.series);
    row.gap = motion.gap;
    row.energy_error = motion.energy_error;
    row.cpu_per_second = cost(spec, scene);
  } catch (const Error& error) {
    if (!error.fault()) throw;
    row.fault = error.what();
  }
  return row;
}

std::string unit_of(const AccuracySpec& spec) {
  const scene::Scene scene = scene::load_scene(spec.scene);
  for (const model::Joint& joint : scene.model.joints)
    if (spec.observe && joint.name == *spec.observe && joint.kind == model::JointKind::slider) return "m";
  return "rad";
}

}  // namespace

AccuracyResult run_accuracy(const AccuracySpec& spec, const std::function<void(double)>& progress) {
  AccuracyResult result;
  result.unit = unit_of(spec);
  result.reference = make_reference(spec);
  std::size_t total = 0;
  for (const AccuracyMethod& method : spec.methods) total += method.steps.size();
  for (const AccuracyMethod& method : spec.methods) {
    const bool own = !result.reference || method.scene;
    const std::size_t first = result.rows.size();
    for (const double step : method.steps) {
      result.rows.push_back(make_row(spec, method, step));
      if (progress) progress(static_cast<double>(result.rows.size()) / static_cast<double>(total));
    }
    result.rows.back().is_reference = own;
    const Series reference = own ? result.rows.back().series : *result.reference;
    for (std::size_t i = first; i < result.rows.size(); ++i) {
      AccuracyRow& row = result.rows[i];
      if (!row.fault && !reference.time.empty()) compare(row, reference, spec.early);
      const bool plotted = std::any_of(spec.plot_steps.begin(), spec.plot_steps.end(),
                                       [&](double step) { return std::abs(step - row.step) < 1e-12; });
      if (!plotted || method.scene) row.series = {};
    }
  }
  return result;
}

const AccuracyRow* cheapest(const AccuracyResult& result, double target) {
  const AccuracyRow* best = nullptr;
  for (const AccuracyRow& row : result.rows) {
    if (row.fault || row.is_reference || !(row.rate_error <= target)) continue;
    if (!best || row.cpu_per_second < best->cpu_per_second) best = &row;
  }
  return best;
}

}  // namespace handsim::study
