// Many environments of one scene, stepped on all cores. Their numbers stand in contiguous arrays, one row for
// each environment. Every environment does the same, to the bit, for any number of threads, in a batch of any
// size, and as it would alone.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "handsim/environment/environment.h"

namespace handsim::environment {

/// As Action; each array has a row for each environment, or is empty.
struct BatchAction {
  std::span<const double> torques = {};                         ///< [size, dof_count]
  std::span<const double> angles = {};                          ///< [size, driven axes]
  std::span<const Pose> wrists = {};                            ///< [size, driven wrists]
  std::span<const model::PoseRate> wrist_rates = {};            ///< [size, driven wrists]
  std::span<const std::vector<engine::BodyForce>> forces = {};  ///< [size]
};

struct BatchSetup {
  Setup environment = {};
  /// Whether an environment has come to its end, asked after each step of it: it is not stepped any further
  /// until its reset. From several threads at once, of different environments. Null: never.
  std::function<bool(const Environment&)> done = {};
  int threads = 0;  ///< 0: as many as the machine has
};

class Batch {
 public:
  /// @throws Error (input) for a size of 0, or as Environment.
  Batch(const scene::Scene& scene, std::size_t size, BatchSetup setup = {});
  Batch(Batch&&) noexcept;
  Batch& operator=(Batch&&) noexcept;
  ~Batch();

  std::size_t size() const;
  /// All environments, or those whose mask is not 0, to the start. @param mask of size(), or empty: all
  void reset(std::span<const unsigned char> mask = {});
  /// The same with numbers drawn: environment i by `seeds[i]`.
  void reset(std::span<const std::uint64_t> seeds, std::span<const unsigned char> mask = {});
  /// Steps those that are neither done nor failed. @throws Error (input) for an action of another size or
  /// with numbers that are not finite, naming the first environment: others may have moved.
  /// What diverges does not throw: see `failed`.
  void step(const BatchAction& action = {}, int substeps = 1);

  Environment& operator[](std::size_t i);
  const Environment& operator[](std::size_t i) const;
  /// [size, observation size], as of the last step or reset.
  std::span<const double> observations() const;
  std::size_t observation_size() const;
  /// [size]: 1 where it has come to its end or failed (Environment::failure).
  std::span<const unsigned char> done() const;
  std::span<const unsigned char> failed() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace handsim::environment
