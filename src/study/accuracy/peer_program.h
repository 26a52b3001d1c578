// Runs another engine in a separate program, which gets a mechanism, simulates it, and answers with its
// motion or its cost. tests/peers/peer.h describes the protocol; nothing here links to another engine.
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
  std::string method;                                    ///< the program's name of it
  std::vector<std::pair<std::string, double>> settings;  ///< of that method
};

/// The engine that answered.
struct PeerName {
  std::string engine, version;
};

/// @throws Error (input) for what the protocol lacks: contact, stops, tissue, drives and controllers.
void check_for_peers(const scene::Scene& scene);

/// Simulates the scene's mechanism from the scene's start over its duration.
/// @param update is called with the start and the state after every step. @throws Error (physics) if the
///         program fails or diverges, or if its start or its kinetic energy differs from the scene's.
PeerName simulate_with_peer(const std::filesystem::path& program, const PeerMethod& method,
                            const scene::Scene& scene,
                            const std::function<void(const model::State&)>& update);

/// CPU seconds of a number of steps from the scene's start, after a warm-up and without output.
/// @throws Error (physics) if the program fails.
double peer_cpu_seconds(const std::filesystem::path& program, const PeerMethod& method,
                        const scene::Scene& scene, long steps);

}  // namespace handsim::study
