#include "handsim/simulation/summary.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "handsim/engine/overlap.h"
#include "handsim/model/kinematics.h"

namespace handsim::simulation {

namespace {

using Json = nlohmann::ordered_json;

Verdict from_peak(std::string name, std::string unit, const Peak& peak, std::optional<double> limit) {
  return {std::move(name), std::move(unit), peak.value, limit, peak.time, peak.where};
}

Json criteria_json(const std::vector<Verdict>& verdicts) {
  Json out = Json::array();
  for (const Verdict& verdict : verdicts) {
    Json entry = {{"name", verdict.name}, {"unit", verdict.unit}, {"measured", verdict.measured}};
    entry["limit"] = verdict.limit ? Json(*verdict.limit) : Json();
    entry["verdict"] = !verdict.limit ? "not judged" : verdict.held() ? "held" : "failed";
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

Json overlaps_json(const model::Model& model) {
  Json out = Json::array();
  for (const engine::Overlap& overlap : engine::initial_overlaps(model, model::initial_state(model)))
    out.push_back({{"a", model.shapes[static_cast<std::size_t>(overlap.shape_a)].name},
                   {"b", model.shapes[static_cast<std::size_t>(overlap.shape_b)].name},
                   {"depth_m", overlap.depth}});
  return out;
}

Json fault_json(const PhysicsFault& fault) {
  return {
      {"time_s", fault.time}, {"where", fault.where}, {"quantity", fault.quantity}, {"detail", fault.detail}};
}

}  // namespace

std::vector<Verdict> verdicts(const Simulation& simulation, const scene::Criteria& criteria) {
  const Monitor& monitor = simulation.monitor();
  std::vector<Verdict> out;
  out.push_back(from_peak("joint_gap", "m", monitor.joint_gap(), criteria.joint_gap));
  out.push_back(from_peak("stop_overshoot", "rad", monitor.stop_overshoot(), criteria.stop_overshoot));
  out.push_back(from_peak("stop_rest", "rad", monitor.stop_rest(simulation.state()), criteria.stop_rest));
  Verdict failures;
  failures.name = "lcp_failures";
  failures.measured = static_cast<double>(simulation.ledger().lcp_failures());
  if (criteria.lcp_failures) failures.limit = *criteria.lcp_failures;
  out.push_back(failures);
  return out;
}

std::string summary_json(const scene::Scene& scene, const Simulation& simulation, const RunResult& result) {
  const model::SolverSettings& solver = scene.spec.solver;
  const Ledger& ledger = simulation.ledger();
  const std::vector<std::string> notes = simulation.engine().notes();
  Json out;
  out["title"] = scene.spec.title;
  out["verdict"] = result.fault ? "diverged" : result.passed() ? "held" : "failed";
  if (result.fault) out["fault"] = fault_json(*result.fault);
  out["criteria"] = criteria_json(result.verdicts);
  out["counts"] = {{"steps", ledger.steps()},
                   {"lcp_failures", ledger.lcp_failures()},
                   {"clamps", notes.size()},
                   {"contacts", ledger.contacts()},
                   {"collide_calls", ledger.collide_calls()}};
  out["time"] = {{"simulated_s", result.simulated},
                 {"loop_wall_s", result.wall},
                 {"times_real_time", result.wall > 0 ? result.simulated / result.wall : 0.0}};
  out["ledger"] = {{"phases", ledger_json(ledger.phases())}, {"effects", ledger_json(ledger.effects())}};
  out["solver"] = {{"engine", simulation.engine().version()},
                   {"method", model::name(solver.method)},
                   {"step_s", solver.step},
                   {"seed", solver.seed}};
  out["versions"] = {
      {"handsim", HANDSIM_VERSION}, {"engine", simulation.engine().version()}, {"compiler", __VERSION__}};
  out["notes"] = notes;
  out["warnings"] = scene.warnings;
  out["overlaps_at_start"] = overlaps_json(scene.model);
  return out.dump(2) + "\n";
}

}  // namespace handsim::simulation
