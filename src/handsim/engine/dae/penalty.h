// lagrange_penalty.
#pragma once

#include "handsim/engine/dae/integrator.h"

namespace handsim::engine::dae {

/// The method lagrange_penalty.
std::unique_ptr<Integrator> make_penalty(System system);

}  // namespace handsim::engine::dae
