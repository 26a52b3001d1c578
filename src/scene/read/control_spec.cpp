#include "handsim/scene/read/control_spec.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "handsim/scene/read/file_kind.h"
#include "handsim/scene/read/scene_spec.h"

namespace handsim::scene {

namespace {

/// Follows a reference that may be missing or bad; null where nothing can be read.
YamlNode* followed(MapReader& reader, std::string_view key, FileKind kind) {
  YamlNode* node = reader.child(key);
  if (!node) return nullptr;
  try {
    follow_reference(*node, reader.path_of(key), reader.diagnostics().budget);
    return is_of_kind(*node, reader.path_of(key), kind, reader.diagnostics()) ? node : nullptr;
  } catch (const Error& error) {
    reader.diagnostics().take(error);
    return nullptr;
  }
}

/// A motion file is named by its absolute path in the resolved scene, which stands in another folder.
control::ProgramChoice read_choice(YamlNode& node, const std::string& key, Diagnostics& diagnostics) {
  control::ProgramChoice out{node.text, node.place(), key};
  if (node.kind != YamlNode::Kind::scalar || node.text.empty())
    diagnostics.problems.push_back(
        {node.place(), key, node.described(), "a program of the pose file, or a .csv, .mot or .sto file"});
  else if (control::is_motion_file(node.text))
    out.program = node.text =
        std::filesystem::absolute(std::filesystem::path(out.place.file).parent_path() / node.text)
            .lexically_normal()
            .string();
  return out;
}

/// One program for every hand, or one for each by its name.
std::vector<control::ProgramChoice> read_programs(MapReader& reader, const std::vector<HandEntry>& hands,
                                                  bool grasped) {
  std::vector<control::ProgramChoice> out(hands.size());
  YamlNode* node = reader.child("program");
  const std::string key = reader.path_of("program");
  if (!node) {
    if (grasped) return out;
    reader.problem("program", "nothing",
                   "a program of the pose file, a motion file, or a mapping of hands to them");
    return out;
  }
  if (node->kind != YamlNode::Kind::map) {
    const control::ProgramChoice choice = read_choice(*node, key, reader.diagnostics());
    std::fill(out.begin(), out.end(), choice);
    return out;
  }
  std::vector<std::string> known;
  for (const HandEntry& hand : hands) known.push_back(hand.placement.name);
  for (std::size_t i = 0; i < hands.size(); ++i) {
    if (YamlNode* mine = node->find(known[i]))
      out[i] = read_choice(*mine, key + "." + known[i], reader.diagnostics());
    else if (!grasped)
      reader.problem("program", fmt::format("no program for hand {}", known[i]),
                     "a program for every hand of the scene");
  }
  for (const YamlEntry& entry : node->entries)
    if (std::find(known.begin(), known.end(), entry.key) == known.end())
      reader.diagnostics().problems.push_back({Place{entry.value.place().file, entry.line, entry.column},
                                               key + "." + entry.key, "a hand that the scene has not",
                                               need_word(entry.key, known)});
  return out;
}

}  // namespace

ControlSpec read_control(MapReader reader, const std::vector<HandEntry>& hands, bool grasped) {
  ControlSpec spec;
  if (!reader.has("controller"))
    reader.problem("controller", "nothing", "the path of a controller file, or the block itself");
  if (YamlNode* node = followed(reader, "controller", FileKind::controller))
    spec.controller = control::read_controller(*node, reader.path_of("controller"), reader.diagnostics());
  if (YamlNode* node = followed(reader, "poses", FileKind::poses))
    spec.poses = control::read_pose_file(*node, reader.path_of("poses"), reader.diagnostics());
  spec.programs = read_programs(reader, hands, grasped);
  spec.place = reader.node().place();
  spec.allow_unstable = reader.flag("allow_unstable", false);
  if (hands.empty()) reader.problem("controller", "a scene without hands", "at least one hand to drive");
  reader.finish();
  return spec;
}

control::Plan compile_control(const ControlSpec& spec, const std::vector<HandEntry>& hands,
                              const std::vector<std::optional<double>>& grip_strengths,
                              const model::Model& model, const engine::Settings& solver,
                              Diagnostics& diagnostics) {
  const bool implicit = spec.controller.form == control::Form::implicit_gain;
  if (implicit && solver.engine() == engine::EngineKind::dae)
    diagnostics.problems.push_back(
        {spec.place, "control.controller.form",
         fmt::format("implicit with {}", engine::name(solver.method())),
         "explicit, or the ode or articulated engine, which solve implicit gains within their step"});
  control::PlanInput input;
  input.controller = &spec.controller;
  input.poses = spec.poses ? &*spec.poses : nullptr;
  input.programs = spec.programs;
  for (const HandEntry& hand : hands) {
    const bool mounted =
        hand.placement.mount == hand::Mount::hinge || hand.placement.mount == hand::Mount::universal;
    input.absent.push_back(mounted ? std::vector<std::string>{}
                                   : std::vector<std::string>{hand.model.wrist.name});
  }
  for (const std::optional<double>& own : grip_strengths)
    input.strength.push_back(own && spec.controller.grip_strength ? *own / *spec.controller.grip_strength
                                                                  : 1);
  input.effects = solver.effects;
  input.step = solver.step;
  input.allow_unstable = spec.allow_unstable;
  return control::make_plan(model, input, diagnostics);
}

}  // namespace handsim::scene
