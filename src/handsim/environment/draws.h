// Random numbers of seed, draw and name, in any order: Philox4x64-10 (Salmon, Moraes, Dror and Shaw 2011).
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string_view>

namespace handsim::environment {

using RandomWords = std::array<std::uint64_t, 4>;

/// Philox4x64 of ten rounds.
RandomWords philox(const RandomWords& counter, const std::array<std::uint64_t, 2>& key);

/// The numbers of one name in one draw; other names and draws have numbers of their own.
class Draws {
 public:
  Draws(std::uint64_t seed, std::uint64_t draw, std::string_view name);

  /// The next number above 0 and below 1: a multiple of 2^-53.
  double uniform();
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Uniform in the logarithm; both above 0.
  double log_uniform(double low, double high) {
    return std::exp(std::log(low) + std::log(high / low) * uniform());
  }
  /// The next number of the standard normal distribution.
  double normal();
  /// The next index, 0 to count - 1.
  std::size_t index(std::size_t count);

 private:
  std::uint64_t seed_;
  RandomWords counter_;
  RandomWords words_{};
  std::size_t used_ = 4;
};

}  // namespace handsim::environment
