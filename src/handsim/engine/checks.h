// Checks and step times that all engines share, and the factories of the engines. No types of any engine.
#pragma once

#include "handsim/engine/engine.h"

namespace handsim::engine {

/// Number of the step that starts at a time [s], from time zero on: times gather no rounding error.
long long step_number(double time, double step);
/// End [s] of the step that starts at a time [s].
double next_time(double time, double step);

/// True for bodies that no enabled effect moves.
std::vector<bool> immovable_bodies(const model::Model& model, const model::Effects& effects);

/// True if shapes are tested for contact.
bool needs_contacts(const model::Model& model, const model::Effects& effects);

/// @return the model. @throws Error (input): settings out of range, effects the engine lacks, an invalid
/// model
const model::Model& checked(const model::Model& model, const Settings& settings);

/// Checks all that a step is given. Every engine calls this before anything of it moves.
/// @return the fault of the first torque, or servo's error or feed, that is not finite. @throws Error (input)
/// for torques, servos, excitations or targets of another number, servos without the actuation effect or on a
/// ball joint, gains and limits below 0, excitations without the muscles effect or outside 0..1, forces on
/// bodies that cannot move, targets without the wrist_motion effect, numbers that are not finite in the last
/// two, and either of them if the engine takes none
std::optional<PhysicsFault> input_fault(const model::Model& model, const Settings& settings, double time,
                                        const StepInput& input);

/// @throws Error (input) for a state of another model, numbers not finite, a moved world; q and u are free.
void require_state(const model::Model& model, const model::State& state);

namespace ode {
std::unique_ptr<Engine> make(const model::Model& model, const Settings& settings);
}
namespace dae {
std::unique_ptr<Engine> make(const model::Model& model, const Settings& settings);
}
namespace articulated {
std::unique_ptr<Engine> make(const model::Model& model, const Settings& settings);
}

}  // namespace handsim::engine
