#include "handsim/scene/read/engine_choice.h"

#include <algorithm>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "handsim/core/data_folder.h"
#include "handsim/scene/read/blocks.h"

namespace handsim::scene {

namespace {

using model::Effect;
using model::EngineKind;

std::string number(double x) { return fmt::format("{:.12g}", x); }

CostRow read_row(MapReader reader) {
  CostRow row;
  row.error = reader.number("error", {Dimension::none, 0, 1e6});
  row.cost = reader.number("cost", {Dimension::none, 0, 1e6, true});
  read_settings(reader, row.solver);
  reader.finish();
  return row;
}

/// Bodies that more than one joint hangs on others, or joints in a ring.
bool has_loop(const MechanismSpec& mechanism) {
  std::map<std::string, std::string> up;
  const auto top = [&](std::string body) {
    while (up.contains(body)) body = up[body];
    return body;
  };
  for (const MechanismJointSpec& joint : mechanism.joints) {
    const std::string a = top(joint.parent), b = top(joint.child);
    if (a == b) return true;
    up[b] = a;
  }
  return false;
}

SceneKind kind_of_motion(const SceneSpec& scene) {
  const model::Effects& effects = scene.solver.effects;
  if (effects.any_contact()) return SceneKind::contact;
  if (effects.has(Effect::joint_stops)) return SceneKind::stops;
  return has_loop(scene.mechanism) ? SceneKind::loop : SceneKind::tree;
}

std::string_view described(SceneKind kind) {
  switch (kind) {
    case SceneKind::tree:
      return "free motion of trees of bodies";
    case SceneKind::loop:
      return "free motion with closed loops";
    case SceneKind::stops:
      return "motion that meets joint stops";
    case SceneKind::contact:
      return "motion with contact";
  }
  return {};
}

/// The scene asks for what the row's engine does not have.
bool refused(const CostRow& row, const SceneSpec& scene) {
  const EngineKind engine = model::engine_of(row.solver.method);
  if (engine != EngineKind::ode && scene.solver.effects.has(Effect::step_guard)) return true;
  return engine == EngineKind::dae && scene.control.has_value();
}

void put(YamlNode& map, const char* key, std::string value) {
  yaml_put(map, key, yaml_scalar(std::move(value)));
}

/// What the method goes by, and nothing else.
void put_settings(YamlNode& map, const model::SolverSettings& solver) {
  const EngineKind engine = model::engine_of(solver.method);
  put(map, "engine", std::string(model::name(engine)));
  put(map, "method", std::string(model::name(solver.method)));
  put(map, "step", number(solver.step));
  if (engine == EngineKind::ode) {
    put(map, "erp", number(solver.erp));
    put(map, "cfm", number(solver.cfm));
    put(map, "iterations", std::to_string(solver.iterations));
    put(map, "projection", solver.projection ? "true" : "false");
  }
  if (solver.method == model::Method::stabilised_gear || solver.method == model::Method::dormand_prince)
    put(map, "tolerance", number(solver.tolerance));
}

std::string text_of(const CostRow& row) {
  std::string out = fmt::format("{} {} at {:g} ms", model::name(model::engine_of(row.solver.method)),
                                model::name(row.solver.method), 1e3 * row.solver.step);
  if (row.solver.method == model::Method::stabilised_gear ||
      row.solver.method == model::Method::dormand_prince)
    out += fmt::format(", tolerance {:g}", row.solver.tolerance);
  return out;
}

/// Where the scene lies outside what was measured.
std::vector<std::string> beyond(const SceneSpec& scene, const CostTable& table, double duration) {
  std::vector<std::string> out;
  if (duration > 1.5 * table.duration)
    out.push_back(fmt::format("errors were measured over {:g} s, and grow with time: the scene takes {:g} s",
                              table.duration, duration));
  if (table.kind != SceneKind::loop && has_loop(scene.mechanism))
    out.push_back(fmt::format("nothing was measured of closed loops beside {}",
                              kSceneKindNames[static_cast<std::size_t>(table.kind)]));
  return out;
}

/// The table beside the scene, or else the one that ships with handsim.
YamlNode default_costs(const YamlNode& scene, const YamlNode& engine) {
  const char* name = "accuracy_costs.yaml";
  std::error_code failure;
  const bool beside = std::filesystem::is_regular_file(
      std::filesystem::path(scene.place().file).parent_path() / name, failure);
  YamlNode out = yaml_scalar(beside ? name : (data_folder() / "config" / name).string());
  out.file = scene.file;
  out.line = engine.line;
  out.column = engine.column;
  return out;
}

}  // namespace

std::vector<CostTable> read_costs(YamlNode& root, Diagnostics& diagnostics) {
  std::vector<CostTable> out;
  if (!is_of_kind(root, "", FileKind::costs, diagnostics)) return out;
  MapReader reader(root, "", diagnostics);
  if (YamlNode* kinds = reader.list("kinds", true))
    for (std::size_t i = 0; i < kinds->items.size(); ++i) {
      MapReader item(kinds->items[i], item_path("kinds", i), diagnostics);
      CostTable& table = out.emplace_back();
      std::vector<std::pair<std::string_view, SceneKind>> words;
      for (std::size_t k = 0; k < kSceneKindNames.size(); ++k)
        words.emplace_back(kSceneKindNames[k], static_cast<SceneKind>(k));
      table.kind = item.choice<SceneKind>("kind", words);
      table.scene = item.text("scene");
      table.duration = item.number("duration", {Dimension::time, 1e-6, 1e5});
      if (YamlNode* rows = item.list("rows", true))
        for (std::size_t k = 0; k < rows->items.size(); ++k)
          table.rows.push_back(
              read_row(MapReader(rows->items[k], item_path(item.path_of("rows"), k), diagnostics)));
      item.finish();
    }
  reader.finish();
  return out;
}

YamlNode write_costs(const std::vector<CostTable>& tables) {
  YamlNode root = yaml_map();
  YamlNode kinds = yaml_sequence();
  for (const CostTable& table : tables) {
    YamlNode item = yaml_map();
    put(item, "kind", std::string(kSceneKindNames[static_cast<std::size_t>(table.kind)]));
    yaml_put(item, "scene", yaml_scalar(table.scene, true));
    put(item, "duration", number(table.duration));
    YamlNode rows = yaml_sequence();
    for (const CostRow& row : table.rows) {
      YamlNode line = yaml_map();
      put(line, "error", fmt::format("{:.3g}", row.error));
      put(line, "cost", fmt::format("{:.3g}", row.cost));
      put_settings(line, row.solver);
      rows.items.push_back(std::move(line));
    }
    yaml_put(item, "rows", std::move(rows));
    kinds.items.push_back(std::move(item));
  }
  yaml_put(root, "kinds", std::move(kinds));
  return root;
}

void choose_engine(MapReader& reader, SceneSpec& scene) {
  YamlNode* solver = reader.node().find("solver");
  const YamlNode* engine = solver && solver->kind == YamlNode::Kind::map ? solver->find("engine") : nullptr;
  if (!engine || engine->text != "auto") return;
  MapReader block(*solver, "solver", reader.diagnostics());
  for (const char* key : {"method", "step", "erp", "cfm", "iterations", "projection", "tolerance"})
    if (const YamlNode* given = solver->find(key))
      block.problem(key, given->described(), "nothing: engine auto chooses it");
  const double accuracy = block.number("accuracy", {Dimension::none, 1e-12, 1});
  if (!solver->find("costs")) yaml_put(*solver, "costs", default_costs(reader.node(), *engine));
  YamlNode costs = *solver->find("costs");
  const Place place =
      block.node().find("accuracy") ? block.node().find("accuracy")->place() : engine->place();
  std::vector<CostTable> tables;
  try {
    follow_reference(costs, "solver.costs", reader.diagnostics().budget);
    tables = read_costs(costs, reader.diagnostics());
  } catch (const Error& error) {
    reader.diagnostics().take(error);
  }
  solver->entries.remove_if([](const YamlEntry& e) { return e.key == "accuracy" || e.key == "costs"; });
  put(*solver, "engine", "ode");
  if (!reader.sound()) return;

  const SceneKind kind = kind_of_motion(scene);
  const auto table =
      std::find_if(tables.begin(), tables.end(), [&](const CostTable& each) { return each.kind == kind; });
  const std::string_view name = kSceneKindNames[static_cast<std::size_t>(kind)];
  if (table == tables.end()) {
    reader.diagnostics().problems.push_back(
        {place, "solver.engine", "auto",
         fmt::format("an engine: nothing was measured of scenes of kind {}", name)});
    return;
  }
  const CostRow* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const CostRow& row : table->rows) {
    if (refused(row, scene)) continue;
    least = std::min(least, row.error);
    if (row.error <= accuracy && (!best || row.cost < best->cost)) best = &row;
  }
  if (!best) {
    reader.diagnostics().problems.push_back(
        {place, "solver.accuracy", number(accuracy),
         fmt::format("{:.3g} or more: the best that was measured of {}, on {}", least, described(kind),
                     table->scene)});
    return;
  }
  put_settings(*solver, best->solver);
  scene.engine_choice = fmt::format(
      "{}: the cheapest of what reaches {:g} on {} ({}), with an error of {:.2g} and {:.3g} CPU seconds a "
      "second",
      text_of(*best), accuracy, table->scene, described(kind), best->error, best->cost);
  const YamlNode* duration = reader.node().find("duration");
  double time = scene.tasks_end();
  if (duration)
    if (const auto given = parse_quantity(duration->text, Dimension::time)) time = *given;
  for (const std::string& text : beyond(scene, *table, time))
    reader.warning("solver", "engine auto: " + text);
}

}  // namespace handsim::scene
