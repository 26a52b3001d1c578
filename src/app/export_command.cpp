#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/mjcf.h"
#include "handsim/output/urdf.h"
#include "handsim/scene/scene.h"

namespace handsim::app {

int export_command(const ExportArguments& arguments) {
  std::error_code failure;
  if (std::filesystem::equivalent(arguments.out, arguments.scene, failure))
    throw input_error("--out", arguments.out.string() + ", which is the scene itself", "another file");
  const scene::Scene scene = scene::load_scene(arguments.scene, arguments.overrides);
  const model::SolverSettings& solver = scene.spec.solver;
  const std::string text = arguments.format == "urdf" ? output::to_urdf(scene.model, solver)
                                                      : output::to_mjcf(scene.model, solver);
  output::write_file(arguments.out, text);
  fmt::print("{}: {} bodies, {} joints as {}\n", arguments.out.string(), scene.model.bodies.size() - 1,
             scene.model.joints.size(), arguments.format);
  return 0;
}

}  // namespace handsim::app
