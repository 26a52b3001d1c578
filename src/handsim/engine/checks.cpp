#include "handsim/engine/checks.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "handsim/model/validate.h"

namespace handsim::engine {

namespace {

constexpr double kUnitTolerance = 1e-6;
constexpr double kLeastGain = 1e-300;  ///< below: looked at closely

bool finite(const model::BodyState& body) {
  return body.p.allFinite() && body.v.allFinite() && body.w.allFinite() &&
         std::abs(body.q.norm() - 1) <= kUnitTolerance;
}

/// False also for NaN.
bool valid(const model::Servo& servo) {
  return servo.stiffness >= 0 && servo.damping >= 0 && servo.limit > 0 &&
         servo.stiffness + servo.damping > 0 && std::isfinite(servo.stiffness + servo.damping);
}

bool has_stops(const model::Model& model) {
  for (const model::Joint& joint : model.joints)
    for (const model::JointAxis& axis : joint.axes)
      if (axis.stop) return true;
  return false;
}

std::vector<Problem> plane_defects(const model::Model& model, const model::Effects& effects) {
  std::vector<Problem> problems;
  if (!needs_contacts(model, effects)) return problems;
  const std::vector<bool> immovable = immovable_bodies(model, effects);
  for (const model::Shape& shape : model.shapes)
    if (shape.kind == model::ShapeKind::plane && !immovable[as_index(shape.body)])
      problems.push_back(
          {std::nullopt, shape.name, "a plane on the moving body " + model.bodies[as_index(shape.body)].name,
           "a plane on the world or on a body that never moves; a moving body can have a box"});
  return problems;
}

/// The fault of the first torque that is not finite.
std::optional<PhysicsFault> torque_fault(const model::Model& model, double time,
                                         std::span<const double> torques) {
  if (torques.size() != as_index(model.dof_count()))
    throw input_error("torques", fmt::format("{}", torques.size()),
                      fmt::format("one for each of {} coordinates", model.dof_count()));
  if (std::ranges::all_of(torques, [](double torque) { return std::isfinite(torque); })) return std::nullopt;
  for (const model::Joint& joint : model.joints)
    for (int i = 0; i < dof_count(joint.kind); ++i) {
      const double torque = torques[as_index(joint.first_dof) + as_index(i)];
      if (std::isfinite(torque)) continue;
      return PhysicsFault{
          time, joint.name, "joint torque [N m]",
          fmt::format("coordinate {} has {}, not a finite number: check the controller", i, torque)};
    }
  return std::nullopt;
}

/// Whether no servo can have a fault: with few branches, as almost all of them have none.
bool beyond_doubt(const model::Model& model, std::span<const model::Servo> servos) {
  double total = 0, least = 1;
  for (const model::Servo& servo : servos) {
    const double gain = servo.stiffness + servo.damping;
    // A sum of numbers that are not negative is finite only if each of them is.
    total += gain + servo.limit + std::abs(servo.error + servo.feed);
    least = std::min(std::min(least, servo.stiffness), std::min(servo.damping, servo.limit));
    // A drive without any gain counts as a negative one.
    least = std::min(least, servo.limit == 0 ? 1 : gain - kLeastGain);
  }
  return least >= 0 && std::isfinite(total) &&
         std::ranges::none_of(model.joints, [](const model::Joint& joint) { return joint.axes.empty(); });
}

/// The fault of the first servo whose error or feed is not finite.
std::optional<PhysicsFault> servo_fault(const model::Model& model, const Settings& settings, double time,
                                        std::span<const model::Servo> servos) {
  if (!settings.effects.has(model::Effect::actuation))
    throw input_error("servos", "servos without the actuation effect", "actuation among the effects");
  if (servos.size() != as_index(model.dof_count()))
    throw input_error("servos", fmt::format("{}", servos.size()),
                      fmt::format("one for each of {} coordinates", model.dof_count()));
  std::optional<PhysicsFault> fault;
  if (beyond_doubt(model, servos)) return fault;
  for (const model::Joint& joint : model.joints)
    for (int i = 0; i < dof_count(joint.kind); ++i) {
      const model::Servo& servo = servos[as_index(joint.first_dof) + as_index(i)];
      if (servo.limit == 0) continue;
      if (!valid(servo) || joint.axes.empty())
        throw input_error(
            "servos." + joint.name,
            fmt::format("stiffness {:g}, damping {:g}, limit {:g}", servo.stiffness, servo.damping,
                        servo.limit),
            "a hinge, universal or slider with gains of 0 or more, not both 0, and a limit of 0 or more");
      if (!fault && !std::isfinite(servo.error + servo.feed))
        fault = PhysicsFault{
            time, joint.name, "servo",
            fmt::format(
                "coordinate {} has an error of {} and a feed of {}, not finite numbers: check the controller",
                i, servo.error, servo.feed)};
    }
  return fault;
}

void require_forces(const model::Model& model, std::span<const BodyForce> forces) {
  for (const BodyForce& each : forces) {
    const bool there = each.body > model::kWorld && as_index(each.body) < model.bodies.size();
    if (!there || model.bodies[as_index(each.body)].kinematic)
      throw input_error("forces", fmt::format("a force on body {}", each.body),
                        fmt::format("a body that can move, 1 to {}", model.bodies.size() - 1));
    if (!each.force.allFinite() || !each.moment.allFinite())
      throw input_error("forces." + model.bodies[as_index(each.body)].name,
                        "a force or moment that is not finite", "finite numbers");
  }
}

void require_targets(const model::Model& model, const Settings& settings, std::span<const Pose> targets) {
  if (targets.empty()) return;
  if (!settings.effects.has(model::Effect::wrist_motion) || targets.size() != model.drives.size())
    throw input_error("drive_targets", fmt::format("{} poses", targets.size()),
                      settings.effects.has(model::Effect::wrist_motion)
                          ? fmt::format("one for each of {} driven bodies", model.drives.size())
                          : "the wrist_motion effect, and a wrist that it drives");
  for (const Pose& target : targets)
    if (!target.p.allFinite() || !(std::abs(target.q.norm() - 1) <= kUnitTolerance))
      throw input_error("drive_targets", "a pose that is not finite or not unit",
                        "finite numbers and a unit quaternion");
}

void require_outside(const model::Model& model, const Settings& settings, const StepInput& input) {
  if (input.forces.empty() && input.drive_targets.empty()) return;
  const Method method = settings.method();
  if (settings.engine() != EngineKind::ode && method != ArticulatedMethod::semi_implicit_euler)
    throw input_error(
        input.forces.empty() ? "drive_targets" : "forces",
        fmt::format("engine {} with method {}, which takes none", name(settings.engine()), name(method)),
        "engine ode, or articulated with method semi_implicit_euler");
  require_forces(model, input.forces);
  require_targets(model, settings, input.drive_targets);
}

void require_excitations(const model::Model& model, const Settings& settings,
                         std::span<const double> excitations) {
  if (excitations.empty()) return;
  if (!settings.effects.has(model::Effect::muscles))
    throw input_error("excitations", "excitations without the muscles effect", "muscles among the effects");
  if (excitations.size() != model.muscles.size())
    throw input_error("excitations", fmt::format("{}", excitations.size()),
                      fmt::format("one for each of {} muscles", model.muscles.size()));
  for (std::size_t i = 0; i < excitations.size(); ++i)
    // Written so that NaN fails.
    if (!(excitations[i] >= 0 && excitations[i] <= 1))
      throw input_error("excitations." + model.muscles[i].name, fmt::format("{:g}", excitations[i]),
                        "0 to 1");
}

}  // namespace

std::vector<bool> immovable_bodies(const model::Model& model, const model::Effects& effects) {
  std::vector<bool> immovable(model.bodies.size());
  for (std::size_t i = 0; i < immovable.size(); ++i) immovable[i] = model.bodies[i].kinematic;
  if (effects.has(model::Effect::wrist_motion))
    for (const model::Drive& drive : model.drives) immovable[as_index(drive.body)] = false;
  immovable[model::kWorld] = true;
  return immovable;
}

bool needs_contacts(const model::Model& model, const model::Effects& effects) {
  return effects.any_contact() && !model.contact_rules.empty();
}

const model::Model& checked(const model::Model& model, const Settings& settings) {
  std::vector<Problem> problems = defects(settings);
  const auto add = [&](const std::vector<Problem>& more) {
    problems.insert(problems.end(), more.begin(), more.end());
    return more.empty();
  };
  const bool valid_model = add(model::defects(model));
  const bool valid_effects = add(missing_effects(settings, has_stops(model)));
  // plane_defects reads indices that must be valid.
  if (valid_model && valid_effects) add(plane_defects(model, settings.effects));
  if (!problems.empty()) throw Error(std::move(problems));
  return model;
}

long long step_number(double time, double step) { return std::llround(time / step); }

double next_time(double time, double step) {
  const auto n = static_cast<double>(step_number(time, step));
  return std::abs(time - n * step) <= 1e-6 * step ? (n + 1) * step : time + step;
}

std::optional<PhysicsFault> input_fault(const model::Model& model, const Settings& settings, double time,
                                        const StepInput& input) {
  require_outside(model, settings, input);
  require_excitations(model, settings, input.excitations);
  std::optional<PhysicsFault> fault;
  if (!input.servos.empty()) fault = servo_fault(model, settings, time, input.servos);
  if (!input.torques.empty())
    if (auto of_torques = torque_fault(model, time, input.torques)) fault = std::move(of_torques);
  return fault;
}

void require_state(const model::Model& model, const model::State& state) {
  if (state.bodies.size() != model.bodies.size())
    throw input_error("state", fmt::format("{} bodies", state.bodies.size()),
                      fmt::format("{}", model.bodies.size()));
  const auto dofs = as_index(model.dof_count());
  for (const std::vector<double>* torques : {&state.tau, &state.tau_servo})
    if (torques->size() != dofs ||
        !std::ranges::all_of(*torques, [](double tau) { return std::isfinite(tau); }))
      throw input_error("state.tau", fmt::format("{} torques, or one that is not finite", torques->size()),
                        fmt::format("{} finite ones", dofs));
  for (const std::vector<double>* values : {&state.activation, &state.fibre_length, &state.fibre_speed,
                                            &state.bridge_stretch, &state.tendon_force})
    if (values->size() != model.muscles.size() ||
        !std::ranges::all_of(*values, [](double value) { return std::isfinite(value); }))
      throw input_error("state.activation",
                        fmt::format("{} muscles, or a value that is not finite", values->size()),
                        fmt::format("{} muscles with finite values", model.muscles.size()));
  for (const double value : state.activation)
    if (!(value >= 0 && value <= 1))
      throw input_error("state.activation", fmt::format("{:g}", value), "0 to 1");
  const auto shapes = static_cast<int>(model.shapes.size());
  const auto sound = [&](const model::PadState& pad) {
    return pad.shape_a >= 0 && pad.shape_a < shapes && pad.shape_b >= 0 && pad.shape_b < shapes &&
           std::isfinite(pad.force) && std::isfinite(pad.push) &&
           std::ranges::all_of(pad.parts, [](double part) { return std::isfinite(part); });
  };
  const auto by_shapes = [](const model::PadState& pad) { return std::pair(pad.shape_a, pad.shape_b); };
  if (!std::ranges::all_of(state.pads, sound) || !std::ranges::is_sorted(state.pads, {}, by_shapes))
    throw input_error("state.pads", "a pad of shapes that are not there, or a force that is not finite",
                      "pairs of this scene's shapes, ascending, with finite forces");
  if (!std::isfinite(state.time))
    throw input_error("state.time", fmt::format("{}", state.time), "a finite time");
  for (std::size_t i = 0; i < state.bodies.size(); ++i)
    if (!finite(state.bodies[i]))
      throw input_error("state." + model.bodies[i].name, "a pose or velocity that is not finite or not unit",
                        "finite numbers and a unit quaternion");
  for (std::size_t i = 0; i < state.bodies.size(); ++i)
    if (state.bodies[i].v.norm() > kMaxSpeed || state.bodies[i].w.norm() > kMaxAngularSpeed)
      throw input_error(
          "state." + model.bodies[i].name,
          fmt::format("{:g} m/s and {:g} rad/s", state.bodies[i].v.norm(), state.bodies[i].w.norm()),
          fmt::format("at most {:g} m/s and {:g} rad/s", kMaxSpeed, kMaxAngularSpeed));
  const model::BodyState& world = state.bodies[model::kWorld];
  if (world.p != Vec3::Zero() || std::abs(world.q.w()) != 1)
    throw input_error("state.world", "a pose away from the origin", "the world at the origin");
}

}  // namespace handsim::engine
