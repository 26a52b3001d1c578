#include "handsim/simulation/run/summary.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "handsim/core/version.h"
#include "handsim/simulation/run/mathematics.h"

namespace handsim::simulation {

namespace {

using Json = nlohmann::ordered_json;

/// @param exists whether the scene has what is measured
Verdict from_peak(std::string name, std::string unit, bool exists, const Peak& peak,
                  std::optional<double> limit) {
  const std::optional<double> measured = exists ? std::optional(peak.value) : std::nullopt;
  return {std::move(name), std::move(unit), measured, limit, peak.time, peak.where};
}

Json criteria_json(const std::vector<Verdict>& verdicts) {
  Json out = Json::array();
  for (const Verdict& verdict : verdicts) {
    Json entry = {{"name", verdict.name}, {"unit", verdict.unit}};
    entry["measured"] = verdict.measured ? Json(*verdict.measured) : Json();
    entry["limit"] = verdict.limit ? Json(*verdict.limit) : Json();
    if (verdict.least) entry["limit_is"] = "least";
    entry["verdict"] = !verdict.limit     ? "not judged"
                       : verdict.missed() ? "not measured"
                       : verdict.held()   ? "held"
                                          : "failed";
    if (!verdict.where.empty()) {
      entry["where"] = verdict.where;
      entry["time_s"] = verdict.time;
    }
    out.push_back(std::move(entry));
  }
  return out;
}

Json ledger_json(const std::vector<LedgerEntry>& entries) {
  Json out = Json::array();
  for (const LedgerEntry& entry : entries) {
    Json row = {{"name", entry.name}, {"steps", entry.ran}};
    if (entry.rows > 0) row["rows_per_step"] = entry.rows;
    row["ns_per_step"] = entry.ns_per_step ? Json(*entry.ns_per_step) : Json();
    row["how"] = entry.how;
    out.push_back(std::move(row));
  }
  return out;
}

/// Steps by how they were solved: what method auto chose, and what the guard tried.
Json steps_json(const Ledger& ledger, const model::SolverSettings& solver) {
  Json out;
  if (solver.method == model::Method::automatic)
    out["method"] = {{"world_step", ledger.steps() - ledger.iterative_steps()},
                     {"quick_step", ledger.iterative_steps()}};
  if (!solver.effects.has(model::Effect::step_guard)) return out;
  for (std::size_t i = 1; i < engine::kRungNames.size(); ++i)
    out["guard"][std::string(engine::kRungNames[i])] = ledger.rungs()[i];
  return out;
}

Json sum_json(const ContactSum& sum, double time) {
  return {{"contacts_at_end", sum.contacts},
          {"normal_force_at_end_N", sum.normal},
          {"friction_force_at_end_N", sum.friction},
          {"force_at_end_N", {sum.force.x(), sum.force.y(), sum.force.z()}},
          {"mean_normal_force_N", time > 0 ? sum.normal_time / time : 0.0},
          {"largest_normal_force_N", sum.largest_normal},
          {"largest_at_s", sum.largest_at}};
}

/// Sums of the points' normal and friction forces, and the vector of all: on the finger; on the first of a
/// pair.
Json contact_forces_json(const ContactSums& sums) {
  Json out = {{"fingers", Json::array()}, {"pairs", Json::array()}};
  for (const auto& [name, sum] : sums.fingers()) {
    Json entry = {{"name", name}};
    entry.update(sum_json(sum, sums.time()));
    out["fingers"].push_back(std::move(entry));
  }
  for (const auto& [pair, sum] : sums.pairs()) {
    Json entry = {{"a", pair.first}, {"b", pair.second}};
    entry.update(sum_json(sum, sums.time()));
    out["pairs"].push_back(std::move(entry));
  }
  return out;
}

Json convergence_json(const Simulation& simulation, const RunResult& result) {
  const Convergence& convergence = simulation.convergence();
  const auto peak = [](const Peak& of) {
    return Json{{"largest", of.value}, {"time_s", of.time}, {"where", of.where}};
  };
  Json out = {{"steps_measured", convergence.measured()}};
  if (convergence.measured() > 0) {
    out["joint_residual_m_per_s"] = peak(convergence.linear());
    out["joint_residual_rad_per_s"] = peak(convergence.angular());
    out["contact_residual_m_per_s"] = peak(convergence.contact());
  }
  if (model::engine_of(simulation.engine().settings().method) == model::EngineKind::articulated) {
    out["steps_by_fixed_friction_limits"] = convergence.limit_steps();
    out["steps_relaxed"] = simulation.ledger().iterative_steps();
  }
  out["warnings"] = result.warnings;
  return out;
}

Json overlaps_json(const model::Model& model, const std::vector<engine::Overlap>& overlaps) {
  Json out = Json::array();
  for (const engine::Overlap& overlap : overlaps)
    out.push_back({{"a", model.shapes[static_cast<std::size_t>(overlap.shape_a)].name},
                   {"b", model.shapes[static_cast<std::size_t>(overlap.shape_b)].name},
                   {"depth_m", overlap.depth}});
  return out;
}

Json fault_json(const PhysicsFault& fault) {
  return {
      {"time_s", fault.time}, {"where", fault.where}, {"quantity", fault.quantity}, {"detail", fault.detail}};
}

Json peak_json(const Peak& peak, const char* key) {
  return {{key, peak.value}, {"time_s", peak.time}, {"pose", peak.where}};
}

Json axis_json(const control::DrivenAxis& axis, const AxisTracking& figures) {
  Json out = {{"name", axis.name}};
  out["gains"] = {{"proportional_N_m_per_rad", axis.gains.proportional},
                  {"derivative_N_m_s_per_rad", axis.gains.derivative},
                  {"integral_N_m_per_rad_s", axis.gains.integral},
                  {"torque_limit_N_m", axis.gains.torque_limit},
                  {"effective_inertia_kg_m2", axis.inertia}};
  out["rms_error_rad"] = figures.rms_error;
  out["largest_error"] = {{"rad", figures.largest_error.value}, {"time_s", figures.largest_error.time}};
  out["steady_error"] = figures.holds > 0 ? peak_json(figures.steady_error, "rad") : Json();
  out["overshoot"] = figures.movements > 0 ? peak_json(figures.overshoot, "share") : Json();
  out["settling_time"] =
      figures.movements > figures.unsettled ? peak_json(figures.settling_time, "s") : Json();
  out["holds"] = figures.holds;
  out["movements"] = figures.movements;
  out["unsettled"] = figures.unsettled;
  out["largest_torque_N_m"] = figures.largest_torque;
  out["share_at_torque_limit"] = figures.limit_share;
  return out;
}

Json control_json(const Simulation& simulation) {
  const control::Plan& plan = simulation.controller()->plan();
  const std::vector<AxisTracking> figures = simulation.tracking();
  const AxisTracking* worst = Tracking::worst(figures);
  Json out;
  out["form"] = plan.form == control::Form::implicit_gain ? "implicit" : "explicit";
  out["gravity_compensation"] = plan.gravity.has_value();
  out["tissue_compensation"] = plan.tissue_compensation;
  out["share_of_step"] = simulation.ledger().control_share();
  out["worst_joint"] = worst ? Json(worst->name) : Json();
  out["joints"] = Json::array();
  for (std::size_t i = 0; i < figures.size(); ++i)
    out["joints"].push_back(axis_json(plan.axes[i], figures[i]));
  return out;
}

Json part_json(const PartForce& part) {
  return {{"part", part.part},
          {"contacts", part.contacts},
          {"normal_force_N", part.normal},
          {"friction_force_N", part.friction}};
}

Json grip_json(const Grip& grip) {
  Json out = {{"time_s", grip.time},
              {"contacts", grip.contacts},
              {"contacts_with_other_things", grip.others},
              {"normal_force_N", grip.normal},
              {"friction_used", grip.friction_used}};
  out["parts"] = Json::array();
  for (const PartForce& part : grip.parts) out["parts"].push_back(part_json(part));
  out["force_closure"] = grip.wrenches.force_closure;
  out["epsilon"] = grip.wrenches.epsilon;
  out["wrench_volume"] = grip.wrenches.volume;
  return out;
}

Json grasps_json(const std::vector<GraspFigures>& grasps) {
  Json out = Json::array();
  for (const GraspFigures& grasp : grasps)
    out.push_back({{"name", grasp.name},
                   {"complete", grasp.complete},
                   {"held", grasp.held},
                   {"force_closure_disagrees", grasp.disagree()},
                   {"slip_m_per_s", grasp.slip},
                   {"spin_rad_per_s", grasp.spin},
                   {"shaken_shift_m", grasp.shaken_shift},
                   {"shift_m", grasp.shift},
                   {"turn_rad", grasp.turn},
                   {"end_of_hold", grip_json(grasp.hold)},
                   {"after_shake", grip_json(grasp.after)}});
  return out;
}

Json loaded_json(const LoadedGrip& grip) {
  Json out = {{"time_s", grip.time},
              {"load_N", grip.load},
              {"travel_m", grip.travel},
              {"contacts", grip.contacts},
              {"parts", Json::array()}};
  for (const PartForce& part : grip.parts) out["parts"].push_back(part_json(part));
  return out;
}

Json climbs_json(const std::vector<ClimbFigures>& climbs) {
  Json out = Json::array();
  for (const ClimbFigures& climb : climbs)
    out.push_back({{"name", climb.name},
                   {"failed", climb.failed},
                   {"load_N", climb.carried},
                   {"load_time_s", climb.carried_time},
                   {"failure_time_s", climb.failed ? Json(climb.failure_time) : Json()},
                   {"travel_m", climb.travel},
                   {"grip_strength_norm_N", climb.strength.norm},
                   {"grip_strength_deviation_N", climb.strength.deviation},
                   {"grip_strength_N", climb.strength.own},
                   {"grip_strength_measured", climb.strength.measured},
                   {"load_over_norm", climb.share()},
                   {"before", loaded_json(climb.before)},
                   {"half_load", loaded_json(climb.half)},
                   {"last", loaded_json(climb.last)}});
  return out;
}

/// A climb that outlasts its largest load has carried that much. One that the run cuts short has carried what
/// it has; of a limit above that nothing is known.
void add_climbs(const Simulation& simulation, const scene::Criteria& criteria, std::vector<Verdict>& out) {
  for (const ClimbFigures& climb : simulation.climbs()) {
    Verdict verdict{"climb_load", "N", climb.carried, criteria.climb_load, climb.carried_time, climb.name};
    verdict.least = true;
    if (!climb.begun() || (!climb.complete && !verdict.held())) verdict.measured.reset();
    out.push_back(std::move(verdict));
  }
}

/// Movements of grasped objects are always judged. An object that is lost has failed, however the run goes
/// on.
void add_grasps(const Simulation& simulation, const scene::Criteria& criteria, std::vector<Verdict>& out) {
  for (const GraspFigures& grasp : simulation.grasps()) {
    const auto add = [&](const char* name, const char* unit, bool known, double measured,
                         std::optional<double> limit, double time) {
      out.push_back({name, unit, known ? std::optional(measured) : std::nullopt, limit, time, grasp.name});
    };
    const bool complete = grasp.complete;
    const int others = grasp.hold.others + grasp.after.others;
    add("grasp_shaken", "m", complete || grasp.lost(), grasp.shaken_shift, kShakenShift, grasp.shaken_time);
    add("grasp_shift", "m", complete, grasp.shift, kHeldShift, grasp.after.time);
    add("grasp_turn", "rad", complete, grasp.turn, kHeldTurn, grasp.after.time);
    add("grasp_others", "", complete || others > 0, others, 0, grasp.after.time);
    add("grasp_slip", "m/s", grasp.hold_measured(), grasp.slip, criteria.grasp_slip, grasp.hold.time);
  }
}

using Figure = std::optional<Peak> (*)(const AxisTracking& axis);

/// The worst axis of a figure; nothing measured where no axis has it.
Verdict worst_of(const std::vector<AxisTracking>& axes, const char* name, const char* unit, Figure figure,
                 std::optional<double> limit) {
  Verdict verdict{name, unit, {}, limit, 0, ""};
  for (const AxisTracking& axis : axes) {
    const std::optional<Peak> peak = figure(axis);
    if (!peak || (verdict.measured && peak->value <= *verdict.measured)) continue;
    verdict.measured = peak->value;
    verdict.time = peak->time;
    verdict.where =
        peak->where.empty() || peak->where == axis.name ? axis.name : axis.name + " (" + peak->where + ")";
  }
  return verdict;
}

std::optional<Peak> where(bool exists, const Peak& peak) {
  return exists ? std::optional(peak) : std::nullopt;
}

/// The worst axis of each tracking figure, where the scene is controlled.
void add_tracking(const Simulation& simulation, const scene::TrackingCriteria& limits,
                  std::vector<Verdict>& out) {
  const std::vector<AxisTracking> axes = simulation.tracking();
  if (axes.empty()) return;
  const auto add = [&](const char* name, const char* unit, Figure figure, std::optional<double> limit) {
    out.push_back(worst_of(axes, name, unit, figure, limit));
  };
  using A = const AxisTracking&;
  add(
      "rms_error", "rad",
      [](A a) {
        return where(true, {a.rms_error, 0, a.name});
      },
      limits.rms_error);
  out.back().time = simulation.state().time;
  add(
      "largest_error", "rad", [](A a) { return where(true, a.largest_error); }, limits.largest_error);
  add(
      "steady_error", "rad", [](A a) { return where(a.holds > 0, a.steady_error); }, limits.steady_error);
  add(
      "overshoot", "", [](A a) { return where(a.movements > 0, a.overshoot); }, limits.overshoot);
  add(
      "settling_time", "s", [](A a) { return where(a.movements > a.unsettled, a.settling_time); },
      limits.settling_time);
  Verdict unsettled{"unsettled", "", 0, {}, 0, ""};
  // A movement that never settles has no settling time: where that is judged, none may be left.
  if (limits.settling_time) unsettled.limit = 0;
  for (const AxisTracking& axis : axes) *unsettled.measured += axis.unsettled;
  out.push_back(unsettled);
}

/// Pairs of shapes that passed each other or lay deeper than the smallest radius, with the first of them.
void add_tunnelling(const Simulation& simulation, const scene::Criteria& criteria,
                    std::vector<Verdict>& out) {
  const Tunnelling* watch = simulation.tunnelling();
  if (!watch && !criteria.tunnelling) return;
  Verdict verdict{"tunnelling", "", {}, criteria.tunnelling, 0, ""};
  if (watch) {
    verdict.measured = watch->pairs();
    verdict.where = watch->first_where();
    verdict.time = watch->first_time();
  }
  out.push_back(std::move(verdict));
}

const char* overall(const RunResult& result) {
  if (result.fault) return "diverged";
  if (result.failed() || !result.hash_as_expected()) return "failed";
  if (result.missed()) return "not measured";
  return result.judged() ? "held" : "not judged";
}

}  // namespace

std::vector<Verdict> verdicts(const Simulation& simulation, const scene::Criteria& criteria) {
  const Monitor& monitor = simulation.monitor();
  std::vector<Verdict> out;
  const bool joints = !simulation.model().joints.empty(), stops = monitor.has_stops();
  out.push_back(from_peak("joint_gap", "m", joints, monitor.joint_gap(), criteria.joint_gap));
  out.push_back(from_peak("stop_overshoot", "rad", stops, monitor.stop_overshoot(), criteria.stop_overshoot));
  out.push_back(
      from_peak("stop_rest", "rad", stops, monitor.stop_rest(simulation.state()), criteria.stop_rest));
  Verdict failures;
  failures.name = "lcp_failures";
  failures.measured = static_cast<double>(simulation.ledger().lcp_failures());
  if (criteria.lcp_failures) failures.limit = *criteria.lcp_failures;
  out.push_back(failures);
  if (simulation.engine().tests_contacts())
    out.push_back(from_peak("penetration", "m", true, monitor.penetration(), criteria.penetration));
  else if (criteria.penetration)
    out.push_back({"penetration", "m", {}, criteria.penetration, 0, ""});
  add_tunnelling(simulation, criteria, out);
  add_grasps(simulation, criteria, out);
  add_climbs(simulation, criteria, out);
  add_tracking(simulation, criteria.tracking, out);
  return out;
}

std::string summary_json(const scene::Scene& scene, const Simulation& simulation, const RunResult& result) {
  const model::SolverSettings& solver = scene.spec.solver;
  const Ledger& ledger = simulation.ledger();
  const std::vector<std::string> notes = simulation.engine().notes();
  Json out;
  out["title"] = scene.spec.title;
  out["verdict"] = overall(result);
  if (result.fault) out["fault"] = fault_json(*result.fault);
  if (!result.missing.empty()) out["missing"] = result.missing;
  out["criteria"] = criteria_json(result.verdicts);
  out["counts"] = {{"steps", ledger.steps()},
                   {"lcp_failures", ledger.lcp_failures()},
                   {"clamps", notes.size()},
                   {"contacts", ledger.contacts()},
                   {"collide_calls", ledger.collide_calls()}};
  out["convergence"] = convergence_json(simulation, result);
  out["state_hash"] = hash_text(result.state_hash);
  if (result.expected_hash) out["expected_hash"] = hash_text(*result.expected_hash);
  if (result.continued_from) out["continued_from_s"] = *result.continued_from;
  if (const Json steps = steps_json(ledger, solver); !steps.is_null()) out["steps"] = steps;
  out["time"] = {{"simulated_s", result.simulated},
                 {"loop_wall_s", result.wall},
                 {"times_real_time", result.wall > 0 ? result.simulated / result.wall : 0.0}};
  if (!result.grasps.empty()) out["grasps"] = grasps_json(result.grasps);
  if (!result.climbs.empty()) out["climbs"] = climbs_json(result.climbs);
  if (simulation.controller()) out["control"] = control_json(simulation);
  if (simulation.contact_sums()) out["contact_forces"] = contact_forces_json(*simulation.contact_sums());
  out["ledger"] = {{"phases", ledger_json(ledger.phases())}, {"effects", ledger_json(ledger.effects())}};
  out["solver"] = {{"engine", simulation.engine().version()},
                   {"method", model::name(solver.method)},
                   {"step_s", solver.step},
                   {"seed", solver.seed}};
  out["versions"] = {{"handsim", kVersion},
                     {"engine", simulation.engine().version()},
                     {"compiler", __VERSION__},
                     {"mathematics", mathematics()}};
  if (!scene.spec.engine_choice.empty()) out["engine_choice"] = scene.spec.engine_choice;
  out["notes"] = notes;
  out["warnings"] = scene.warnings;
  out["overlaps_at_start"] = overlaps_json(scene.model, result.overlaps);
  return out.dump(2) + "\n";
}

}  // namespace handsim::simulation
