// What the Python package's writers make of a model, for tests and peers that need one in another program.
#pragma once

#include <cstdlib>
#include <string>

#include "handsim/core/error.h"
#include "handsim/output/description/description.h"
#include "scene_files.h"

namespace handsim::test {

/// False in a build without the package.
inline bool has_package() { return !std::string(kPythonProgram).empty(); }

/// The model in a format of `handsim export`, as the program hands it over; see output::description().
/// @throws Error (input) with the writer's message for what the format cannot express
inline std::string written(const std::string& format, const model::Model& model,
                           const engine::Settings& settings, const control::Plan* plan = nullptr,
                           const output::Moment* moment = nullptr) {
  const TemporaryFolder folder;
  const std::string in = folder.path() / "model.json", out = folder.path() / "file",
                    told = folder.path() / "told";
  std::ofstream(in) << output::description(model, settings, plan, moment);
  const std::string command =
      std::string("PYTHONPATH='") + kPackageFolder + "' OPENBLAS_NUM_THREADS=1 '" + kPythonProgram +
      "' -c 'import sys; from handsim._formats import FORMATS; from handsim._model import Model; "
      "sys.stdout.write(FORMATS[sys.argv[1]].write(Model(open(sys.argv[2]).read())))' " +
      format + " '" + in + "' > '" + out + "' 2> '" + told + "'";
  if (std::system(command.c_str()) != 0) throw input_error(format, "a model", text_of(told));
  return text_of(out);
}

}  // namespace handsim::test
