#include "handsim/study/inverse/inverse.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/control/muscle_drive.h"
#include "handsim/engine/muscles.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/simulation/simulation.h"
#include "handsim/simulation/watch/hand_parts.h"
#include "handsim/study/inverse/loads.h"
#include "handsim/study/rollouts/rollout_table.h"

namespace handsim::study {

namespace {

constexpr std::size_t kMostValues = 50'000'000;

/// Angles of all hands over time, on the grid of the solver's steps.
struct SampledMotion {
  double start = 0, step = 1e-3;            ///< [s]
  std::vector<std::vector<double>> angles;  ///< by step, each of size model.dof_count()
};

/// A hand's trajectory: of the motion file, or of the scene's program.
control::Trajectory trajectory_of(const scene::Scene& scene, std::size_t hand, const control::HandAxes& axes,
                                  const control::MotionTable* table, const InverseInput& input,
                                  const std::vector<double>& start, Diagnostics& diagnostics) {
  if (!table) return scene.control->hands[hand].trajectory;
  control::MotionOptions options = input.options;
  options.spline = true;
  std::vector<double> angles;
  for (const control::HandAxis& axis : axes.axes) angles.push_back(start[axis.dof]);
  return control::motion_trajectory(*table, axes, std::vector<bool>(axes.axes.size(), true), angles, options,
                                    diagnostics);
}

void check_scene(const scene::Scene& scene, const InverseInput& input) {
  if (scene.model.hands.empty()) throw input_error("scene", "a scene without hands", "at least one hand");
  if (input.least_activation && scene.model.muscles.empty())
    throw input_error("--muscles", "a scene without muscles",
                      "muscles among the effects, and a hand that has them");
  if (!input.motion && !scene.control)
    throw input_error("--motion", "none, with a scene without control",
                      "a motion file, or programs of the scene");
  for (const scene::HandEntry& hand : scene.spec.hands)
    if (hand.placement.mount == hand::Mount::free || hand.placement.mount == hand::Mount::rail)
      throw input_error("hands.wrist.mount", "a hand whose palm is not held",
                        "mounts fixed, driven, hinge or universal: a palm that nothing holds falls");
}

/// Names of the objects that a hand could hold.
std::string movable(const scene::Scene& scene) {
  std::string out;
  for (const scene::ObjectSpec& object : scene.plans.objects)
    if (!object.is_static) out += (out.empty() ? "" : ", ") + object.name;
  return out;
}

SampledMotion sample(const scene::Scene& scene, const InverseInput& input, InverseResult& result) {
  const model::Model& model = scene.model;
  std::optional<control::MotionTable> table;
  if (input.motion) table = control::read_motion(*input.motion);
  SampledMotion out;
  out.step = scene.spec.solver.step;
  out.start = table ? std::max(0.0, table->times.front()) : 0;
  const double end = table ? table->times.back() : scene.spec.duration;
  const auto steps = static_cast<std::size_t>(std::max(0.0, std::floor((end - out.start) / out.step + 1e-6)));
  const std::vector<double> start = model::initial_state(model).q;
  if (steps < 2 || steps * start.size() > kMostValues)
    throw input_error("--motion", fmt::format("a motion of {} steps", steps),
                      fmt::format("2 to {}", kMostValues / std::max<std::size_t>(1, start.size())));
  out.angles.assign(steps + 1, start);
  Diagnostics diagnostics;
  for (std::size_t h = 0; h < model.hands.size(); ++h) {
    const control::HandAxes axes = control::hand_axes(model, model.hands[h]);
    const control::Trajectory trajectory =
        trajectory_of(scene, h, axes, table ? &*table : nullptr, input, start, diagnostics);
    if (!diagnostics.problems.empty()) continue;
    std::vector<double> row(trajectory.width());
    for (std::size_t n = 0; n <= steps; ++n) {
      trajectory.at(out.start + static_cast<double>(n) * out.step, row);
      for (std::size_t i = 0; i < row.size(); ++i) out.angles[n][axes.axes[i].dof] = row[i];
    }
    for (const control::HandAxis& axis : axes.axes) {
      InverseAxis& out_axis = result.axes.emplace_back();
      out_axis.name = axes.hand + "." + axis.name(), out_axis.dof = axis.dof;
    }
  }
  diagnostics.throw_if_any();
  result.warnings = std::move(diagnostics.warnings);
  return out;
}

/// Torque of passive tissue at the end of a step.
void add_tissue(const model::Model& model, std::span<const double> q, std::span<const double> next,
                double step, std::vector<double>& torques) {
  for (const model::Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a) {
      const std::size_t dof = as_index(joint.first_dof) + a;
      if (const auto& tissue = joint.axes[a].tissue)
        torques[dof] +=
            -tissue->stiffness * (next[dof] - tissue->rest) - tissue->damping * (next[dof] - q[dof]) / step;
    }
}

/// Entries of the tendons' coupling that the engine solves: of single joints, or where one carries the other.
engine::TendonLayout::Solves solved(const scene::Scene& scene) {
  if (scene.spec.solver.engine() != engine::EngineKind::articulated) return std::equal_to<int>();
  const model::Model& model = scene.model;
  std::vector<int> child(as_index(model.dof_count()));  // body that each coordinate moves
  std::vector<int> parent(model.bodies.size(), 0);
  for (const model::Joint& joint : model.joints) {
    parent[as_index(joint.child)] = joint.parent;
    for (std::size_t a = 0; a < joint.axes.size(); ++a) child[as_index(joint.first_dof) + a] = joint.child;
  }
  return [child, parent](int a, int b) {
    const auto carries = [&](int body, int other) {
      while (other != body && other != 0) other = parent[as_index(other)];
      return other == body;
    };
    return carries(child[as_index(a)], child[as_index(b)]) || carries(child[as_index(b)], child[as_index(a)]);
  };
}

/// The rows of torques.
class Recursion {
 public:
  Recursion(const scene::Scene& scene, const SampledMotion& motion, const Loads* loads)
      : scene_(scene),
        motion_(motion),
        loads_(loads),
        dynamics_(scene.model, scene.spec.solver.effects.has(model::Effect::gravity) ? scene.model.gravity
                                                                                     : Vec3(Vec3::Zero())),
        start_(model::initial_state(scene.model)),
        tendons_(scene.model, scene.spec.solver, solved(scene)) {
    place(0, start_);
    tendons_.reset(start_);
  }
  /// The motion's state at the start of a step, with its muscles at rest.
  void place(std::size_t n, model::State& state) const {
    state.time = motion_.start + static_cast<double>(n) * motion_.step;
    for (const model::Drive& drive : scene_.model.drives) {
      const Pose pose = drive.motion.at(state.time) * drive.frame.inverse();
      state.bodies[as_index(drive.body)].p = pose.p;
      state.bodies[as_index(drive.body)].q = pose.q;
    }
    model::place_joints(scene_.model, motion_.angles[n], rates(n), state);
  }
  /// The state of place(), but with the muscles as the step before left them.
  model::State state(std::size_t n) const {
    model::State out = start_;
    if (n == 0) return out;
    place(n, out);
    tendons_.store_state(out.q, rates(n), out);
    return out;
  }
  /// The motion's first state.
  const model::State& start() const { return start_; }

  /// Rates at the start of a step; before the first one the motion is continued in a straight line.
  std::vector<double> rates(std::size_t n) const {
    const std::size_t later = std::max<std::size_t>(n, 1);
    std::vector<double> out(motion_.angles[n].size());
    for (std::size_t i = 0; i < out.size(); ++i)
      out[i] = (motion_.angles[later][i] - motion_.angles[later - 1][i]) / motion_.step;
    return out;
  }

  /// Adds tissue, and what muscles and bands pull in the step to the next row, by the law of engine/muscles.h
  /// that the engine solves. Activations and fibres go on from row to row.
  void add_passive(std::size_t n, std::span<const double> excitations, std::vector<double>& torques) {
    if (scene_.spec.solver.effects.has(model::Effect::passive_tissue))
      add_tissue(scene_.model, motion_.angles[n], motion_.angles[n + 1], motion_.step, torques);
    if (tendons_.empty()) return;
    const std::vector<double> u = rates(n), next = rates(n + 1);
    tendons_.begin_step(motion_.angles[n], u, excitations);
    for (std::size_t i = 0; i < u.size(); ++i) torques[i] += tendons_.torques()[i];
    for (const engine::Muscles::Slope& each : tendons_.slopes()) {
      const auto a = as_index(each.row), b = as_index(each.column);
      torques[a] -= each.value * (next[b] - u[b]);
      if (a != b) torques[b] -= each.value * (next[a] - u[a]);
    }
  }
  /// Muscles begin the motion with activations.
  void activate(std::span<const double> activations) {
    start_.activation.assign(activations.begin(), activations.end());
    model::rest_muscles(scene_.model, start_);
    tendons_.reset(start_);
  }

  InverseRow row(std::size_t n) {
    const std::vector<double>&q = motion_.angles[n], &next = motion_.angles[n + 1];
    const std::vector<double> u = rates(n);
    std::vector<double> change(q.size());
    for (std::size_t i = 0; i < q.size(); ++i)
      change[i] = ((next[i] - q[i]) / motion_.step - u[i]) / motion_.step;
    InverseRow out;
    out.time = motion_.start + static_cast<double>(n) * motion_.step;
    out.q = q;
    dynamics_.set_roots(start_, out.time);
    dynamics_.place(q, u, change);
    if (loads_) loads_->at(out.time, dynamics_.bodies(), wrenches_);
    const std::span<const double> moment = dynamics_.torques(wrenches_);
    out.moment.assign(moment.begin(), moment.end());
    out.passive.assign(q.size(), 0.0);
    add_passive(n, {}, out.passive);
    return out;
  }
  const std::vector<model::Wrench>& wrenches() const { return wrenches_; }

 private:
  const scene::Scene& scene_;
  const SampledMotion& motion_;
  const Loads* loads_;
  model::NewtonEuler dynamics_;
  model::State start_;
  engine::Muscles tendons_;
  std::vector<model::Wrench> wrenches_;
};

/// Steps of a window of the check with muscles.
std::size_t window(const SampledMotion& motion) {
  return std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(kCheckWindow / motion.step)));
}

/// Excitation, within 0 and 1, that takes a muscle from one activation to the next in a step.
double excitation_for(const model::Muscle& muscle, double activation, double next, double step) {
  const double slowed = 0.5 + 1.5 * activation;
  const double times =
      next > activation ? muscle.activation_time * slowed / step : muscle.deactivation_time / (step * slowed);
  return std::clamp(next + times * (next - activation), 0.0, 1.0);
}

/// @returns the states in which windows of the check begin
std::vector<model::State> find_activations(const scene::Scene& scene, const SampledMotion& motion,
                                           double least, Recursion& recursion, InverseResult& result) {
  std::vector<model::State> starts;
  model::Model rigid = scene.model;
  for (model::Muscle& muscle : rigid.muscles) muscle.tendon_strain.reset();
  std::vector<std::size_t> dofs;
  for (const InverseAxis& axis : result.axes) dofs.push_back(axis.dof);
  UndoneCauses causes(rigid, dofs);
  control::StaticOptimisation optimisation(rigid, std::move(dofs), least);
  model::State state = recursion.start();
  std::vector<double> torques(motion.angles[0].size()), activation;
  for (std::size_t n = 0; n < result.rows.size(); ++n) {
    InverseRow& row = result.rows[n];
    state.q = row.q;
    state.u = recursion.rates(n + 1);  // the law of a step holds at its end
    for (std::size_t i = 0; i < torques.size(); ++i) torques[i] = row.active(i);
    const std::span<const double> wanted = optimisation.solve(state, torques, true);
    if (n == 0) {
      activation.assign(wanted.begin(), wanted.end());
      recursion.activate(activation);
    }
    if (n % window(motion) == 0) starts.push_back(recursion.state(n));
    for (std::size_t m = 0; m < activation.size(); ++m) {
      const model::Muscle& muscle = rigid.muscles[m];
      row.excitation.push_back(excitation_for(muscle, activation[m], wanted[m], motion.step));
      activation[m] = model::next_activation(muscle, activation[m], row.excitation[m], motion.step);
    }
    row.activation = activation;
    std::vector<double> given(torques.size(), 0.0);
    recursion.add_passive(n, row.excitation, given);
    for (std::size_t i = 0; i < torques.size(); ++i) row.reserve.push_back(row.moment[i] - given[i]);
    causes.add(row.q, optimisation.missing(), wanted, activation, row.reserve);
  }
  result.undone = causes.shares();
  return starts;
}

/// The scene without its controller; torques come from the rows.
scene::Scene undriven(const scene::Scene& scene, double end) {
  scene::Scene out = scene;
  out.control.reset();
  out.plans.control.reset();
  out.spec.control.reset();
  out.muscles.reset();
  out.spec.duration = end;
  return out;
}

/// Simulates with the active torques alone, from the first state of the motion.
void run_forward(const scene::Scene& scene, const SampledMotion& motion, const Loads* loads,
                 Recursion& recursion, const std::vector<model::State>& starts, InverseResult& result,
                 const std::function<void(double)>& progress) {
  simulation::Simulation simulation(undriven(scene, result.rows.back().time + motion.step),
                                    simulation::no_watchers);
  simulation.reset(recursion.start());
  const bool pushed = loads && !loads->are_contacts();
  std::vector<engine::BodyForce> forces;
  std::vector<double> torques(motion.angles[0].size());
  for (std::size_t n = 0; n < result.rows.size(); ++n) {
    InverseRow& row = result.rows[n];
    if (!starts.empty() && n > 0 && n % window(motion) == 0) simulation.reset(starts[n / window(motion)]);
    row.forward = simulation.state().q;
    for (std::size_t i = 0; i < torques.size(); ++i)
      torques[i] = row.reserve.empty() ? row.active(i) : row.reserve[i];
    forces.clear();
    if (pushed) {
      recursion.row(n);
      for (std::size_t b = 1; b < recursion.wrenches().size(); ++b)
        if (const model::Wrench& w = recursion.wrenches()[b];
            w.force != Vec3::Zero() || w.moment != Vec3::Zero())
          forces.push_back({static_cast<int>(b), w.force, w.moment});
    }
    engine::StepInput action;
    action.torques = torques;
    action.excitations = row.excitation;
    action.forces = forces;
    try {
      simulation.step(action);
    } catch (const Error& error) {
      if (!error.fault()) throw;
      result.fault = error.what();
      return;
    }
    if (progress && n % 100 == 0) progress(static_cast<double>(n) / static_cast<double>(result.rows.size()));
  }
}

/// Figures of each axis over the rows.
void summarise(InverseResult& result) {
  double all = 0, torques = 0, reserves = 0;
  std::size_t count = 0;
  for (InverseAxis& axis : result.axes) {
    double torque = 0, error = 0, reserve = 0;
    std::size_t checked = 0;
    for (const InverseRow& row : result.rows) {
      const double active = row.active(axis.dof);
      torque += active * active;
      axis.largest_torque = std::max(axis.largest_torque, std::abs(active));
      if (!row.reserve.empty()) {
        reserve += row.reserve[axis.dof] * row.reserve[axis.dof];
        axis.largest_reserve = std::max(axis.largest_reserve.value_or(0), std::abs(row.reserve[axis.dof]));
      }
      if (row.forward.empty()) continue;
      const double difference = row.forward[axis.dof] - row.q[axis.dof];
      error += difference * difference;
      axis.largest_error = std::max(axis.largest_error.value_or(0), std::abs(difference));
      ++checked;
    }
    axis.rms_torque = std::sqrt(torque / static_cast<double>(result.rows.size()));
    if (axis.largest_reserve) axis.rms_reserve = std::sqrt(reserve / static_cast<double>(result.rows.size()));
    if (checked > 0) axis.rms_error = std::sqrt(error / static_cast<double>(checked));
    all += error;
    torques += torque;
    reserves += reserve;
    count += checked;
  }
  if (reserves > 0) result.reserve_share = std::sqrt(reserves / torques);
  if (count > 0) result.rms_error = std::sqrt(all / static_cast<double>(count));
}

Findings measured(const scene::Scene& scene, const InverseResult& result) {
  Findings out;
  const auto add = [&](const std::string& name, double value) { out.figures.emplace_back(name, value); };
  out.curves.columns = {"time[s]"};
  for (const InverseAxis& axis : result.axes) {
    add(axis.name + ".largest_torque[N_m]", axis.largest_torque);
    add(axis.name + ".rms_torque[N_m]", axis.rms_torque);
    out.curves.columns.push_back(axis.name + ".torque[N_m]");
  }
  std::vector<double> largest(result.rows[0].activation.size(), 0.0);
  for (std::size_t m = 0; m < largest.size(); ++m)
    out.curves.columns.push_back(fmt::format("activation.{}.{}",
                                             simulation::moved_by(scene.model.muscles[m], scene.model),
                                             scene.model.muscles[m].name));
  double effort = 0;
  for (std::size_t n = 0; n < result.rows.size(); ++n) {
    const InverseRow& row = result.rows[n];
    for (std::size_t m = 0; m < largest.size(); ++m) {
      largest[m] = std::max(largest[m], row.activation[m]);
      effort += row.activation[m] * row.activation[m];
    }
    if (n % (1 + result.rows.size() / std::size_t{kBandRows}) != 0) continue;
    out.curves.values.push_back(row.time);
    for (const InverseAxis& axis : result.axes) out.curves.values.push_back(row.active(axis.dof));
    out.curves.values.insert(out.curves.values.end(), row.activation.begin(), row.activation.end());
  }
  for (std::size_t m = 0; m < largest.size(); ++m)
    add("largest_activation." + scene.model.muscles[m].name, largest[m]);
  if (largest.empty()) return out;
  add("effort", effort / static_cast<double>(largest.size() * result.rows.size()));
  add("reserve_share", result.reserve_share.value_or(0));
  return out;
}

}  // namespace

RolloutsSpec uncertain_inverse(const std::filesystem::path& scene, std::vector<std::string> overrides,
                               InverseInput input, int count) {
  RolloutsSpec out = uncertain_rollouts(scene);
  out.title = scene.stem().string() + ", torques of hands within what is uncertain";
  out.set = std::move(overrides);
  out.count = count;
  input.forward = false;
  out.measure = [input](const scene::Scene& of) { return measured(of, run_inverse(of, input)); };
  return out;
}

InverseResult run_inverse(const scene::Scene& scene, const InverseInput& input,
                          const std::function<void(double)>& progress) {
  check_scene(scene, input);
  InverseResult result;
  if (input.motion)
    result.cutoff = input.options.filter;
  else if (scene.spec.control)
    result.cutoff = scene.spec.control->motion.filter;
  const SampledMotion motion = sample(scene, input, result);
  if (const std::string things = movable(scene); !things.empty() && !input.loads)
    result.warnings.push_back(
        fmt::format("THE TORQUES ARE THOSE OF AN EMPTY HAND: what {} weighs and presses is no part of them; "
                    "--loads FILE adds it, such as the contacts.csv of a run",
                    things));
  std::optional<Loads> loads;
  if (input.loads) loads.emplace(*input.loads, scene.model);
  Recursion recursion(scene, motion, loads ? &*loads : nullptr);
  for (std::size_t n = 0; n + 1 < motion.angles.size(); ++n) result.rows.push_back(recursion.row(n));
  std::vector<model::State> starts;
  if (input.least_activation)
    starts = find_activations(scene, motion, *input.least_activation, recursion, result);
  if (input.forward)
    run_forward(scene, motion, loads ? &*loads : nullptr, recursion, starts, result, progress);
  summarise(result);
  return result;
}

}  // namespace handsim::study
