// What a picture is drawn from, as Python holds it.
#pragma once

#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/snapshot.h"

namespace handsim::python {

struct Frame {
  simulation::Moment moment;
};

/// The motion that a reset goes to, within this process.
struct Motion {
  simulation::MotionSnapshot motion;
};

}  // namespace handsim::python
