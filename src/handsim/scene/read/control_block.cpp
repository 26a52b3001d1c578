#include "handsim/scene/read/control_block.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "handsim/core/data_folder.h"
#include "handsim/core/input_file.h"
#include "handsim/scene/read/blocks.h"

namespace handsim::scene {

namespace {

control::ProgramChoice read_choice(MapReader& reader, const YamlNode& node, const std::string& key) {
  control::ProgramChoice out{node.text, node.place(), reader.path_of(key)};
  if (control::is_motion_file(node.text)) out.program = reader.file_path(key, node).string();
  return out;
}

/// Reads one program for all hands, or a mapping of hands to programs.
std::vector<control::ProgramChoice> read_programs(MapReader& reader, const std::vector<HandEntry>& hands,
                                                  bool has_tasks) {
  std::vector<control::ProgramChoice> out(hands.size());
  using Kind = YamlNode::Kind;
  const YamlNode* node = reader.value(
      "program", {{Kind::scalar, Kind::map},
                  "a program of the pose file, a .csv, .mot or .sto file, or a mapping of hands to them",
                  !has_tasks});
  if (!node) return out;
  if (node->kind == Kind::scalar) {
    std::ranges::fill(out, read_choice(reader, *node, "program"));
    return out;
  }
  std::vector<std::string> known;
  for (const HandEntry& hand : hands) known.push_back(hand.placement.name);
  MapReader programs = reader.map("program");
  for (const std::string& name : programs.keys()) {
    const YamlNode* choice =
        programs.value(name, {{Kind::scalar}, "a program of the pose file, or a .csv, .mot or .sto file"});
    const auto hand = std::ranges::find(known, name);
    if (hand != known.end() && choice)
      out[static_cast<std::size_t>(hand - known.begin())] = read_choice(programs, *choice, name);
  }
  for (const YamlEntry& given : node->entries)
    if (std::ranges::find(known, given.key) == known.end())
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
  if (const YamlNode* node = referenced(motion, "names", FileKind::motion_names, false))
    out.names = control::read_motion_names(*node, motion.path_of("names"), reader.diagnostics());
  out.clamp = motion.flag("clamp", false);
  out.filter = motion.maybe_number("filter", {Dimension::frequency, 0.01, 1e4});
  motion.finish();
  return out;
}

std::vector<double> numbers_of(const YamlNode& node, const std::string& path, const Quantity& quantity,
                               Diagnostics& diagnostics) {
  std::vector<double> out;
  const auto add = [&](const YamlNode& item) {
    out.push_back(read_number(item, path, quantity, diagnostics).value_or(0));
  };
  if (node.kind == YamlNode::Kind::scalar) add(node);
  for (const YamlNode& item : node.items) add(item);
  return out;
}

/// `times`, and for each muscle its excitation at each of them; a single number holds at all times.
control::MotionTable read_excitation_table(MapReader reader) {
  control::MotionTable table;
  table.file = reader.node().place().file;
  table.header_line = reader.node().place().line;
  const auto values = [&](const std::string& key, const Quantity& quantity) {
    const YamlNode* node =
        reader.value(key, {{YamlNode::Kind::scalar, YamlNode::Kind::sequence}, "numbers, one for each time"});
    return node ? numbers_of(*node, reader.path_of(key), quantity, reader.diagnostics())
                : std::vector<double>();
  };
  table.times = values("times", {Dimension::time, 0, 1e6, false});
  if (reader.sound() && table.times.empty()) reader.problem("times", "no time", "one time or more");
  for (std::size_t i = 1; i < table.times.size(); ++i)
    if (reader.sound() && !(table.times[i] > table.times[i - 1]))
      reader.problem("times", fmt::format("{:g} s after {:g} s", table.times[i], table.times[i - 1]),
                     "times that increase");
  std::vector<std::vector<double>> columns;
  for (const std::string& name : reader.keys()) {
    if (name == "times") continue;
    std::vector<double> column = values(name, {Dimension::none, 0, 1, false});
    if (column.size() == 1) column.resize(table.times.size(), column[0]);
    if (reader.sound() && column.size() != table.times.size())
      reader.problem(name, fmt::format("{} numbers", column.size()),
                     fmt::format("one, or {} as times has", table.times.size()));
    table.names.push_back(name);
    columns.push_back(std::move(column));
  }
  if (reader.sound() && columns.empty()) reader.problem("", "times alone", "a muscle and its excitations");
  if (!reader.sound()) return {};
  for (std::size_t row = 0; row < table.times.size(); ++row)
    for (const std::vector<double>& column : columns) table.values.push_back(column[row]);
  table.lines.assign(table.times.size(), table.header_line);
  return table;
}

/// The shipped controller of what drives the joints, for scenes that name none.
std::string usual_controller(const YamlNode& control) {
  const YamlNode* drive = control.find("drive");
  const bool by_muscles = drive && drive->text == "muscles";
  return (data_folder() / (by_muscles ? "controllers/muscles.yaml" : "controllers/implicit.yaml")).string();
}

}  // namespace

ControlSpec read_control(MapReader reader, const std::vector<HandEntry>& hands, bool has_tasks) {
  ControlSpec spec;
  if (const YamlNode* node =
          referenced(reader, "controller", FileKind::controller, false, usual_controller(reader.node())))
    spec.controller = control::read_controller(*node, reader.path_of("controller"), reader.diagnostics());
  if (const YamlNode* node = referenced(reader, "poses", FileKind::poses, false))
    spec.poses = control::read_pose_file(*node, reader.path_of("poses"), reader.diagnostics());
  spec.programs = read_programs(reader, hands, has_tasks);
  spec.motion = read_motion_options(reader);
  spec.place = reader.node().place();
  spec.allow_unstable = reader.flag("allow_unstable", false);
  // Written into the resolved scene only where it is asked for.
  if (reader.has("drive"))
    spec.by_muscles = reader.choice<bool>("drive", {{"motors", false}, {"muscles", true}});
  if (hands.empty()) reader.problem("controller", "a scene without hands", "at least one hand to drive");
  reader.finish();
  return spec;
}

std::optional<ExcitationSpec> read_excitations(MapReader& scene) {
  const std::string need = "a .csv, .mot or .sto file, or a mapping with times and muscles";
  const YamlNode* node =
      scene.value("excitations", {{YamlNode::Kind::scalar, YamlNode::Kind::map}, need, false});
  if (!node) return std::nullopt;
  if (node->kind == YamlNode::Kind::map) {
    const Place place = node->place();
    return ExcitationSpec{{}, read_excitation_table(scene.map("excitations")), place};
  }
  if (!control::is_motion_file(node->text)) {
    scene.problem("excitations", node->text, need);
    return std::nullopt;
  }
  const control::ProgramChoice choice = read_choice(scene, *node, "excitations");
  return ExcitationSpec{choice.program, {}, choice.place};
}

}  // namespace handsim::scene
