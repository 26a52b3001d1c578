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
  virtual void reset(model::State& state) = 0;
  /// Advances the island's bodies, as the last call left them, from state.time to `end` [s]; nothing else.
  /// @param torques constant, size model.dof_count() or empty. @throws Error (physics)
  virtual void advance(std::span<const double> torques, double end, model::State& state) = 0;
  /// Writes the history on which the next steps depend, beside the state.
  virtual void save(ArchiveWriter& out) const = 0;
  /// Reads the history, so that the next steps have the same bits. @throws Error (input) if it does not fit
  virtual void restore(const model::State& state, ArchiveReader& in) = 0;
};

}  // namespace handsim::engine::dae
