// A run's states as one number: equal numbers, equal bits in every body at the steps that are taken in. These
// are every eighth one from the start on, and the last: all of them would be 3 % of a small mechanism's step.
//   h_0 = XXH64(bytes of the start, seed 0),  h_k = XXH64(bytes of the next such state, seed h_(k-1))
// The bytes of a state are its time and, for each body but the world in the model's order, position x y z,
// quaternion w x y z, velocity x y z and angular velocity x y z, as doubles with the least significant byte
// first. The sign of zero counts.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "handsim/simulation/watch/watcher.h"

namespace handsim::simulation {

/// Steps from one state that is taken in to the next.
inline constexpr long kHashEvery = 8;

class StateHash {
 public:
  /// Takes the next state in.
  void add(const model::State& state);
  std::uint64_t value() const { return value_; }
  /// Goes on from a hash.
  void set(std::uint64_t value) { value_ = value; }

 private:
  std::uint64_t value_ = 0;
  std::vector<double> numbers_;  ///< of one state
};

/// Hashes the states of a run.
class RunHash final : public Watcher {
 public:
  explicit RunHash(const Watched& watched);

  std::string_view name() const override { return "state_hash"; }
  void update(Step& step) override;
  void save(ArchiveWriter& out) const override;
  void restore(ArchiveReader& in, const model::State& state) override;
  void add_summary(SummaryJson& out) const override;

  /// Of the states up to now.
  std::uint64_t value() const;

 private:
  const engine::Engine& engine_;
  long steps_ = 0;
  StateHash hash_;  ///< up to the last step that kHashEvery divides
};

/// Sixteen hexadecimal digits.
std::string hash_text(std::uint64_t hash);
/// Nothing where the text is no such hash.
std::optional<std::uint64_t> parse_hash(std::string_view text);

}  // namespace handsim::simulation
