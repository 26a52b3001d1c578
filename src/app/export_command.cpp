#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/console.h"
#include "handsim/core/text.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/export/export.h"
#include "handsim/output/output_folder.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::app {

namespace {

/// The requested format, which must agree with the file's extension.
std::string format_of(const ExportArguments& arguments) {
  const std::string ending = ending_of(arguments.out);
  if (ending.empty()) return arguments.format.value_or("mjcf");
  const std::string format = ending == ".xml" ? "mjcf" : ending == ".urdf" ? "urdf" : "";
  if (format.empty() || format != arguments.format.value_or(format))
    throw input_error("--out", arguments.out.string(),
                      arguments.format
                          ? fmt::format("a name that ends in {} for --format {}",
                                        *arguments.format == "urdf" ? ".urdf" : ".xml", *arguments.format)
                          : "a name that ends in .xml (MJCF) or .urdf");
  return format;
}

}  // namespace

std::string ending_of(const std::filesystem::path& path) { return lower_case(path.extension().string()); }

int export_command(const ExportArguments& arguments) {
  const std::string format = format_of(arguments);
  const scene::Scene scene = scene::load_scene(arguments.scene, arguments.overrides);
  const engine::Settings& solver = scene.spec.solver;
  output::check_not_read(arguments.out, [&] { return scene::files_read(scene); });
  const std::string text =
      format == "urdf" ? output::to_urdf(scene.model, solver) : output::to_mjcf(scene.model, solver);
  output::write_file(arguments.out, text);
  print("{}: {} bodies, {} joints as {}\n", arguments.out.string(), scene.model.bodies.size() - 1,
        scene.model.joints.size(), format);
  return 0;
}

}  // namespace handsim::app
