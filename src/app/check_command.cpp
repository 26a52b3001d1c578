#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/scene/scene.h"

namespace handsim::app {

namespace {

/// Reads a file of any kind that handsim has; the kind shows in its keys.
std::string check_file(const std::filesystem::path& path, Diagnostics& diagnostics) {
  YamlNode root = load_yaml(path);
  if (root.find("stature") && !root.find("hands")) {
    hand::read_person(root, "", diagnostics);
    return "person";
  }
  if (root.find("segments") && !root.find("hands")) {
    hand::read_hand_spec(root, "", diagnostics);
    return "hand model";
  }
  if (root.find("fits") && !root.find("hands")) {
    hand::read_anthropometry(root, "", diagnostics);
    return "anthropometry";
  }
  if (root.find("gains") && !root.find("hands")) {
    control::read_controller(root, "", diagnostics);
    return "controller";
  }
  if (root.find("poses") && !root.find("hands")) {
    control::read_pose_file(root, "", diagnostics);
    return "poses";
  }
  const scene::Scene scene = scene::compile_scene(std::move(root));
  diagnostics.warnings.insert(diagnostics.warnings.end(), scene.warnings.begin(), scene.warnings.end());
  return "scene";
}

}  // namespace

int check_command(const std::vector<std::filesystem::path>& files) {
  int bad = 0;
  for (const std::filesystem::path& path : files) {
    Diagnostics diagnostics;
    std::string kind;
    try {
      kind = check_file(path, diagnostics);
    } catch (const Error& error) {
      diagnostics.take(error);
    }
    for (const std::string& warning : diagnostics.warnings) fmt::print(stderr, "warning: {}\n", warning);
    for (const Problem& problem : diagnostics.problems) fmt::print(stderr, "{}\n", problem.text());
    if (diagnostics.problems.empty())
      fmt::print("{}: {}, good\n", path.string(), kind);
    else
      ++bad;
  }
  return bad == 0 ? 0 : 2;
}

}  // namespace handsim::app
