// A hash of the states of a run: with equal hashes, all bodies have equal bits at the hashed steps. These are
// every eighth one from the start on, and the last; hashing all steps would take 3 % of the time of a small
// mechanism.
//   h_0 = XXH64(bytes of the start, seed 0),  h_k = XXH64(bytes of the next such state, seed h_(k-1))
// The bytes of a state are its time and, for each body but the world in the model's order, position x y z,
// quaternion w x y z, velocity x y z and angular velocity x y z, then the activations of the muscles in
// effect and, where a tendon is elastic, the lengths of all fibres, where a muscle has a short-range
// stiffness the stretches of cross-bridges, as doubles with the least significant byte first. The sign of
// zero counts.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "handsim/simulation/watch/watcher.h"

namespace handsim::simulation {

inline constexpr long kHashEvery = 8;  ///< Number of steps between two hashed states.

/// What of muscles is hashed beside their activations.
struct HashedParts {
  bool fibres = false;   ///< lengths of fibres: some tendon is elastic
  bool bridges = false;  ///< stretches of cross-bridges: some muscle has a short-range stiffness
};

class StateHash {
 public:
  /// Adds the next state to the hash.
  void add(const model::State& state, HashedParts parts = {});
  std::uint64_t value() const { return value_; }
  void set(std::uint64_t value) { value_ = value; }

 private:
  std::uint64_t value_ = 0;
  std::vector<double> numbers_;  ///< of one state
};

class RunHash final : public Watcher {
 public:
  explicit RunHash(const Watched& watched);

  std::string_view name() const override { return "state_hash"; }
  void update(Step& step) override;
  void save(ArchiveWriter& out) const override;
  void restore(ArchiveReader& in, const model::State& state) override;
  void add_summary(SummaryJson& out) const override;

  std::uint64_t value() const;

 private:
  const engine::Engine& engine_;
  HashedParts parts_;
  long steps_ = 0;
  StateHash hash_;  ///< up to the last multiple of kHashEvery
};

/// Sixteen hexadecimal digits.
std::string hash_text(std::uint64_t hash);
/// Nothing if the text is not such a hash.
std::optional<std::uint64_t> parse_hash(std::string_view text);

}  // namespace handsim::simulation
