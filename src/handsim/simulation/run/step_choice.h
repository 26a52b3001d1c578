// `solver.step: auto`, on the articulated engine: the largest step at which no verdict of a scene is the
// step's.
#pragma once

#include <functional>

#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// A scene at the step that its criteria ask for. Runs of it at h, h / 2 and h / 4 tell how much its figures
/// are off: the error is of first order (docs/speed.md), so that at h it is twice the difference of the first
/// two and four times that of the last two, of which the larger counts. Steps from 4 ms down are tried until
/// each verdict is the same in the three runs and its figure farther from its limit than that; where none is
/// left, the smallest is taken. The spec and the resolved text have the step, SceneSpec::step_choice the
/// reason. A scene that names its step is returned as it is.
/// @param poll called after each step of the runs; what it throws ends them.
/// @throws Error (input) for a scene without limits, by which a step could be judged
scene::Scene with_chosen_step(scene::Scene scene, const std::function<void()>& poll = {});

}  // namespace handsim::simulation
