#include "handsim/control/plan.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/control/joint_space.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"

namespace handsim::control {

namespace {

/// Largest number of postures of a trajectory for the design of gains and the check of stability.
constexpr std::size_t kMaxPostures = 100;

struct HandDraft {
  const model::HandIndex* index = nullptr;
  HandAxes axes;
  std::vector<std::optional<AxisGains>> stated;  ///< by axis
  std::vector<double> start;                     ///< angles by axis
  std::vector<Eigen::MatrixXd> inertias;         ///< at the postures of its trajectory
};

std::string axis_name(const HandDraft& hand, std::size_t i) {
  return hand.axes.hand + "." + hand.axes.axes[i].name();
}

HandDraft make_draft(const model::Model& model, std::size_t i, const PlanInput& input,
                     const std::vector<double>& start) {
  HandDraft out;
  out.index = &model.hands[i];
  out.axes = hand_axes(model, model.hands[i], input.absent[i]);
  for (const HandAxis& axis : out.axes.axes) {
    out.stated.push_back(gains_of(*input.controller, axis));
    out.start.push_back(start[axis.dof]);
  }
  return out;
}

/// Driven axes need a limit and gains.
void check_gains(const HandDraft& hand, const PlanInput& input, Diagnostics& diagnostics) {
  const auto report = [&](std::size_t i, const char* got, const char* need) {
    diagnostics.problems.push_back({input.controller->rows.front().place, "gains",
                                    fmt::format("{} for {}", got, hand.axes.axes[i].name()), need});
  };
  for (std::size_t i = 0; i < hand.stated.size(); ++i) {
    if (!hand.stated[i]) continue;
    const AxisGains& gains = *hand.stated[i];
    if (!gains.torque_limit) report(i, "no torque_limit", "a torque_limit in a row that names it");
    const bool designed = gains.frequency && gains.damping_ratio;
    const bool given = gains.proportional.value_or(0) + gains.derivative.value_or(0) > 0;
    if (!designed && !given)
      report(i, "no gains", "frequency and damping_ratio, or proportional and derivative, above 0");
  }
}

const PoseFile kNoPoses;

/// Largest number of angles in the programs of all hands: 400 MB.
constexpr std::size_t kMostKnots = 50'000'000;

/// The trajectory of a hand's program or motion file; empty, with a problem, if there is none.
Trajectory make_trajectory(const HandDraft& hand, const ProgramChoice& choice, const PlanInput& input,
                           Diagnostics& diagnostics) {
  const PoseFile& file = input.poses ? *input.poses : kNoPoses;
  if (is_motion_file(choice.program)) {
    const auto path = std::filesystem::path(choice.place.file).parent_path() / choice.program;
    std::vector<bool> driven;
    for (const auto& gains : hand.stated) driven.push_back(gains.has_value());
    try {
      MotionOptions options = input.motion;
      // Feed-forward needs accelerations.
      options.spline = input.controller->feed_forward;
      return motion_trajectory(read_motion(path), hand.axes, driven, hand.start, options, diagnostics);
    } catch (const Error& error) {
      diagnostics.add(error);
      return {};
    }
  }
  const auto found = file.programs.find(choice.program);
  if (found == file.programs.end()) {
    std::vector<std::string> known;
    for (const auto& [name, program] : file.programs) known.push_back(name);
    diagnostics.problems.push_back({choice.place, choice.key,
                                    fmt::format("\"{}\", an unknown program", choice.program),
                                    fmt::format("a program of the pose file{}, or a .csv, .mot or .sto file",
                                                nearest_hint(choice.program, known))});
    return {};
  }
  const std::vector<ProgramKey>* keys = found->second.keys_for(hand.axes.hand);
  if (!keys) {
    diagnostics.problems.push_back({found->second.place, "programs." + choice.program,
                                    fmt::format("no keys for hand {}", hand.axes.hand),
                                    "keys for every hand of the scene"});
    return {};
  }
  return program_trajectory(found->second, *keys, file, hand.axes, hand.start, diagnostics);
}

/// Joint-space inertia at the start and at the trajectory's knots, each posture once.
void compute_inertias(const model::Model& model, const Trajectory& trajectory,
                      const std::vector<double>& start, HandDraft& hand) {
  std::vector<std::vector<double>> postures = {hand.start};
  const std::size_t stride = 1 + trajectory.knots() / (20 * kMaxPostures);
  for (std::size_t k = 0; k < trajectory.knots() && postures.size() < kMaxPostures; k += stride) {
    const std::span<const double> q = trajectory.knot(k);
    std::vector<double> posture(q.begin(), q.end());
    if (std::ranges::find(postures, posture) == postures.end()) postures.push_back(std::move(posture));
  }
  for (const std::vector<double>& posture : postures) {
    std::vector<double> q = start;
    for (std::size_t i = 0; i < posture.size(); ++i) q[hand.axes.axes[i].dof] = posture[i];
    hand.inertias.push_back(joint_inertia(model, model::state_at(model, q), *hand.index, hand.axes));
  }
}

/// Gains from frequency f, damping ratio z and inertia I: K = I (2 pi f)^2, D = 2 z I 2 pi f, Ki = K / Ti.
void set_gains(DrivenAxis& axis, const AxisGains& stated) {
  const double w = 2 * M_PI * stated.frequency.value_or(0);
  const bool designed = stated.frequency.has_value();
  axis.proportional = designed ? axis.inertia * w * w : stated.proportional.value_or(0);
  axis.derivative =
      designed ? 2 * stated.damping_ratio.value_or(1) * axis.inertia * w : stated.derivative.value_or(0);
  axis.integral =
      stated.integral_time ? axis.proportional / *stated.integral_time : stated.integral.value_or(0);
  axis.torque_limit = stated.torque_limit.value_or(0);
  axis.derivative_cutoff = stated.derivative_cutoff;
  axis.integral_zone = stated.integral_zone;
}

void add_axes(const HandDraft& hand, std::size_t hand_index, double strength, Plan& plan) {
  Eigen::VectorXd effective = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(hand.axes.axes.size()));
  for (const auto& inertia : hand.inertias) effective = effective.cwiseMax(effective_inertia(inertia));
  for (std::size_t i = 0; i < hand.stated.size(); ++i) {
    if (!hand.stated[i]) continue;
    const HandAxis& from = hand.axes.axes[i];
    DrivenAxis& axis = plan.axes.emplace_back();
    axis = {axis_name(hand, i), hand_index, i, from.joint_index, from.axis_index, from.dof};
    axis.inertia = effective[static_cast<Eigen::Index>(i)];
    set_gains(axis, *hand.stated[i]);
    axis.torque_limit *= strength;
  }
}

/// Holds torque limits to what the muscles in effect can do at the start: the greater of both directions.
void limit_by_muscles(const model::Model& model, Plan& plan) {
  const std::size_t dofs = as_index(model.dof_count());
  std::vector<double> up(dofs), down(dofs);
  const model::State start = model::initial_state(model);
  for (const model::Muscle& muscle : model.muscles) {
    const model::PathState path = model::path_state(muscle.path, start.q);
    const double force = model::isometric_force(muscle, path.excursion);
    for (std::size_t i = 0; i < muscle.path.arms.size(); ++i) {
      const auto dof = as_index(muscle.path.arms[i].dof);
      (path.arm[i] > 0 ? up : down)[dof] += std::abs(path.arm[i]) * force;
    }
  }
  for (DrivenAxis& axis : plan.axes)
    if (const double most = std::max(up[axis.dof], down[axis.dof]); most > 0)
      axis.torque_limit = std::min(axis.torque_limit, most);
}

Stability worst_stability(const HandDraft& hand, std::size_t hand_index, const Plan& plan, double step) {
  const auto n = static_cast<Eigen::Index>(hand.axes.axes.size());
  Eigen::VectorXd proportional = Eigen::VectorXd::Zero(n), derivative = Eigen::VectorXd::Zero(n);
  for (const DrivenAxis& axis : plan.axes) {
    if (axis.hand != hand_index) continue;
    proportional[static_cast<Eigen::Index>(axis.column)] = axis.proportional;
    derivative[static_cast<Eigen::Index>(axis.column)] = axis.derivative;
  }
  Stability worst;
  for (const Eigen::MatrixXd& inertia : hand.inertias) {
    const Stability at = explicit_stability(inertia, proportional, derivative, step);
    if (at.eigenvalue > worst.eigenvalue) worst = at;
  }
  return worst;
}

/// Refuses explicit gains beyond their limit, or warns if they are allowed; names the worst joint.
void check_stability(const std::vector<HandDraft>& hands, const PlanInput& input, Plan& plan,
                     Diagnostics& diagnostics) {
  Stability worst;
  std::string name;
  for (std::size_t i = 0; i < hands.size(); ++i) {
    const Stability at = worst_stability(hands[i], i, plan, input.step);
    if (at.eigenvalue <= worst.eigenvalue) continue;
    worst = at;
    name = axis_name(hands[i], at.axis);
  }
  if (worst.eigenvalue < kExplicitLimit) return;
  const std::string got = fmt::format(
      "explicit gains beyond their limit at a step of {:g} ms: 2 D h/I + K h^2/I is {:.3g} for the "
      "coupled joints, {:.3g} for this joint alone (D h/I = {:.3g}, K h^2/I = {:.3g}, I = {:.3g} kg m^2)",
      1e3 * input.step, worst.eigenvalue, 2 * worst.damping_number + worst.stiffness_number,
      worst.damping_number, worst.stiffness_number, worst.inertia);
  const std::string need =
      fmt::format("below {:g}: form: implicit, or a step below {:.3g} ms (or lower gains)", kExplicitLimit,
                  1e3 * worst.largest_step);
  if (!input.allow_unstable)
    diagnostics.problems.push_back({input.controller->rows.front().place, "gains." + name, got, need});
  else
    plan.warnings.push_back(
        fmt::format("gains.{}: {}, need {}; control.allow_unstable accepts it", name, got, need));
}

}  // namespace

Plan make_plan(const model::Model& model, const PlanInput& input, Diagnostics& diagnostics) {
  Plan plan;
  plan.form = input.controller->form;
  plan.tissue_compensation =
      input.controller->tissue_compensation && input.effects.has(model::Effect::passive_tissue);
  if (input.controller->gravity_compensation && input.effects.has(model::Effect::gravity))
    plan.gravity = model.gravity;
  plan.feed_forward = input.controller->feed_forward;
  if (plan.feed_forward) {
    // The weight is part of it.
    plan.gravity.reset();
    if (input.effects.has(model::Effect::gravity)) plan.feed_gravity = model.gravity;
  }
  const std::vector<double> start = model::initial_state(model).q;
  std::vector<HandDraft> hands;
  for (std::size_t i = 0; i < model.hands.size(); ++i) hands.push_back(make_draft(model, i, input, start));
  std::vector<HandAxes> axes;
  for (const HandDraft& hand : hands) axes.push_back(hand.axes);
  const std::size_t before = diagnostics.problems.size();
  check_names(*input.controller, axes, diagnostics);
  // A row with a misspelt joint also leaves a joint without gains: only the misspelling is reported.
  const bool named = diagnostics.problems.size() == before;
  std::size_t knots = 0;
  for (std::size_t i = 0; i < hands.size(); ++i) {
    if (named) check_gains(hands[i], input, diagnostics);
    Trajectory trajectory = make_trajectory(hands[i], input.programs[i], input, diagnostics);
    knots += trajectory.knots() * trajectory.width();
    if (knots > kMostKnots)
      diagnostics.problems.push_back({input.programs[i].place, input.programs[i].key,
                                      fmt::format("programs of more than {} angles", kMostKnots),
                                      "shorter programs, or fewer hands"});
    if (!diagnostics.problems.empty()) continue;
    compute_inertias(model, trajectory, start, hands[i]);
    plan.hands.push_back({hands[i].axes.hand, hands[i].index->side, std::move(trajectory)});
    add_axes(hands[i], i, input.strength.empty() ? 1 : input.strength[i], plan);
  }
  limit_by_muscles(model, plan);
  if (plan.form == Form::explicit_torque && diagnostics.problems.empty())
    check_stability(hands, input, plan, diagnostics);
  return plan;
}

}  // namespace handsim::control
