// A run at one moment, to go on from: in memory, and as a file that says which scene it is of. Made and taken
// over by Simulation::snapshot and restore.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// What the motion of a scene depends on, part by part, so that a difference can be named: each part's name
/// (`solver.step`, `hands.0`) and the hash of its value. Title, duration, recording, pictures and criteria
/// are no part of it.
using Fingerprint = std::vector<std::pair<std::string, std::uint64_t>>;

Fingerprint fingerprint(const scene::Scene& scene, const engine::Engine& engine);

/// Names of parts that differ or that only one has; empty where none does.
std::vector<std::string> differences(const Fingerprint& a, const Fingerprint& b);

struct RunSnapshot {
  std::shared_ptr<const Fingerprint> scene;
  double time = 0;    ///< of the state [s]
  std::string bytes;  ///< Simulation's own
};

/// Version of files: others are refused. To be raised with every change of what is in a snapshot, whether of
/// its parts (what anything saves of itself), their order or how they are written.
inline constexpr std::uint64_t kSnapshotVersion = 3;
/// Largest file that is read.
inline constexpr std::size_t kSnapshotMaxBytes = 64U << 20U;

/// Bytes of a snapshot file: `HANDSNAP`, the version, the fingerprint, the time, the snapshot's bytes, and
/// XXH64 of all before.
std::string snapshot_text(const RunSnapshot& snapshot);
/// @param name of the file, for messages. @throws Error (input) for bytes that are no whole snapshot.
RunSnapshot parse_snapshot(std::string_view text, const std::string& name);

/// @throws Error (input) where the file cannot be written.
void write_snapshot(const RunSnapshot& snapshot, const std::filesystem::path& path);
/// @throws Error (input) where the file is missing, too large, torn, of another version or no snapshot.
RunSnapshot read_snapshot(const std::filesystem::path& path);

}  // namespace handsim::simulation
