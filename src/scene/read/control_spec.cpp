#include "handsim/scene/read/control_spec.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "handsim/scene/read/blocks.h"
#include "handsim/scene/read/hand_entry.h"

namespace handsim::scene {

namespace {

/// Motion files get absolute paths, because the resolved scene is written to another folder.
control::ProgramChoice read_choice(YamlNode& node, const std::string& key) {
  control::ProgramChoice out{node.text, node.place(), key};
  if (control::is_motion_file(node.text))
    out.program = node.text =
        std::filesystem::absolute(std::filesystem::path(out.place.file).parent_path() / node.text)
            .lexically_normal()
            .string();
  return out;
}

/// Reads one program for all hands, or a mapping of hands to programs.
std::vector<control::ProgramChoice> read_programs(MapReader& reader, const std::vector<HandEntry>& hands,
                                                  bool has_tasks) {
  std::vector<control::ProgramChoice> out(hands.size());
  using Kind = YamlNode::Kind;
  const std::string key = reader.path_of("program");
  YamlNode* node =
      reader.value("program", {{Kind::scalar, Kind::map},
                               "a program of the pose file, a .csv, .mot or .sto file, or a mapping "
                               "of hands to them",
                               !has_tasks});
  if (!node) return out;
  if (node->kind == Kind::scalar) {
    std::fill(out.begin(), out.end(), read_choice(*node, key));
    return out;
  }
  std::vector<std::string> known;
  for (const HandEntry& hand : hands) known.push_back(hand.placement.name);
  MapReader programs = reader.map("program");
  for (const std::string& name : programs.keys()) {
    YamlNode* choice =
        programs.value(name, {{Kind::scalar}, "a program of the pose file, or a .csv, .mot or .sto file"});
    const auto hand = std::find(known.begin(), known.end(), name);
    if (hand != known.end() && choice)
      out[static_cast<std::size_t>(hand - known.begin())] = read_choice(*choice, key + "." + name);
  }
  for (const YamlEntry& given : node->entries)
    if (std::find(known.begin(), known.end(), given.key) == known.end())
      programs.unknown_key(given, "a hand that the scene does not have", known);
  for (const std::string& name : known)
    if (!has_tasks && !node->find(name))
      reader.problem("program", fmt::format("no program for hand {}", name),
                     "a program for every hand of the scene");
  return out;
}

/// How motion files are read; absent: by their own names, as recorded.
control::MotionOptions read_motion_options(MapReader& reader) {
  control::MotionOptions out;
  if (!reader.has("motion")) return out;
  MapReader motion = reader.map("motion");
  if (YamlNode* node = referenced(motion, "names", FileKind::motion_names, false))
    out.names = control::read_motion_names(*node, motion.path_of("names"), reader.diagnostics());
  out.clamp = motion.flag("clamp", false);
  out.filter = motion.maybe_number("filter", {Dimension::frequency, 0.01, 1e4});
  motion.finish();
  return out;
}

}  // namespace

ControlSpec read_control(MapReader reader, const std::vector<HandEntry>& hands, bool has_tasks) {
  ControlSpec spec;
  if (YamlNode* node = referenced(reader, "controller", FileKind::controller))
    spec.controller = control::read_controller(*node, reader.path_of("controller"), reader.diagnostics());
  if (YamlNode* node = referenced(reader, "poses", FileKind::poses, false))
    spec.poses = control::read_pose_file(*node, reader.path_of("poses"), reader.diagnostics());
  spec.programs = read_programs(reader, hands, has_tasks);
  spec.motion = read_motion_options(reader);
  spec.place = reader.node().place();
  spec.allow_unstable = reader.flag("allow_unstable", false);
  if (hands.empty()) reader.problem("controller", "a scene without hands", "at least one hand to drive");
  reader.finish();
  return spec;
}

}  // namespace handsim::scene
