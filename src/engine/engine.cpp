#include "handsim/engine/engine.h"

#include <fmt/format.h>

#include "handsim/engine/checks.h"

namespace handsim::engine {

std::vector<Problem> defects(const Settings& settings) {
  std::vector<Problem> problems;
  const auto need = [&](bool good, const char* key, double value, const char* range) {
    if (!good)
      problems.push_back({std::nullopt, std::string("solver.") + key, fmt::format("{:g}", value), range});
  };
  // Written so that NaN fails.
  need(settings.step > 0 && settings.step <= kMaxStep, "step", settings.step, "above 0 s, at most 0.1 s");
  need(settings.erp >= 0 && settings.erp <= 1, "erp", settings.erp, "0 to 1");
  need(settings.cfm > 0 && settings.cfm <= 1, "cfm", settings.cfm, "above 0, at most 1");
  need(settings.iterations >= 1 && settings.iterations <= kMaxIterations, "iterations", settings.iterations,
       "1 to 100000");
  need(settings.tolerance >= kMinTolerance && settings.tolerance <= kMaxTolerance, "tolerance",
       settings.tolerance, "1e-11 to 1e-2");
  return problems;
}

void Engine::save(ArchiveWriter& /*out*/) const {}

void Engine::restore(const model::State& state, ArchiveReader& /*in*/) { set_state(state); }

std::unique_ptr<Engine> make_engine(const model::Model& model, const Settings& settings) {
  switch (model::engine_of(settings.method)) {
    case model::EngineKind::ode:
      return ode::make(model, settings);
    case model::EngineKind::dae:
      return dae::make(model, settings);
    case model::EngineKind::articulated:
      return articulated::make(model, settings);
  }
  return nullptr;
}

}  // namespace handsim::engine
