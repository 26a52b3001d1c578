// Many environments of one scene on all cores. Actions and observations: contiguous arrays, a row for each.
// Each has the same bits in any number of threads, in a batch of any size, and alone.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "handsim/environment/environment.h"

namespace handsim::environment {

/// The actions of all environments: as Action, but each array has a row for each environment, or is empty.
struct BatchAction {
  std::span<const double> torques = {};                         ///< [size, dof_count]
  std::span<const double> angles = {};                          ///< [size, driven axes]
  std::span<const Pose> wrists = {};                            ///< [size, driven wrists]
  std::span<const model::PoseRate> wrist_rates = {};            ///< [size, driven wrists]
  std::span<const double> excitations = {};                     ///< [size, muscles]
  std::span<const std::vector<engine::BodyForce>> forces = {};  ///< [size]
};

struct BatchSetup {
  Setup environment = {};
  /// Returns true if an environment is done; called after each of its steps. It is then not stepped until its
  /// reset. Several threads call it at once, for different environments. Null: never done.
  std::function<bool(const Environment&)> done = {};
  int threads = 0;  ///< at most 1024; 0: one per core
};

class Batch {
 public:
  /// @throws Error (input) for a size of 0 or a number of threads out of range, or as Environment.
  Batch(const scene::Scene& scene, std::size_t size, BatchSetup setup = {});
  Batch(Batch&&) noexcept;
  Batch& operator=(Batch&&) noexcept;
  ~Batch();

  std::size_t size() const;
  /// Brings all environments, or those whose mask is not 0, to the start. @param mask of size(), or empty:
  /// all
  void reset(std::span<const unsigned char> mask = {}) { reset(nullptr, {}, mask); }
  /// Draws the numbers of environment i by `seeds[i]`, then brings it to the start as reset(mask) does.
  void reset(std::span<const std::uint64_t> seeds, std::span<const unsigned char> mask = {}) {
    reset(nullptr, seeds, mask);
  }
  /// Brings environments to a motion, as Environment::reset(moment) does. @param seeds empty: no numbers are
  /// drawn
  void reset(const simulation::MotionSnapshot& moment, std::span<const std::uint64_t> seeds,
             std::span<const unsigned char> mask) {
    reset(&moment, seeds, mask);
  }
  /// Steps environments neither done nor failed; diverging motion does not throw, see failed(). @throws Error
  /// (input) for actions of wrong size or not finite; other environments may have moved.
  void step(const BatchAction& action = {}, int substeps = 1);

  /// Environment i becomes one of another scene (prepared once), at its start. @throws Error (input) where
  /// bodies, joints, driven axes, muscles, wrists, observed numbers, engine or step differ
  void replace(std::size_t i, const std::shared_ptr<const scene::Scene>& scene);

  Environment& operator[](std::size_t i);
  const Environment& operator[](std::size_t i) const;
  /// [size, observation size], as of the last step or reset.
  std::span<const double> observations() const;
  std::size_t observation_size() const;
  /// [size]: 1 if an environment is done or failed (Environment::failure).
  std::span<const unsigned char> done() const;
  std::span<const unsigned char> failed() const;

 private:
  void reset(const simulation::MotionSnapshot* moment, std::span<const std::uint64_t> seeds,
             std::span<const unsigned char> mask);
  void step_one(std::size_t i, const BatchAction& action, int substeps);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace handsim::environment
