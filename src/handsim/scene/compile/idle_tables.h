// Tables over time that a run does not reach: its times may be of another clock.
#pragma once

#include "handsim/scene/compile/scene.h"

namespace handsim::scene {

/// Warns of wrist motions, tables of angles and tables of excitations that change, but not during the run,
/// from 0 to its end: their first or last row holds all the time. Of a scene that is compiled but for this.
void warn_of_idle_tables(const Scene& scene, Diagnostics& diagnostics);

}  // namespace handsim::scene
