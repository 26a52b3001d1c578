// In place of gear.cpp in a build without SUNDIALS.
#include <memory>
#include <string>

#include "handsim/core/error.h"
#include "handsim/engine/dae/integrator.h"

namespace handsim::engine::dae {

std::unique_ptr<Integrator> make_gear(System, const Settings&) {
  throw input_error("solver.method", "stabilised_gear in a program that was built without SUNDIALS",
                    "./dev build, which installs it (libsundials-dev), or another method of dae");
}

std::string gear_library() { return "no SUNDIALS"; }

}  // namespace handsim::engine::dae
