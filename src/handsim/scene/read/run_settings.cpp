#include "handsim/scene/read/run_settings.h"

#include <algorithm>
#include <cmath>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/scene/read/blocks.h"
#include "handsim/scene/read/engine_choice.h"
#include "handsim/scene/read/scene_file.h"

namespace handsim::scene {

namespace {

void read_size(MapReader& reader, std::array<int, 2>& out) {
  const std::string need = "[width, height] in pixels, whole numbers, 16 to 8192";
  const YamlNode* size = reader.value("size", {{YamlNode::Kind::sequence}, need, false});
  if (!size) return;
  bool valid = size->items.size() == 2;
  for (std::size_t i = 0; valid && i < 2; ++i) {
    const auto pixels = parse_number(size->items[i].text);
    valid = pixels && *pixels >= 16 && *pixels <= 8192 && *pixels == std::floor(*pixels);
    if (valid) out[i] = static_cast<int>(*pixels);
  }
  if (!valid) reader.problem("size", size->described(), need);
}

CameraSpec read_camera(MapReader camera) {
  CameraSpec spec;
  spec.position = camera.vector("position", kCoordinate);
  spec.target = camera.vector("target", kCoordinate, Vec3::Zero());
  spec.field_of_view = camera.number("field_of_view", {Dimension::angle, 0.01, 2.5}, 0.6);
  if (camera.sound() && (spec.position - spec.target).norm() < 1e-6)
    camera.problem("position", "the target itself", "a position away from the target");
  camera.finish();
  return spec;
}

using engine::EngineKind;

engine::Settings settings_of(EngineKind kind) {
  engine::Settings out;
  out.use(kind);
  return out;
}

/// Names of the methods of an engine.
std::span<const std::string_view> methods_of(EngineKind kind) {
  return std::visit([](const auto& own) { return engine::method_names(own.method); }, settings_of(kind).own);
}

std::vector<std::string_view> keys_of(EngineKind kind) {
  std::vector<std::string_view> keys;
  each_setting(settings_of(kind), [&](std::string_view key, const auto&...) { keys.push_back(key); });
  return keys;
}

bool contains(std::span<const std::string_view> words, std::string_view word) {
  return std::ranges::find(words, word) != words.end();
}

constexpr std::array kEngines = {EngineKind::ode, EngineKind::dae, EngineKind::articulated};

/// For a key or method that this engine does not have, what is needed instead; otherwise nothing.
std::optional<std::string> needed_for(EngineKind kind, const YamlEntry& entry) {
  if (entry.key == "method" && !contains(methods_of(kind), entry.value.text))
    return fmt::format("one of {}", fmt::join(methods_of(kind), ", "));
  if (contains(keys_of(kind), entry.key)) return std::nullopt;
  std::vector<std::string_view> owners;
  for (const EngineKind other : kEngines)
    if (contains(keys_of(other), entry.key)) owners.push_back(engine::name(other));
  if (entry.key == "accuracy" || entry.key == "costs") owners.emplace_back("auto");
  if (owners.empty()) return std::nullopt;
  return fmt::format("a key of engine {}: {} is one of engine {}", engine::name(kind), entry.key,
                     fmt::join(owners, " and "));
}

}  // namespace

bool of_command_line(const YamlNode& node) { return node.file && node.file->starts_with("--set"); }

void refuse_keys(MapReader& reader, const std::function<std::optional<std::string>(const YamlEntry&)>& need,
                 const std::string& why) {
  YamlNode block = reader.node();
  const YamlNode* engine = block.find("engine");
  const bool switched = engine && of_command_line(*engine);
  std::vector<std::string> left_out;
  for (auto entry = block.entries.begin(); entry != block.entries.end();) {
    const auto needed = need(*entry);
    const bool drop = needed && switched && !of_command_line(entry->value);
    if (drop) left_out.push_back(entry->key == "method" ? "method " + entry->value.text : entry->key);
    if (needed && !drop) {
      reader.has(entry->key);
      reader.problem(entry->key, entry->value.described(), *needed);
    }
    entry = drop ? block.entries.erase(entry) : std::next(entry);
  }
  if (left_out.empty()) return;
  reader.read_instead(std::move(block));
  reader.warning("engine", fmt::format("the file's {} left out: {}", fmt::join(left_out, ", "), why));
}

namespace {

/// @param chosen_step `step: auto` is accepted (engine_choice.h)
void read_settings(MapReader& reader, engine::Settings& solver, bool chosen_step) {
  std::vector<std::pair<std::string_view, EngineKind>> engines;
  for (const EngineKind kind : kEngines) engines.emplace_back(engine::name(kind), kind);
  // For the message only: choose_engine() reads engine auto.
  engines.emplace_back("auto", EngineKind::ode);
  const std::size_t before = reader.diagnostics().problems.size();
  const EngineKind kind = reader.choice<EngineKind>("engine", engines, EngineKind::ode);
  const auto read_step = [&] {
    const std::string need = engine::kStepRange.need() + ", or on engine articulated auto";
    const YamlNode* step =
        chosen_step ? reader.value("step", {{YamlNode::Kind::scalar}, need, false, {"auto"}}) : nullptr;
    if (step && step->text == "auto")
      return kind == EngineKind::articulated ? void() : reader.problem("step", "auto", need);
    // What is no scalar is a problem already.
    if (step || !chosen_step || !reader.node().find("step"))
      solver.step = reader.number("step", engine::kStepRange, solver.step);
  };
  // The keys of an unknown engine are unknown, too: all are accepted.
  if (const YamlNode* named = reader.node().find("engine"); named && named->text != engine::name(kind)) {
    if (reader.diagnostics().problems.size() == before)
      reader.problem("engine", named->text, "a named engine: auto is for a scene's solver");
    for (const YamlEntry& entry : reader.node().entries) reader.has(entry.key);
    return read_step();
  }
  refuse_keys(
      reader, [kind](const YamlEntry& entry) { return needed_for(kind, entry); },
      fmt::format("engine {} does not have them", engine::name(kind)));
  read_step();
  solver.use(kind);
  if (kind == EngineKind::ode && solver.effects.has(model::Effect::muscles))
    solver.ode().iterations = engine::kMuscleIterations;
  std::visit([&](auto& own) { reader.fields(own); }, solver.own);
}

}  // namespace

void read_settings(MapReader& reader, engine::Settings& solver) { read_settings(reader, solver, false); }

void read_solver(MapReader& reader, SceneSpec& scene) {
  MapReader solver = reader.map("solver");
  const YamlNode* engine = solver.node().find("engine");
  if (engine && engine->text == "auto") return choose_engine(reader, scene);
  read_settings(solver, scene.solver, true);
  if (const auto problem = engine::missing_library(scene.solver))
    solver.problem("method", problem->got, problem->need);
  solver.finish();
}

PictureSpec read_pictures(MapReader reader, PictureSpec out) {
  read_size(reader, out.size);
  // A camera replaces the view.
  if (!reader.has("camera"))
    out.view = reader.choice<View>("view",
                                   {{"dorsal", View::dorsal},
                                    {"palmar", View::palmar},
                                    {"radial", View::radial},
                                    {"three_quarter", View::three_quarter}},
                                   View::three_quarter);
  else if (reader.has("view"))
    reader.problem("view", "a view beside a camera", "one of the two");
  if (reader.has("camera")) out.camera = read_camera(reader.map("camera"));
  out.floor = reader.flag("floor", true);
  out.hands = reader.choice<HandLook>(
      "hands", {{"skin", HandLook::skin}, {"shapes", HandLook::shapes}, {"both", HandLook::both}}, out.hands);
  if (out.hands == HandLook::shapes && reader.has("skin_color"))
    reader.problem("skin_color", "a color of skin beside hands: shapes", "hands: skin, or both");
  out.finger_colours = reader.flag("finger_colors", false);
  if (out.hands != HandLook::skin && out.finger_colours)
    reader.problem("finger_colors", "colors of fingers beside shapes, which have them", "hands: skin");
  out.skin_colour = read_colour(reader, "skin_color").value_or(out.skin_colour);
  out.joint_axes = reader.flag("joint_axes", false);
  out.contact_points = reader.flag("contact_points", false);
  out.contact_forces = reader.flag("contact_forces", false);
  if (reader.has("muscles")) out.muscles = reader.flag("muscles", true);
  if (reader.has("follow")) out.follow = reader.flag("follow", true);
  if (reader.has("follow") && out.camera)
    reader.problem("follow", "follow beside a camera", "one of the two");
  reader.finish();
  return out;
}

}  // namespace handsim::scene
