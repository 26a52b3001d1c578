#include "handsim/study/rollouts/rollout_figures.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include <fmt/format.h>

#include "handsim/output/table/csv_rows.h"
#include "handsim/simulation/watch/hand_parts.h"
#include "handsim/simulation/watch/summary_json.h"

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

/// Normal force of a part of the hand on the object [N].
double force_of(const simulation::Grip& grip, std::string_view part) {
  const auto found = std::ranges::find(grip.parts, part, &simulation::PartForce::part);
  return found == grip.parts.end() ? 0 : found->normal;
}

void add_muscles(const Simulation& simulation, NamedCells& out) {
  const std::vector<double>& activation = simulation.state().activation;
  double effort = 0;
  for (std::size_t i = 0; i < activation.size(); ++i) {
    effort += activation[i] * activation[i] / static_cast<double>(activation.size());
    out.emplace_back("activation." + simulation.model().muscles[i].name, activation[i]);
  }
  if (!activation.empty()) out.emplace_back("effort", effort);
}

/// Times of the machine, not of the motion.
bool is_cost(const std::string& key) { return key == "ledger" || key == "time" || key == "share_of_step"; }

/// @param path with a dot at its end, or empty.
void add_numbers(const simulation::Json& node, const std::string& path, std::map<std::string, double>& out) {
  const auto add = [&](const std::string& name, const simulation::Json& value) {
    if (value.is_structured())
      add_numbers(value, path + name + ".", out);
    else if (value.is_number())
      out[path + name] = value.get<double>();
    else if (value.is_boolean())
      out[path + name] = value.get<bool>() ? 1 : 0;
  };
  const auto name_of = [](const simulation::Json& item, std::size_t index) {
    for (const char* key : {"name", "part"})
      if (item.contains(key)) return item[key].get<std::string>();
    if (item.contains("a")) return item["a"].get<std::string>() + "." + item["b"].get<std::string>();
    return std::to_string(index);
  };
  if (node.is_array())
    for (std::size_t i = 0; i < node.size(); ++i) add(name_of(node[i], i), node[i]);
  else
    for (const auto& [key, value] : node.items())
      if (!is_cost(key)) add(key, value);
}

void add_grasp(const GraspFigures& grasp, const std::string& head, double now, NamedCells& out) {
  const auto add = [&](const char* name, Cell cell) { out.emplace_back(head + name, std::move(cell)); };
  const bool lost = grasp.lost(now);
  add("outcome", std::string(lost ? word(simulation::Outcome::lost) : word(grasp.outcome())));
  add("lost_at[s]", lost ? Cell(*grasp.left_time) : Cell());
  add("last_touched_by", lost ? Cell(grasp.last_part) : Cell());
  const simulation::Grip* grip = grasp.complete          ? &grasp.after
                                 : grasp.hold_measured() ? &grasp.hold
                                                         : nullptr;
  const auto add_grip = [&](const char* name, auto field) {
    add(name, grip ? number(static_cast<double>(field(*grip))) : Cell());
  };
  add("margin", grasp.margin_measured() ? number(grasp.margin()) : Cell());
  add_grip("contacts", [](const simulation::Grip& of) { return of.contacts; });
  add_grip("normal_force[N]", [](const simulation::Grip& of) { return of.normal; });
  add_grip("friction_used", [](const simulation::Grip& of) { return of.friction_used; });
  for (const char* part : simulation::kHandParts)
    add(fmt::format("force.{}[N]", part).c_str(), grip ? Cell(force_of(*grip, part)) : Cell());
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
  add_muscles(simulation, out);
  return out;
}

void add_curves(const Simulation& simulation, TimeSeries& to) {
  const model::Model& model = simulation.model();
  const model::State& state = simulation.state();
  const bool first = to.columns.empty();
  const auto add = [&](const std::string& name, double value) {
    if (first) to.columns.push_back(name);
    to.values.push_back(value);
  };
  add("time[s]", state.time);
  const std::vector<std::string> names = output::coordinate_names(model);
  for (const model::Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      if (!joint.slides(a))
        add(names[as_index(joint.first_dof) + a] + "[rad]", state.q[as_index(joint.first_dof) + a]);
  if (simulation.scene().control)
    for (const control::DrivenAxis& axis : simulation.scene().control->axes)
      add(axis.name + ".torque[N_m]", state.tau[axis.dof]);
  for (std::size_t i = 0; i < state.activation.size(); ++i)
    add(fmt::format("activation.{}.{}", simulation::moved_by(model.muscles[i], model), model.muscles[i].name),
        state.activation[i]);
  if (!simulation.scene().spec.solver.contact_forces) return;
  for (const model::HandIndex& hand : model.hands) {
    std::array<double, simulation::kHandParts.size()> forces{};
    for (const engine::Contact& contact : simulation.engine().contacts())
      for (const int index : {contact.shape_a, contact.shape_b}) {
        const model::Shape& shape = model.shapes[as_index(index)];
        const std::optional<std::size_t> part = simulation::hand_part(shape.part);
        if (part && std::ranges::find(hand.bodies, shape.body) != hand.bodies.end())
          forces[*part] += contact.normal_force();
      }
    for (std::size_t i = 0; i < forces.size(); ++i)
      add(fmt::format("force.{}.{}[N]", hand.name, simulation::kHandParts[i]), forces[i]);
  }
}

std::map<std::string, double> summary_figures(const Simulation& simulation) {
  simulation::SummaryJson summary;
  for (const auto& watcher : simulation.watchers()) watcher->add_summary(summary);
  std::map<std::string, double> out;
  add_numbers(summary.json, "", out);
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
