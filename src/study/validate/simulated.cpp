#include "handsim/study/validate/simulated.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "handsim/core/error.h"
#include "handsim/simulation/run/run.h"

namespace handsim::study {

double simulated_figure(const Measurement& of, const std::filesystem::path& out) {
  simulation::RunOptions options;
  options.out = out;
  const simulation::RunResult result = simulation::run(scene::load_scene(of.scene, of.changes), options);
  std::string path = "/" + of.figure;
  std::replace(path.begin(), path.end(), '.', '/');
  const auto summary = nlohmann::json::parse(result.summary);
  const nlohmann::json::json_pointer pointer(path);
  if (!summary.contains(pointer) || !summary.at(pointer).is_number())
    throw input_error(of.name, "no number " + of.figure + " in the summary of " + of.scene.string(),
                      "a figure such as climbs.0.load_N");
  return summary.at(pointer).get<double>();
}

}  // namespace handsim::study
