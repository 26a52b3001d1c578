#include "handsim/scene/task/hand_program.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/scene/read/scene_spec.h"

namespace handsim::scene {

std::optional<std::size_t> find_hand(const SceneSpec& scene, const std::string& name, const Place& place,
                                     const std::string& key, Diagnostics& diagnostics) {
  if (name.empty() && scene.hands.size() == 1) return 0;
  std::vector<std::string> known;
  for (std::size_t i = 0; i < scene.hands.size(); ++i) {
    known.push_back(scene.hands[i].placement.name);
    if (known.back() == name) return i;
  }
  diagnostics.problems.push_back({place, key,
                                  name.empty() ? "nothing in a scene of several hands or none" : name,
                                  fmt::format("a hand of the scene: {}", fmt::join(known, ", "))});
  return std::nullopt;
}

std::vector<std::string> read_pose_names(MapReader& reader, const char* key) {
  const YamlNode* node = reader.child(key);
  std::vector<std::string> out;
  if (node && node->kind == YamlNode::Kind::scalar) out.push_back(node->text);
  if (node && node->kind == YamlNode::Kind::sequence)
    for (const YamlNode& item : node->items) out.push_back(item.text);
  if (out.empty() ||
      std::any_of(out.begin(), out.end(), [](const std::string& name) { return name.empty(); }))
    reader.problem(key, node ? node->described() : "nothing", "the name of a pose, or a list of them");
  return out;
}

void add_hand_program(SceneSpec& scene, const HandProgram& wanted, Diagnostics& diagnostics) {
  const auto say = [&](const std::string& key, std::string got, std::string need) {
    diagnostics.problems.push_back({wanted.place, wanted.path + key, std::move(got), std::move(need)});
  };
  if (!scene.control || !scene.control->poses)
    return say("", wanted.what + " in a scene without control",
               "a control block with a controller and poses");
  control::PoseFile& file = *scene.control->poses;
  std::vector<std::string> known;
  for (const auto& [name, pose] : file.poses) known.push_back(name);
  bool all = true;
  const auto check = [&](const char* key, const std::string& pose) {
    if (file.poses.contains(pose)) return;
    all = false;
    const auto near = nearest_word(pose, known);
    say(key, pose, fmt::format("a pose of the pose file{}", near ? " (nearest: " + *near + ")" : ""));
  };
  check(".open", wanted.open);
  for (const std::string& pose : wanted.closed) check(".closed", pose);
  HandEntry& hand = scene.hands[wanted.hand];
  control::ProgramChoice& choice = scene.control->programs[wanted.hand];
  if (!choice.program.empty()) say("", "a hand with a program of its own", wanted.what + ", or a program");
  if (!all) return;
  control::ProgramSpec program;
  program.place = wanted.place;
  program.keys.push_back({0, 0, wanted.open, wanted.place});
  double time = wanted.close;
  for (const std::string& pose : wanted.closed) {
    program.keys.push_back({time, wanted.move, pose, wanted.place});
    time += wanted.move;
  }
  choice = {wanted.title, wanted.place, wanted.path};
  file.programs[choice.program] = std::move(program);
  for (const auto& [joint, pose] : file.poses.at(wanted.open).joints)
    if (joint != hand.model.wrist.name && !hand.placement.start.contains(joint))
      hand.placement.start[joint] = pose.angles;
}

}  // namespace handsim::scene
