// The last bits of a state as one number, for tests that compare two runs bit by bit.
#pragma once

#include <cstdint>

#include "handsim/core/archive.h"
#include "handsim/environment/environment.h"

namespace handsim::test {

/// Hash of the state's bits.
inline std::uint64_t bits(const model::State& state) {
  ArchiveWriter out;
  serialize(out, state);
  return hash_bytes(out.bytes());
}
inline std::uint64_t bits(const environment::Environment& environment) {
  return bits(environment.simulation().state());
}

}  // namespace handsim::test
