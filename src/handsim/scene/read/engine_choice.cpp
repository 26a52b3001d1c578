#include "handsim/scene/read/engine_choice.h"

#include <algorithm>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "handsim/core/data_folder.h"
#include "handsim/core/input_file.h"
#include "handsim/scene/read/blocks.h"

namespace handsim::scene {

namespace {

using engine::EngineKind;
using model::Effect;

std::string number(double x) { return fmt::format("{:.12g}", x); }

/// The keys of engine auto: what it chooses by, and settings of whatever engine it chooses.
struct AutoSettings {
  double accuracy = 0.01;
  bool speculative = true;
  std::uint64_t seed = 1;

  template <class Visit>
  static void fields(Visit&& visit) {
    visit("accuracy", &AutoSettings::accuracy, Quantity{Dimension::none, 1e-12, 1});
    visit("speculative", &AutoSettings::speculative);
    visit("seed", &AutoSettings::seed, engine::kSeedRange);
  }
};

CostRow read_row(MapReader reader) {
  CostRow row;
  row.error = reader.number("error", {Dimension::none, 0, 1e6});
  row.cost = reader.number("cost", {Dimension::none, 0, 1e6, true});
  read_settings(reader, row.solver);
  reader.finish();
  return row;
}

bool has_loop(const MechanismSpec& mechanism) {
  std::map<std::string, std::string> parent_of;
  const auto root_of = [&](std::string body) {
    while (parent_of.contains(body)) body = parent_of[body];
    return body;
  };
  for (const MechanismJointSpec& joint : mechanism.joints) {
    const std::string a = root_of(joint.parent), b = root_of(joint.child);
    if (a == b) return true;
    parent_of[b] = a;
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
  constexpr std::string_view kTexts[] = {"free motion of trees of bodies", "free motion with closed loops",
                                         "motion with joint stops", "motion with contact"};
  return kTexts[static_cast<std::size_t>(kind)];
}

bool unsuitable(const CostRow& row, const SceneSpec& scene) {
  if (engine::missing_library(row.solver)) return true;
  return row.solver.engine() == EngineKind::dae && scene.control.has_value();
}

void put(YamlNode& map, std::string_view key, std::string value) {
  yaml_put(map, std::string(key), yaml_scalar(std::move(value)));
}

void put_settings(YamlNode& map, const engine::Settings& solver) {
  put(map, "engine", std::string(engine::name(solver.engine())));
  put(map, "step", number(solver.step));
  each_setting(solver, [&]<class T>(std::string_view key, const T& value, const auto&...) {
    if constexpr (std::is_enum_v<T>) {
      put(map, key, std::string(engine::name(engine::Method(value))));
    } else if constexpr (std::same_as<T, double>) {
      put(map, key, number(value));
    } else {
      put(map, key, fmt::format("{}", value));
    }
  });
}

std::string text_of(const CostRow& row) {
  std::string out = fmt::format("{} {} at {:g} ms", engine::name(row.solver.engine()),
                                engine::name(row.solver.method()), 1e3 * row.solver.step);
  const engine::Method method = row.solver.method();
  if (method == engine::DaeMethod::stabilised_gear)
    out += fmt::format(", tolerance {:g}", row.solver.dae().tolerance);
  if (method == engine::ArticulatedMethod::dormand_prince)
    out += fmt::format(", tolerance {:g}", row.solver.articulated().tolerance);
  return out;
}

/// Warnings for a scene outside the range of the measurements.
std::vector<std::string> extrapolations(const SceneSpec& scene, const CostTable& table, double duration) {
  std::vector<std::string> out;
  if (duration > 1.5 * table.duration)
    out.push_back(fmt::format("errors were measured over {:g} s and grow with time: the scene lasts {:g} s",
                              table.duration, duration));
  if (table.kind != SceneKind::loop && has_loop(scene.mechanism))
    out.push_back(fmt::format("there is no measurement of closed loops together with {}",
                              kSceneKindNames[static_cast<std::size_t>(table.kind)]));
  return out;
}

/// The table beside the scene, or else the installed one.
YamlNode default_costs(const YamlNode& scene, const YamlNode& engine) {
  const char* name = "accuracy_costs.yaml";
  const bool beside = is_file(std::filesystem::path(scene.place().file).parent_path() / name);
  YamlNode out = yaml_scalar(beside ? name : (data_folder() / "config" / name).string());
  out.file = scene.file;
  out.line = engine.line;
  out.column = engine.column;
  return out;
}

/// The tables that the block names, or else the default ones; none, with problems, if they cannot be read.
std::vector<CostTable> tables_of(MapReader& block, const YamlNode& scene, const YamlNode& engine) {
  const std::string key = block.path_of("costs");
  const YamlNode* given = referenced(block, "costs", FileKind::costs, false);
  if (block.diagnostics().recorder || (!given && block.node().find("costs"))) return {};
  try {
    YamlNode costs = given ? *given : default_costs(scene, engine);
    follow_reference(costs, key, block.diagnostics().budget);
    return read_costs(costs, key, block.diagnostics());
  } catch (const Error& error) {
    block.diagnostics().add(error);
  }
  return {};
}

/// The cheapest row that reaches the accuracy; null, with a problem, if no row does.
const CostRow* cheapest(const CostTable& table, const SceneSpec& scene, double accuracy, MapReader& block) {
  const CostRow* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const CostRow& row : table.rows) {
    if (unsuitable(row, scene)) continue;
    least = std::min(least, row.error);
    if (row.error <= accuracy && (!best || row.cost < best->cost)) best = &row;
  }
  if (!best)
    block.problem("accuracy", number(accuracy),
                  fmt::format("{:.3g} or more: the best measured for {}, on {}", least, described(table.kind),
                              table.scene));
  return best;
}

double duration_of(MapReader& reader, const SceneSpec& scene) {
  if (const YamlNode* duration = reader.node().find("duration"))
    if (const auto given = parse_quantity(duration->text, Dimension::time)) return *given;
  return scene.tasks_end();
}

}  // namespace

std::vector<CostTable> read_costs(const YamlNode& root, const std::string& path, Diagnostics& diagnostics) {
  std::vector<CostTable> out;
  if (!is_of_kind(root, path, FileKind::costs, diagnostics)) return out;
  MapReader reader(root, path, diagnostics);
  reader.each("kinds", 1, kMostItems, [&](MapReader item) {
    CostTable& table = out.emplace_back();
    std::vector<std::pair<std::string_view, SceneKind>> words;
    for (std::size_t k = 0; k < kSceneKindNames.size(); ++k)
      words.emplace_back(kSceneKindNames[k], static_cast<SceneKind>(k));
    table.kind = item.choice<SceneKind>("kind", words);
    table.scene = item.text("scene");
    table.duration = item.number("duration", {Dimension::time, 1e-6, 1e5});
    item.each("rows", 1, kMostItems, [&](MapReader row) { table.rows.push_back(read_row(std::move(row))); });
    item.finish();
  });
  reader.finish();
  return out;
}

bool asks_for_step(const YamlNode& resolved) {
  const YamlNode* step = value_at(resolved, "solver.step");
  return step && step->text == "auto";
}

void choose_engine(MapReader& reader, SceneSpec& scene) {
  MapReader block = reader.map("solver");
  const YamlNode engine = *block.child("engine");
  refuse_keys(
      block,
      [&](const YamlEntry& entry) -> std::optional<std::string> {
        for (const char* key : {"method", "step", "erp", "cfm", "iterations", "projection", "tolerance"})
          if (entry.key == key) return "nothing: engine auto chooses it";
        return std::nullopt;
      },
      "engine auto chooses them");
  AutoSettings own;
  block.fields(own);
  const std::vector<CostTable> tables = tables_of(block, reader.node(), engine);
  block.finish();
  if (!reader.sound()) return;

  const SceneKind kind = kind_of_motion(scene);
  const auto table = std::ranges::find_if(tables, [&](const CostTable& each) { return each.kind == kind; });
  if (table == tables.end())
    return block.problem("engine", "auto",
                         fmt::format("a named engine: there is no measurement of scenes of kind {}",
                                     kSceneKindNames[static_cast<std::size_t>(kind)]));
  const CostRow* best = cheapest(*table, scene, own.accuracy, block);
  if (!best) return;
  scene.solver.step = best->solver.step;
  scene.solver.own = best->solver.own;
  if (bool* speculative = engine::speculative(scene.solver)) *speculative = own.speculative;
  if (scene.solver.engine() == EngineKind::ode) scene.solver.ode().seed = own.seed;
  scene.engine_choice = fmt::format(
      "{}: the cheapest that reaches {:g} on {} ({}), with an error of {:.2g} and {:.3g} CPU seconds per "
      "simulated second",
      text_of(*best), own.accuracy, table->scene, described(kind), best->error, best->cost);
  for (const std::string& text : extrapolations(scene, *table, duration_of(reader, scene)))
    reader.warning("solver", "engine auto: " + text);
  YamlNode chosen = block.node();
  chosen.entries.clear();
  put_settings(chosen, scene.solver);
  block.resolve("", std::move(chosen));
}

}  // namespace handsim::scene
