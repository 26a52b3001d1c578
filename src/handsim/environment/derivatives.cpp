#include "handsim/environment/derivatives.h"

#include <algorithm>

#include <fmt/format.h>

#include "handsim/core/text.h"
#include "handsim/engine/articulated/articulated_engine_derivatives.h"

namespace handsim::environment {

namespace {

[[noreturn]] void refuse(const std::string& got, const std::string& need) {
  throw input_error("derivatives", got, need);
}

/// The scene's controller, where it drives joints in this step.
const control::Plan* controller_of(const simulation::Simulation& simulation, bool excited) {
  const scene::Scene& scene = simulation.scene();
  const bool by_muscles = scene.muscles && !scene.muscles->table;
  if (by_muscles && !excited)
    refuse("excitations by static optimisation", "excitations of your own, or another drive of the muscles");
  if (!scene.control || by_muscles) return nullptr;
  if (scene.control->form == control::Form::explicit_torque)
    refuse("a controller with explicit torques", "one with implicit gains");
  if (scene.control->feed_forward) refuse("a controller with feed_forward", "one without");
  return &*scene.control;
}

/// Adds how the drive of each axis changes with its angle (by_q) and its target.
std::vector<double> add_feedback(const control::Plan& plan, const model::Model& model, double step,
                                 Derivatives& to) {
  engine::articulated::Feedback& out = to.feedback;
  out.by_q.assign(as_index(model.dof_count()), 0);
  if (plan.gravity) {
    out.compensated.assign(as_index(model.dof_count()), 0);
    out.gravity = *plan.gravity;
  }
  std::vector<double> by_target;
  for (const control::DrivenAxis& axis : plan.axes) {
    const model::JointAxis& of = model.joints[axis.joint].axes[axis.axis];
    const double gain = axis.proportional + step * axis.integral;
    out.by_q[axis.dof] = -gain;
    by_target.push_back(gain + (plan.tissue_compensation && of.tissue ? of.tissue->stiffness : 0));
    if (plan.gravity) out.compensated[axis.dof] = 1;
  }
  return by_target;
}

std::vector<int> bodies_of(const model::Model& model, const std::vector<std::string>& names) {
  std::vector<int> out;
  std::vector<std::string> known;
  for (const model::Body& body : model.bodies)
    if (!body.kinematic) known.push_back(body.name);
  for (const std::string& name : names) {
    const auto found = std::ranges::find(model.bodies, name, &model::Body::name);
    if (found == model.bodies.end() || found->kinematic)
      throw input_error("bodies", name, need_word(name, known));
    out.push_back(static_cast<int>(found - model.bodies.begin()));
  }
  return out;
}

}  // namespace

Derivatives step_with_derivatives(const simulation::Simulation& simulation, const std::function<void()>& step,
                                  const DerivativesAsked& asked) {
  const engine::Engine& engine = simulation.engine();
  if (!engine::articulated::derive(engine, nullptr))
    refuse("engine: " + engine.version(), "engine: articulated");
  if (!simulation.scene().plans.climbs.empty()) refuse("a climb", "a scene without one");
  Derivatives out;
  out.step_only = asked.step_only;
  out.forced = bodies_of(simulation.model(), asked.bodies);
  const control::Plan* control = controller_of(simulation, asked.excited);
  std::vector<double> by_target;
  if (control) by_target = add_feedback(*control, simulation.model(), engine.settings().step, out);
  {
    struct Asking {
      const engine::Engine& of;
      ~Asking() { engine::articulated::derive(of, nullptr); }
    } const asking{engine};
    engine::articulated::derive(engine, &out);
    step();
  }
  if (asked.step_only) return out;
  out.by_target.resize(out.by_torque.rows(), static_cast<Eigen::Index>(by_target.size()));
  for (std::size_t i = 0; i < by_target.size(); ++i) {
    const control::DrivenAxis& axis = control->axes[i];
    out.by_target.col(static_cast<Eigen::Index>(i)) =
        (out.driven[axis.dof] ? by_target[i] : 0.0) * out.by_torque.col(static_cast<Eigen::Index>(axis.dof));
    if (axis.integral > 0 || axis.derivative_cutoff)
      out.notes.push_back(
          fmt::format("controller of {}: what its integral or low-pass keeps is no state", axis.name));
  }
  return out;
}

}  // namespace handsim::environment
