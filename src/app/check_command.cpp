#include <algorithm>

#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/console.h"
#include "handsim/app/file_readers.h"
#include "handsim/control/motion_file.h"
#include "handsim/engine/engine.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/simulation/simulation.h"
#include "handsim/study/accuracy/accuracy.h"
#include "handsim/study/stability/stability.h"

namespace handsim::app {

namespace {

/// Reads a file of any kind; the keys of a YAML file show its kind. @returns its kind.
std::string check_file(const std::filesystem::path& path, Diagnostics& diagnostics) {
  if (control::is_motion_file(path.string())) {
    control::read_motion(path);
    return "a motion";
  }
  YamlNode root = load_yaml(path);
  const scene::FileKind kind = scene::kind_of(root).value_or(scene::FileKind::scene);
  const auto reader = std::find_if(file_readers().begin(), file_readers().end(),
                                   [&](const FileReader& each) { return each.kind == kind; });
  if (kind == scene::FileKind::scene) {
    const scene::Scene scene = scene::compile_scene(std::move(root));
    diagnostics.warnings = scene.warnings;
    simulation::check_start(scene);
    static_cast<void>(scene::standalone_text(scene.resolved, scene.inputs));
  } else if (reader != file_readers().end()) {
    reader->read(root, diagnostics);
  } else if (kind == scene::FileKind::study) {
    study::load_accuracy(path);
  } else {
    study::load_stability(path);
  }
  return std::string(scene::described(kind));
}

/// Why an engine cannot run a scene; empty if it can.
std::string refusal(const std::filesystem::path& path, const std::string& engine) {
  try {
    const scene::Scene scene = scene::load_scene(path, {"solver.engine=" + engine});
    simulation::check_start(scene);
    engine::make_engine(scene.model, scene.spec.solver);
    return {};
  } catch (const Error& error) {
    if (error.problems().empty()) return error.what();
    const Problem& first = error.problems().front();
    return fmt::format("{}: got {}, need {}", first.key, first.got, first.need);
  }
}

/// Prints a line for each scene and engine: `runs`, or why not.
void print_engines(const std::vector<std::filesystem::path>& files) {
  for (const std::filesystem::path& path : files)
    if (scene::kind_of(load_yaml(path)).value_or(scene::FileKind::scene) == scene::FileKind::scene)
      for (const std::string engine : {"ode", "dae", "articulated", "auto"}) {
        const std::string why = refusal(path, engine);
        print("{:<44} {:<12} {}\n", path.string(), engine, why.empty() ? "runs" : why);
      }
}

}  // namespace

int check_command(const CheckArguments& arguments) {
  if (arguments.engines) {
    print_engines(arguments.files);
    return 0;
  }
  int bad = 0;
  for (const std::filesystem::path& path : arguments.files) {
    Diagnostics diagnostics;
    std::string kind;
    try {
      kind = check_file(path, diagnostics);
      diagnostics.throw_if_any();
    } catch (const Error& error) {
      diagnostics.problems = error.problems();
    }
    print_warnings(diagnostics.warnings);
    for (const Problem& problem : diagnostics.problems) print_error("{}\n", problem.text());
    if (diagnostics.problems.empty())
      print("{}: {}, good\n", path.string(), kind);
    else
      ++bad;
  }
  return bad == 0 ? 0 : 2;
}

}  // namespace handsim::app
