// What every formulation offers: one island of the model, carried from one time to the next.
#pragma once

#include <memory>
#include <span>

#include "handsim/engine/multibody/system.h"

namespace handsim::engine::dae {

class Integrator {
 public:
  virtual ~Integrator() = default;
  /// Forgets the past and goes on from a state, whose bodies it may move onto the joints.
  /// @throws Error (physics) where the joints cannot be closed.
  virtual void start(model::State& state) = 0;
  /// Carries the island's bodies from where it left them, at state.time, to `end` [s]; touches nothing else.
  /// @param torques size model.dof_count() or empty, constant over the step. @throws Error (physics)
  virtual void advance(std::span<const double> torques, double end, model::State& state) = 0;
  /// What the steps to come depend on beyond the state.
  virtual void save(ArchiveWriter& out) const = 0;
  /// Goes on from a state to the bit; touches it not.
  /// @throws Error (input) for an archive that does not fit
  virtual void restore(const model::State& state, ArchiveReader& in) = 0;
};

/// The formulation that the settings name.
std::unique_ptr<Integrator> make_integrator(System system, const Settings& settings);

}  // namespace handsim::engine::dae
