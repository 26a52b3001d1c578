#include "handsim/environment/draws.h"

#include <algorithm>

#include <Random123/philox.h>

#include "handsim/core/archive.h"
#include "handsim/hand/anthropometry.h"

namespace handsim::environment {

RandomWords philox(const RandomWords& counter, const std::array<std::uint64_t, 2>& key) {
  const r123::Philox4x64::ctr_type words =
      r123::Philox4x64()({{counter[0], counter[1], counter[2], counter[3]}}, {{key[0], key[1]}});
  return {words[0], words[1], words[2], words[3]};
}

Draws::Draws(std::uint64_t seed, std::uint64_t draw, std::string_view name)
    : seed_(seed), counter_{draw, hash_bytes(name), 0, 0} {}

double Draws::uniform() {
  if (used_ == words_.size()) {
    words_ = philox(counter_, {seed_, 0});
    ++counter_[2];
    used_ = 0;
  }
  // 52 bits and a half: neither 0 nor 1.
  return (static_cast<double>(words_[used_++] >> 12U) + 0.5) * 0x1p-52;
}

double Draws::normal() { return hand::normal_quantile(uniform()); }

std::size_t Draws::index(std::size_t count) {
  return std::min(count - 1, static_cast<std::size_t>(uniform() * static_cast<double>(count)));
}

}  // namespace handsim::environment
