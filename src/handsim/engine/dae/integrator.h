// The interface of all methods: integrates one island of the model.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "handsim/engine/multibody/system.h"

namespace handsim::engine::dae {

class Integrator {
 public:
  virtual ~Integrator() = default;
  /// Starts without history; may project onto the joints. @throws Error (physics) if they cannot be closed
  virtual void start(model::State& state) = 0;
  /// Advances the island's bodies, as the last call left them, from state.time to `end` [s]; nothing else.
  /// @param torques constant, size model.dof_count() or empty. @throws Error (physics)
  virtual void advance(std::span<const double> torques, double end, model::State& state) = 0;
  /// Writes the history on which the next steps depend, beside the state.
  virtual void save(ArchiveWriter& out) const = 0;
  /// Reads the history, so that the next steps have the same bits. @throws Error (input) if it does not fit
  virtual void restore(const model::State& state, ArchiveReader& in) = 0;
};

/// Null in a build without SUNDIALS.
std::unique_ptr<Integrator> make_gear(System system, const Settings& settings);
/// The library that integrates stabilised_gear, with its version.
std::string gear_library();
std::unique_ptr<Integrator> make_penalty(System system);
std::unique_ptr<Integrator> make_euler(System system, const Settings& settings);

/// The matrix of the implicit methods with fixed step: M - a df/du - a b df/dx T, with the derivatives of
/// gyroscopic torques and tissue; a and b [s] weigh the new velocities in the step's impulse and motion.
Matrix implicit_mass(const System& system, const model::State& state, double a, double b);

}  // namespace handsim::engine::dae
