// What every engine checks and counts the same way: times of steps, torques, states handed in, and the
// factories that make_engine chooses from. No types of any engine.
#pragma once

#include "handsim/engine/engine.h"

namespace handsim::engine {

/// Steps are counted from time zero, so that time neither drifts nor depends on where a run was resumed.
long long step_number(double time, double step);
/// End [s] of the step that starts at a time [s].
double next_time(double time, double step);

/// True for bodies that no effect in force moves.
std::vector<bool> immovable_bodies(const model::Model& model, const model::Effects& effects);

/// True where shapes are to be tested for contact.
bool needs_contacts(const model::Model& model, const model::Effects& effects);

/// @throws Error (input) for settings out of range, effects that the engine does not have, or an unsound
/// model.
/// @return the model
const model::Model& checked(const model::Model& model, const Settings& settings);

/// @throws Error (input) for a wrong number of torques.
/// Returns the fault of the first torque that is not finite.
std::optional<PhysicsFault> torque_fault(const model::Model& model, double time,
                                         std::span<const double> torques);

/// @throws Error (input) for a wrong number of servos, servos without actuation, negative gains or limits.
/// Returns the fault of the first servo with an error or feed that is not finite.
std::optional<PhysicsFault> servo_fault(const model::Model& model, const Settings& settings, double time,
                                        std::span<const model::Servo> servos);

/// @throws Error (input) for forces on bodies that cannot move, a wrong number of drive targets, targets
/// without the wrist_motion effect, numbers that are not finite, and any of them where the engine takes none.
void require_outside(const model::Model& model, const Settings& settings, const StepInput& input);

/// @throws Error (input) for a state of another model, with non-finite numbers or a moved world; q and u may
/// be anything.
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
