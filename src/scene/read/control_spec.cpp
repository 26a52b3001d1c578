#include "handsim/scene/read/control_spec.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "handsim/scene/read/blocks.h"
#include "handsim/scene/read/hand_entry.h"

namespace handsim::scene {

namespace {

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
                                                  bool has_tasks) {
  std::vector<control::ProgramChoice> out(hands.size());
  YamlNode* node = reader.child("program");
  const std::string key = reader.path_of("program");
  if (!node) {
    if (has_tasks) return out;
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
    else if (!has_tasks)
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

ControlSpec read_control(MapReader reader, const std::vector<HandEntry>& hands, bool has_tasks) {
  ControlSpec spec;
  if (YamlNode* node = referenced(reader, "controller", FileKind::controller))
    spec.controller = control::read_controller(*node, reader.path_of("controller"), reader.diagnostics());
  if (YamlNode* node = reader.has("poses") ? referenced(reader, "poses", FileKind::poses) : nullptr)
    spec.poses = control::read_pose_file(*node, reader.path_of("poses"), reader.diagnostics());
  spec.programs = read_programs(reader, hands, has_tasks);
  spec.place = reader.node().place();
  spec.allow_unstable = reader.flag("allow_unstable", false);
  if (hands.empty()) reader.problem("controller", "a scene without hands", "at least one hand to drive");
  reader.finish();
  return spec;
}

}  // namespace handsim::scene
