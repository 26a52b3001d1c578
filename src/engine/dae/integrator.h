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
  /// Goes on from a state to the bit; does not change it.
  /// @throws Error (input) for an archive that does not fit
  virtual void restore(const model::State& state, ArchiveReader& in) = 0;
};

std::unique_ptr<Integrator> make_gear(System system, const Settings& settings);
std::unique_ptr<Integrator> make_penalty(System system);
std::unique_ptr<Integrator> make_euler(System system, const Settings& settings);

/// The part of the forces that the fixed-step formulations treat implicitly, linearised:
/// M - a df/du - a b df/dx T for gyroscopic torques and tissue, where new velocities count a times in a
/// step's momentum and b times in its displacement [s].
Matrix implicit_mass(const System& system, const model::State& state, double a, double b);

}  // namespace handsim::engine::dae
