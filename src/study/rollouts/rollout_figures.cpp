#include "handsim/study/rollouts/rollout_figures.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include <fmt/format.h>

namespace handsim::study {

namespace {

using simulation::GraspFigures;
using simulation::Simulation;
using simulation::Verdict;

std::string with_unit(const std::string& name, const std::string& unit) {
  return unit.empty() ? name : fmt::format("{}[{}]", name, unit);
}

Cell number(double value) { return std::isnan(value) ? Cell() : Cell(value); }

void add_verdicts(const Simulation& simulation, NamedCells& out) {
  std::map<std::string, int> seen;
  for (const Verdict& verdict : simulation.verdicts()) {
    // One of each grasp.
    const int nth = ++seen[verdict.name];
    const std::string name = nth > 1 ? fmt::format("{}.{}", verdict.name, nth) : verdict.name;
    out.emplace_back(with_unit(name, verdict.unit), verdict.measured ? number(*verdict.measured) : Cell());
    if (verdict.limit)
      out.emplace_back(name + ".held", verdict.missed() ? Cell() : Cell(verdict.held() ? 1.0 : 0.0));
  }
}

void add_grasp(const GraspFigures& grasp, const std::string& head, double now, NamedCells& out) {
  const auto add = [&](const char* name, Cell cell) { out.emplace_back(head + name, std::move(cell)); };
  const bool lost = grasp.lost(now);
  add("outcome", std::string(lost ? word(simulation::Outcome::lost) : word(grasp.outcome())));
  add("lost_at[s]", lost ? Cell(grasp.left_time) : Cell());
  add("last_touched_by", lost ? Cell(grasp.last_part) : Cell());
  const simulation::Grip* grip = grasp.complete          ? &grasp.after
                                 : grasp.hold_measured() ? &grasp.hold
                                                         : nullptr;
  const auto add_grip = [&](const char* name, auto field) {
    add(name, grip ? number(static_cast<double>(field(*grip))) : Cell());
  };
  add("margin", grasp.complete ? number(grasp.margin()) : Cell());
  add_grip("contacts", [](const simulation::Grip& of) { return of.contacts; });
  add_grip("normal_force[N]", [](const simulation::Grip& of) { return of.normal; });
  add_grip("friction_used", [](const simulation::Grip& of) { return of.friction_used; });
  add_grip("force_closure", [](const simulation::Grip& of) { return of.wrenches.force_closure; });
  add_grip("epsilon", [](const simulation::Grip& of) { return of.wrenches.epsilon; });
  add_grip("wrench_volume", [](const simulation::Grip& of) { return of.wrenches.volume; });
}

}  // namespace

NamedCells figures_of(const Simulation& simulation) {
  NamedCells out;
  add_verdicts(simulation, out);
  const auto grasps = simulation.figures<simulation::Grasps>();
  for (const GraspFigures& grasp : grasps)
    add_grasp(grasp, grasps.size() > 1 ? grasp.name + "." : "", simulation.state().time, out);
  const auto climbs = simulation.figures<simulation::Climbs>();
  for (const simulation::ClimbFigures& climb : climbs) {
    const std::string head = climbs.size() > 1 ? climb.name + "." : "";
    out.emplace_back(head + "carried[N]", climb.begun() ? number(climb.carried) : Cell());
    out.emplace_back(head + "carried_of_norm", climb.begun() ? number(climb.share()) : Cell());
  }
  return out;
}

std::optional<bool> is_held(const Simulation& simulation, bool diverged) {
  if (diverged) return false;
  const auto grasps = simulation.figures<simulation::Grasps>();
  if (!grasps.empty())
    return std::ranges::all_of(grasps, [](const GraspFigures& grasp) { return grasp.held; });
  const std::vector<Verdict> verdicts = simulation.verdicts();
  if (std::ranges::none_of(verdicts, [](const Verdict& v) { return v.limit.has_value(); }))
    return std::nullopt;
  return std::ranges::all_of(verdicts, std::mem_fn(&Verdict::held));
}

std::string ended(const Simulation& simulation) {
  const auto* grasps = simulation.find<simulation::Grasps>();
  const bool decided = grasps && grasps->decided(simulation.state().time);
  return decided && simulation.steps() < simulation.step_count() ? "decided" : "end";
}

}  // namespace handsim::study
