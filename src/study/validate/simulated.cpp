#include "handsim/study/validate/simulated.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "handsim/core/error.h"
#include "handsim/simulation/run/run.h"

namespace handsim::study {

const std::string& SimulatedScenes::summary(const Measurement& of) {
  const auto key = std::pair(of.scene, of.changes);
  if (const auto found = summaries_.find(key); found != summaries_.end()) return found->second;
  simulation::RunOptions options;
  options.out = out_ / fmt::format("run_{}", summaries_.size() + 1);
  return summaries_[key] = simulation::run(scene::load_scene(of.scene, of.changes), options).summary;
}

double SimulatedScenes::figure(const Measurement& of) {
  const auto all = nlohmann::json::parse(summary(of));
  const auto number = [&](const std::string& figure) {
    std::string path = "/" + figure;
    std::replace(path.begin(), path.end(), '.', '/');
    const nlohmann::json::json_pointer pointer(path);
    if (!all.contains(pointer) || !all.at(pointer).is_number())
      throw input_error(of.name, "no number " + figure + " in the summary of " + of.scene.string(),
                        "a figure such as climbs.0.load_N");
    return all.at(pointer).get<double>();
  };
  return of.over.empty() ? number(of.figure) : number(of.figure) / number(of.over);
}

}  // namespace handsim::study
