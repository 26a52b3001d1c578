// The hard cases of config/stability.yaml on other engines: `peer_cases STUDY OUT.json ENGINE [CASE...]`,
// ENGINE handsim, mujoco or drake. What only handsim's own engines are asked (how often the LCP solver gave
// up, softness of ODE's constraints) is left out, and the quick suite's durations serve.
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include "handsim/engine/checks.h"
#include "peers/drake_engine.h"
#include "peers/other_engine.h"
#include "stability/stability.h"
#ifdef HANDSIM_WITH_MUJOCO
#include <mujoco/mujoco.h>

#include "peers/mujoco_engine.h"
#endif

namespace {

using namespace handsim;
using Json = nlohmann::json;

/// A setting of an engine, under the name that tables have.
struct Setting {
  std::string name;
  peers::MakeEngine make;
  std::shared_ptr<peers::CpuLimit> limit = {};  ///< for a case
  bool of_contact = false;  ///< the same as the engine's other settings where nothing can touch
};

/// CPU time of Drake for a case with a setting [s]: its steps through Python are slow.
constexpr double kDrakeTime = 8;

/// Long, and with palms that move as told, which no peer is asked.
const std::set<std::string> kTooLong = {"soak", "grasp_and_shake", "pinch_and_shake"};
const std::set<std::string> kOnlyOurs = {"lcp_failures", "memory_growth"};

#ifdef HANDSIM_WITH_MUJOCO
std::vector<Setting> mujoco_settings() {
  using Options = peers::MujocoOptions;
  const auto firm = [](const std::string& integrator) {
    return Options{integrator, true, 10, 10, true, false};
  };
  std::vector<std::pair<std::string, Options>> options = {
      {"Euler, as exported", {}},
      {"Euler, firm", firm("Euler")},
      {"Euler, firm, impratio 100, no noslip", {"Euler", true, 100, 0, true, false}},
      {"Euler, firm, pyramidal", {"Euler", false, 1, 10, true, false}},
      {"implicit, firm", firm("implicit")},
      {"RK4, firm", firm("RK4")}};
#if mjVERSION_HEADER >= 4000000
  options.insert(options.end(), {{"implicitfast, firm", firm("implicitfast")},
                                 {"discrete, as exported", {"discrete"}},
                                 {"discrete, firm", firm("discrete")},
                                 {"discrete, firm, speculative", {"discrete", true, 10, 10, true, true}}});
#endif
  std::vector<Setting> out;
  for (const auto& [name, each] : options)
    out.push_back({name, [each = each](const model::Model& model, const engine::Settings& settings) {
                     return peers::make_mujoco(model, settings, each);
                   }});
  return out;
}
#endif

std::vector<Setting> drake_settings() {
  std::vector<Setting> out;
  std::vector<std::pair<std::string, peers::DrakeOptions>> options = {{"lagged, 1e6 Pa", {"lagged", 1e6}},
                                                                      {"lagged, 1e8 Pa", {"lagged", 1e8}},
                                                                      {"SAP, 1e6 Pa", {"sap", 1e6}}};
  for (auto& [name, each] : options) {
    each.limit = std::make_shared<peers::CpuLimit>();
    each.limit->seconds = kDrakeTime;
    out.push_back({name,
                   [each = each](const model::Model& model, const engine::Settings& settings) {
                     return peers::make_drake(model, settings, each);
                   },
                   each.limit, true});
  }
  return out;
}

/// Variants that differ in ODE's softness are one variant to others, and nothing bounces there.
void simplify(study::StabilityCase& of) {
  const auto has = [](const study::Alternative& alternative, const char* key) {
    return std::any_of(alternative.set.begin(), alternative.set.end(),
                       [&](const std::string& set) { return set.find(key) != std::string::npos; });
  };
  for (std::vector<study::Alternative>& dimension : of.varied) {
    std::vector<study::Alternative> kept;
    for (const study::Alternative& alternative : dimension) {
      if (!kept.empty() && (has(alternative, "solver.erp=") || has(alternative, ".bounce="))) continue;
      kept.push_back(alternative);
    }
    dimension = std::move(kept);
  }
  std::erase_if(of.measures, [](const study::MeasureSpec& spec) { return kOnlyOurs.contains(spec.kind); });
  std::erase_if(of.ways, [](const study::Way& way) { return way.refused.has_value(); });
  of.picture.reset();
}

/// The steps of the articulated engine where the case has it, else of the first way.
std::vector<double> steps_of(const study::StabilityCase& of) {
  for (const study::Way& way : of.ways)
    if (way.name.starts_with("articulated")) return way.steps;
  return of.ways.front().steps;
}

/// Of all figures the one furthest beyond its limit, and whether all are within. Runs that took too long
/// count only where no other figure is beyond its limit: then there is no verdict.
Json verdict(study::CaseResult result, const std::string& way) {
  const auto too_slow = [](const study::StabilityRow& row) {
    return row.fault.find(peers::kTooSlow) != std::string::npos;
  };
  const bool complete = std::erase_if(result.rows, too_slow) == 0;
  const auto held = [](const study::StabilityRow& row) { return row.within(); };
  if (!complete && std::all_of(result.rows.begin(), result.rows.end(), held))
    return {{"way", way}, {"too_slow", true}};
  const study::StabilityRow* worst = nullptr;
  Json figures = Json::array();
  for (const study::StabilityRow& row : study::worst_rows(result)) {
    if (row.way != way) continue;
    figures.push_back({{"measure", row.measure},
                       {"step", row.step},
                       {"variant", row.variant},
                       {"unit", row.unit},
                       {"limit", row.limit},
                       {"fault", row.fault},
                       {"held", row.within()}});
    if (row.value) figures.back()["value"] = *row.value;
  }
  for (const study::StabilityRow& row : result.rows)
    if (row.way == way && (!worst || row.severity() > worst->severity())) worst = &row;
  Json out = {{"way", way}, {"figures", figures}};
  if (!worst) return out;
  out["held"] = std::all_of(figures.begin(), figures.end(), [](const Json& row) { return row["held"]; });
  out["worst"] = {{"measure", worst->measure},
                  {"step", worst->step},
                  {"variant", worst->variant},
                  {"fault", worst->fault},
                  {"where", worst->where}};
  if (std::isfinite(worst->severity())) out["worst"]["severity"] = worst->severity();
  return out;
}

study::StabilityResult run(const study::StabilitySpec& spec) {
  study::StabilityOptions options;
  options.quick = true;
  options.cases = {spec.cases.front().name};
  return study::run_stability(spec, options);
}

Json run_case(study::StabilityCase of, const std::vector<Setting>& settings,
              std::set<std::string>& versions) {
  simplify(of);
  Json out = {{"name", of.name}, {"title", of.title}, {"ways", Json::array()}};
  if (of.measures.empty() || of.ways.empty()) {
    out["left_out"] = "asked of handsim alone";
    return out;
  }
  study::StabilitySpec spec{"", {of}};
  study::StabilityCase& only = spec.cases.front();
  const auto add = [&](const std::vector<std::string>& ways) {
    try {
      const study::StabilityResult result = run(spec);
      versions.insert(result.engines.begin(), result.engines.end());
      for (const std::string& way : ways) out["ways"].push_back(verdict(result.cases.front(), way));
    } catch (const Error& error) {
      for (const std::string& way : ways) out["ways"].push_back({{"way", way}, {"left_out", error.what()}});
    }
  };
  if (settings.empty()) {
    std::vector<std::string> names;
    for (const study::Way& way : only.ways)
      if (std::find(names.begin(), names.end(), way.name) == names.end()) names.push_back(way.name);
    add(names);
    return out;
  }
  const std::vector<double> steps = steps_of(of);
  std::atomic<bool> contact = false;
  for (const Setting& setting : settings) {
    if (setting.of_contact && !contact && !out["ways"].empty()) {
      out["ways"].push_back(out["ways"].front());
      out["ways"].back()["way"] = setting.name;
      continue;
    }
    peers::use_engine([&](const model::Model& model, const engine::Settings& with) {
      if (engine::needs_contacts(model, with.effects)) contact = true;
      return setting.make(model, with);
    });
    if (setting.limit) setting.limit->spent = 0;
    only.ways = {
        {setting.name, {"solver.engine=articulated", "solver.method=semi_implicit_euler"}, steps, {}, true}};
    add({setting.name});
  }
  return out;
}

std::vector<Setting> settings_of(const std::string& engine) {
  if (engine == "drake") return drake_settings();
#ifdef HANDSIM_WITH_MUJOCO
  if (engine == "mujoco") return mujoco_settings();
#endif
  if (engine != "handsim")
    throw input_error("engine", engine, "handsim, mujoco or drake, where they are built");
  return {};
}

}  // namespace

int main(int count, char** arguments) try {
  if (count < 4) {
    std::fprintf(stderr, "peer_cases STUDY OUT.json ENGINE [CASE...]\n");
    return 2;
  }
  const std::vector<std::string> chosen(arguments + 4, arguments + count);
  const std::vector<Setting> settings = settings_of(arguments[3]);
  study::StabilitySpec spec = study::load_stability(arguments[1]);
  std::set<std::string> versions;
  Json cases = Json::array();
  for (study::StabilityCase& of : spec.cases) {
    if (!chosen.empty() && std::find(chosen.begin(), chosen.end(), of.name) == chosen.end()) continue;
    if (kTooLong.contains(of.name)) continue;
    std::fprintf(stderr, "%s: %s\n", arguments[3], of.name.c_str());
    cases.push_back(run_case(of, settings, versions));
    // Of a run that is stopped there is what it got through.
    std::ofstream(arguments[2])
        << Json{{"engine", arguments[3]}, {"versions", versions}, {"cases", cases}}.dump(1) << "\n";
  }
  return 0;
} catch (const handsim::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
