// All of a model that files for other programs are made of, as one JSON text: python/handsim/_model.py names
// its fields, and python/handsim has the writers.
#pragma once

#include <string>
#include <vector>

#include "handsim/control/controller.h"
#include "handsim/control/plan.h"
#include "handsim/engine/settings.h"
#include "handsim/model/actuation.h"
#include "handsim/model/model.h"
#include "handsim/model/state.h"

namespace handsim::output {

/// When a file begins.
struct Moment {
  model::State state;
  std::vector<model::Servo>
      drives;  ///< of the controller, by coordinate; empty: the plan's gains and targets
};
/// After a step. @param controller that commanded the step; null: none
Moment moment_after(const model::State& state, const control::Controller* controller);

/// The model: bodies, joints, shapes, hands, muscles, bands and driven bodies; which shapes may touch, and
/// with what surface; what moves it: settings, drives, the state at the start.
///
/// Poses are x y z and a quaternion w x y z. Surfaces whose pads stiffen have the spring and the damper of a
/// lasting press of `lasting_load`. Tendons have their excursion, and muscles their forces, at the start.
/// @param plan its axes have drives; null: none has
/// @param moment the start; null: the model's initial state
std::string description(const model::Model& model, const engine::Settings& settings,
                        const control::Plan* plan = nullptr, const Moment* moment = nullptr);

}  // namespace handsim::output
