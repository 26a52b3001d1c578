#include "handsim/simulation/run/snapshot_file.h"

#include <concepts>

#include <fmt/format.h>

#include "handsim/core/archive.h"
#include "handsim/core/input_file.h"
#include "handsim/output/atomic_file.h"

namespace handsim::simulation {

namespace {

constexpr std::string_view kMagic = "HANDSNAP";
constexpr std::size_t kHashBytes = 8;

template <class Archive, class Print>
void serialize_fingerprint(Archive& archive, Print& fingerprint) {
  for (auto& [name, hash] : fingerprint) {
    archive(name);
    if constexpr (std::same_as<Archive, ArchiveWriter>)
      archive.word(hash);
    else
      hash = archive.word();
  }
}

}  // namespace

std::string snapshot_text(const RunSnapshot& snapshot) {
  ArchiveWriter out;
  out.word(kSnapshotVersion);
  out(snapshot.scene->size());
  serialize_fingerprint(out, *snapshot.scene);
  out(snapshot.time, snapshot.bytes);
  std::string text = std::string(kMagic) + out.take();
  ArchiveWriter sum;
  sum.word(hash_bytes(text));
  return text + sum.bytes();
}

RunSnapshot parse_snapshot(std::string_view text, const std::string& name) {
  const auto refuse = [&](const std::string& got) {
    return input_error(name, got, "a snapshot that handsim run --snapshot-at has written");
  };
  if (!text.starts_with(kMagic)) throw refuse("a file that is no snapshot");
  if (text.size() < kMagic.size() + 2 * kHashBytes) throw refuse("a snapshot that ends too early");
  ArchiveReader in(text.substr(kMagic.size(), text.size() - kMagic.size() - kHashBytes), name);
  // The version first: what another version calls a sum is not known here.
  if (const std::uint64_t version = in.word(); version != kSnapshotVersion)
    throw input_error(name, fmt::format("a snapshot of version {}", version),
                      fmt::format("version {}, which this handsim writes", kSnapshotVersion));
  ArchiveReader sum(text.substr(text.size() - kHashBytes), name);
  if (sum.word() != hash_bytes(text.substr(0, text.size() - kHashBytes)))
    throw refuse("a snapshot that is torn or was changed");
  RunSnapshot out;
  Fingerprint scene(in.size());
  serialize_fingerprint(in, scene);
  out.scene = std::make_shared<const Fingerprint>(std::move(scene));
  in(out.time, out.bytes);
  in.finish();
  out.sum = hash_bytes(out.bytes);
  return out;
}

void write_snapshot(const RunSnapshot& snapshot, const std::filesystem::path& path) {
  output::write_file(path, snapshot_text(snapshot));
}

RunSnapshot read_snapshot(const std::filesystem::path& path) {
  return parse_snapshot(
      read_input_file(path, "a snapshot that handsim run --snapshot-at has written", kSnapshotMaxBytes),
      path.string());
}

}  // namespace handsim::simulation
