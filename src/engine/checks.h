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

/// @return the fault of the first torque that is not finite. @throws Error (input) for another number.
std::optional<PhysicsFault> torque_fault(const model::Model& model, double time,
                                         std::span<const double> torques);

/// @return the fault of the first servo whose error or feed is not finite. @throws Error (input) for a wrong
/// number of servos, servos without the actuation effect, and negative gains or limits.
std::optional<PhysicsFault> servo_fault(const model::Model& model, const Settings& settings, double time,
                                        std::span<const model::Servo> servos);

/// @throws Error (input) for forces on bodies that cannot move, a wrong number of drive targets, targets
/// without the wrist_motion effect, numbers that are not finite, and any of them if the engine takes none.
void require_outside(const model::Model& model, const Settings& settings, const StepInput& input);

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
