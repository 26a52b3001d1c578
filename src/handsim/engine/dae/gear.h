// stabilised_gear, by the library SUNDIALS; no_gear.cpp stands in its place in a build without it.
#pragma once

#include "handsim/engine/dae/integrator.h"

namespace handsim::engine::dae {

/// The method stabilised_gear; null in a build without SUNDIALS.
std::unique_ptr<Integrator> make_gear(System system, const Settings& settings);
/// The library that integrates stabilised_gear, with its version.
std::string gear_library();

}  // namespace handsim::engine::dae
