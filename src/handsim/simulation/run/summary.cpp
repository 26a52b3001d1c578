#include "handsim/simulation/run/run.h"

#include "handsim/core/version.h"
#include "handsim/simulation/simulation.h"
#include "handsim/simulation/snapshot.h"
#include "handsim/simulation/watch/state_hash.h"
#include "handsim/simulation/watch/summary_json.h"

namespace handsim::simulation {

namespace {

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

Json overlaps_json(const model::Model& model, const std::vector<engine::Overlap>& overlaps) {
  Json out = Json::array();
  for (const engine::Overlap& overlap : overlaps)
    out.push_back({{"a", model.shapes[static_cast<std::size_t>(overlap.shape_a)].name},
                   {"b", model.shapes[static_cast<std::size_t>(overlap.shape_b)].name},
                   {"depth_m", overlap.depth}});
  return out;
}

const char* overall(const RunResult& result) {
  if (result.fault) return "diverged";
  if (result.failed() || !result.hash_as_expected()) return "failed";
  if (result.missed()) return "not measured";
  return result.judged() ? "held" : "not judged";
}

/// The key `control`, to which watchers add theirs, in the order of the file.
Json control_json(const control::Plan& plan) {
  return {{"form", plan.form == control::Form::implicit_gain ? "implicit" : "explicit"},
          {"gravity_compensation", plan.gravity.has_value()},
          {"tissue_compensation", plan.tissue_compensation},
          {"share_of_step", nullptr}};
}

/// Adds the figures of the run itself, and the keys that watchers fill in, in the order of the file.
void add_run(const Simulation& simulation, const RunResult& result, Json& out) {
  const scene::Scene& scene = simulation.scene();
  out["title"] = scene.spec.title;
  out["verdict"] = overall(result);
  if (const auto& f = result.fault)
    out["fault"] = {
        {"time_s", f->time}, {"where", f->where}, {"quantity", f->quantity}, {"detail", f->detail}};
  if (!result.missing.empty()) out["missing"] = result.missing;
  out["criteria"] = criteria_json(result.verdicts);
  out["counts"] = {{"steps", simulation.steps()},
                   {"lcp_failures", nullptr},
                   {"notes", simulation.engine().notes().size()},
                   {"contacts", nullptr},
                   {"collide_calls", nullptr}};
  for (const char* key : {"convergence", "state_hash"}) out[key] = nullptr;
  if (result.expected_hash) out["expected_hash"] = hash_text(*result.expected_hash);
  if (result.continued_from) out["continued_from_s"] = *result.continued_from;
  out["time"] = {{"simulated_s", result.simulated},
                 {"loop_wall_s", result.wall},
                 {"times_real_time", result.wall > 0 ? result.simulated / result.wall : 0.0}};
  for (const char* key : {"grasps", "climbs", "control", "contact_forces", "ledger"}) out[key] = nullptr;
  if (scene.control) out["control"] = control_json(*scene.control);
}

}  // namespace

std::string summary_json(const Simulation& simulation, const RunResult& result) {
  const scene::Scene& scene = simulation.scene();
  const engine::Settings& solver = scene.spec.solver;
  SummaryJson summary;
  Json& out = summary.json;
  add_run(simulation, result, out);
  for (const auto& watcher : simulation.watchers()) watcher->add_summary(summary);
  out["convergence"]["warnings"] = result.warnings;
  out["solver"] = {{"engine", simulation.engine().version()},
                   {"method", engine::name(solver.method())},
                   {"step_s", solver.step}};
  if (solver.engine() == engine::EngineKind::ode) out["solver"]["seed"] = solver.ode().seed;
  out["versions"] = {{"handsim", kVersion},
                     {"engine", simulation.engine().version()},
                     {"compiler", __VERSION__},
                     {"mathematics", mathematics()}};
  if (!scene.spec.engine_choice.empty()) out["engine_choice"] = scene.spec.engine_choice;
  if (!scene.spec.step_choice.empty()) out["step_choice"] = scene.spec.step_choice;
  out["notes"] = simulation.engine().notes();
  out["warnings"] = scene.warnings;
  out["overlaps_at_start"] = overlaps_json(scene.model, result.overlaps);
  for (auto at = out.begin(); at != out.end();)
    if (at->is_null())
      at = out.erase(at);
    else
      ++at;
  return out.dump(2) + "\n";
}

}  // namespace handsim::simulation
