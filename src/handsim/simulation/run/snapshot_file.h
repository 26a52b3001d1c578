// Files of snapshots, which also identify the scene.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "handsim/simulation/snapshot.h"

namespace handsim::simulation {

/// Version of files, the only one accepted. Increase it with any change of parts, their order or format.
inline constexpr std::uint64_t kSnapshotVersion = 14;
inline constexpr std::size_t kSnapshotMaxBytes = 64U << 20U;  ///< Largest file size that is accepted.

/// A snapshot file: `HANDSNAP`, version, fingerprint, time, the snapshot's bytes, and the XXH64 of these.
std::string snapshot_text(const RunSnapshot& snapshot);
/// @param name of the file, for messages. @throws Error (input) for bytes that are no complete snapshot.
RunSnapshot parse_snapshot(std::string_view text, const std::string& name);

/// @throws Error (input) if the file cannot be written.
void write_snapshot(const RunSnapshot& snapshot, const std::filesystem::path& path);
/// @throws Error (input) if the file is missing, too large, incomplete, of another version or not a snapshot.
RunSnapshot read_snapshot(const std::filesystem::path& path);

}  // namespace handsim::simulation
