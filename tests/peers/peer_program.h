// Runs another engine in a separate program, which gets a mechanism, simulates it, and answers with its
// motion or its cost. tests/peers/peer.h describes the protocol; nothing here links to another engine.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "handsim/study/accuracy/accuracy.h"

namespace handsim::study {

/// A method of another engine.
struct PeerMethod {
  std::string program;                                   ///< file name in the folder of peers
  std::string method;                                    ///< the program's name of it
  std::vector<std::pair<std::string, double>> settings;  ///< of that method
};

/// A method of an accuracy study that runs a program of this folder. It throws Error (physics) if the program
/// fails or diverges, or if its start or its kinetic energy differs from the scene's, and Error (input) for
/// what the protocol lacks: contact, stops, tissue, drives and controllers.
OutsideEngine outside_engine(const std::filesystem::path& folder, const PeerMethod& method);

}  // namespace handsim::study
