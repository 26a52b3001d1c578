#include "handsim/study/validate/simulated.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "handsim/core/error.h"
#include "handsim/core/pose.h"
#include "handsim/simulation/run/run.h"

namespace handsim::study {

namespace {

/// What stands at a path of keys, of indices of lists, and of `name`s of a list's entries, with or without
/// their hand: `contact_forces.fingers.index.force_at_end_N`. Null: there is nothing.
const nlohmann::json* found_at(const nlohmann::json& all, std::string_view path) {
  const nlohmann::json* now = &all;
  while (now && !path.empty()) {
    const std::string key(path.substr(0, path.find('.')));
    path.remove_prefix(std::min(path.size(), key.size() + 1));
    const nlohmann::json* next = nullptr;
    if (now->is_object() && now->contains(key)) {
      next = &now->at(key);
    } else if (now->is_array() && key.size() < 7 &&
               key.find_first_not_of("0123456789") == std::string::npos) {
      if (const std::size_t index = std::stoul(key); index < now->size()) next = &now->at(index);
    } else if (now->is_array()) {
      for (const nlohmann::json& entry : *now)
        if (const std::string name = entry.is_object() ? entry.value("name", "") : "";
            name == key || name.ends_with("." + key))
          next = &entry;
    }
    now = next;
  }
  return now;
}

/// The components of a number (one) or a vector (three); else none.
std::vector<double> components(const nlohmann::json* found) {
  if (found && found->is_number()) return {found->get<double>()};
  if (!found || !found->is_array() || found->size() != 3) return {};
  std::vector<double> out;
  for (const nlohmann::json& each : *found)
    if (each.is_number()) out.push_back(each.get<double>());
  return out.size() == 3 ? out : std::vector<double>();
}

}  // namespace

const std::string& SimulatedScenes::summary(const Measurement& of) {
  const auto key = std::pair(of.scene, of.changes);
  if (const auto found = summaries_.find(key); found != summaries_.end()) return found->second;
  simulation::RunOptions options;
  options.out = out_ / fmt::format("run_{}", summaries_.size() + 1);
  return summaries_[key] = simulation::run(scene::load_scene(of.scene, of.changes), options).summary;
}

double SimulatedScenes::figure(const Measurement& of) {
  const auto all = nlohmann::json::parse(summary(of));
  const auto sum = [&](const std::vector<std::string>& figures) {
    std::vector<double> out;
    for (const std::string& figure : figures) {
      const std::vector<double> each = components(found_at(all, figure));
      if (each.empty() || (!out.empty() && out.size() != each.size()))
        throw input_error(of.name, "no number " + figure + " in the summary of " + of.scene.string(),
                          "figures such as climbs.0.load_N, all numbers or all vectors");
      out.resize(each.size());
      for (std::size_t i = 0; i < each.size(); ++i) out[i] += each[i];
    }
    return out.size() == 1 ? out[0] : Vec3(out[0], out[1], out[2]).norm();
  };
  return of.over.empty() ? sum(of.figures) : sum(of.figures) / sum(of.over);
}

}  // namespace handsim::study
