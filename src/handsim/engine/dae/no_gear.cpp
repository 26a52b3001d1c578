// In place of gear.cpp in a build without SUNDIALS.
#include <memory>
#include <string>

#include "handsim/engine/dae/gear.h"

namespace handsim::engine {

std::optional<Problem> missing_library(const Settings& settings) {
  if (settings.method() != Method(DaeMethod::stabilised_gear)) return std::nullopt;
  return Problem{std::nullopt, "solver.method",
                 "stabilised_gear in a program that was built without SUNDIALS",
                 "./dev build, which installs it (libsundials-dev), or another method"};
}

namespace dae {

// Settings are checked before.
std::unique_ptr<Integrator> make_gear(System, const Settings&) { return nullptr; }

std::string gear_library() { return "no SUNDIALS"; }

}  // namespace dae
}  // namespace handsim::engine
