#include "handsim/engine/engine.h"

#include <fmt/format.h>

#include "handsim/engine/checks.h"

namespace handsim::engine {

void Engine::save(ArchiveWriter& /*out*/) const {}

void Engine::restore(const model::State& state, ArchiveReader& /*in*/) { set_state(state); }

void Engine::refresh() {
  throw input_error("engine", fmt::format("{}, whose masses cannot change", name(settings().engine())),
                    "engine ode or articulated");
}

std::unique_ptr<Engine> make_engine(const model::Model& model, const Settings& settings) {
  // In the order of EngineKind.
  constexpr std::array kMakers = {ode::make, dae::make, articulated::make};
  return kMakers[static_cast<std::size_t>(settings.engine())](model, settings);
}

}  // namespace handsim::engine
