// The JSON object of the watchers' parts of summary.json. Not in watcher.h: it needs the JSON library.
#pragma once

#include <vector>

#include <nlohmann/json.hpp>

#include "handsim/simulation/watch/hand_parts.h"

namespace handsim::simulation {

using Json = nlohmann::ordered_json;

/// Has the summary's top-level keys already, in the order of the file; keys that stay null are removed.
struct SummaryJson {
  Json json;
};

inline Json parts_json(const std::vector<PartForce>& parts) {
  Json out = Json::array();
  for (const PartForce& part : parts)
    out.push_back({{"part", part.part},
                   {"contacts", part.contacts},
                   {"normal_force_N", part.normal},
                   {"friction_force_N", part.friction}});
  return out;
}

}  // namespace handsim::simulation
