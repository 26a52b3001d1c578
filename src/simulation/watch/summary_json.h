// What watchers write their part of summary.json into. Not included by watcher.h: only who writes or reads
// the summary needs the JSON library.
#pragma once

#include <vector>

#include <nlohmann/json.hpp>

#include "handsim/simulation/watch/hand_parts.h"

namespace handsim::simulation {

using Json = nlohmann::ordered_json;

/// The summary's top-level keys stand in it already, in the order of the file; those left null are removed.
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
