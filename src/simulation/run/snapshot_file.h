// A run's snapshot as a file that names its scene.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "handsim/simulation/snapshot.h"

namespace handsim::simulation {

/// Version of files: others are refused. To be raised with every change of what is in a snapshot, whether of
/// its parts (what anything saves of itself), their order or how they are written.
inline constexpr std::uint64_t kSnapshotVersion = 6;
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
