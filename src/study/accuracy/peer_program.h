// Another engine beside handsim's own methods: a program that gets a mechanism, simulates it, and answers
// with its motion or its cost. The protocol stands in tests/peers/peer.h; nothing here links to any engine.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "handsim/model/state.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::study {

/// A method of another engine.
struct PeerMethod {
  std::string program;                                   ///< file name in the folder of peers
  std::string method;                                    ///< as the program names it
  std::vector<std::pair<std::string, double>> settings;  ///< of that method
};

/// Who answered.
struct PeerName {
  std::string engine, version;
};

/// Refuses scenes that the protocol cannot describe: contact, stops, tissue, drives and controllers.
/// @throws Error (input).
void check_for_peers(const scene::Scene& scene);

/// Simulates the scene's mechanism from the scene's start over its duration.
/// @param update is called with the start and the state after every step.
/// @throws Error (physics) where the program fails, diverges, or has built something else: a start state or a
///         kinetic energy that is not the scene's.
PeerName follow_peer(const std::filesystem::path& program, const PeerMethod& method,
                     const scene::Scene& scene, const std::function<void(const model::State&)>& update);

/// CPU seconds of so many steps from the scene's start, after a warm-up, nothing written meanwhile.
/// @throws Error (physics) where the program fails.
double peer_cpu_seconds(const std::filesystem::path& program, const PeerMethod& method,
                        const scene::Scene& scene, long steps);

}  // namespace handsim::study
