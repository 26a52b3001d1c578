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
  switch (settings.engine()) {
    case EngineKind::ode:
      return ode::make(model, settings);
    case EngineKind::dae:
      return dae::make(model, settings);
    case EngineKind::articulated:
      return articulated::make(model, settings);
  }
  return nullptr;
}

}  // namespace handsim::engine
