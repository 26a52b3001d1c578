#include "handsim/engine/settings.h"

#include <fmt/format.h>

namespace handsim::engine {

void Settings::use(EngineKind kind) {
  // In the order of EngineKind.
  const decltype(own) defaults[] = {OdeSettings(), DaeSettings(), ArticulatedSettings()};
  if (kind != engine()) own = defaults[static_cast<std::size_t>(kind)];
}

void Settings::use(const Method& method) {
  use(static_cast<EngineKind>(method.index()));
  std::visit([&](auto& mine) { mine.method = std::get<std::decay_t<decltype(mine.method)>>(method); }, own);
}

bool* speculative(Settings& settings) {
  return std::visit(
      [](auto& own) -> bool* {
        if constexpr (requires { own.speculative; }) return &own.speculative;
        return nullptr;
      },
      settings.own);
}

std::vector<Problem> defects(const Settings& settings) {
  std::vector<Problem> problems;
  const auto need = [&](bool good, const char* key, double value, const char* range) {
    if (!good)
      problems.push_back({std::nullopt, std::string("solver.") + key, fmt::format("{:g}", value), range});
  };
  // These conditions are false for NaN.
  need(settings.step > 0 && settings.step <= kMaxStep, "step", settings.step, "above 0 s, at most 0.1 s");
  std::visit(
      [&](const auto& own) {
        need(own.erp >= 0 && own.erp <= 1, "erp", own.erp, "0 to 1");
        if constexpr (requires { own.cfm; })
          need(own.cfm > 0 && own.cfm <= 1, "cfm", own.cfm, "above 0, at most 1");
        if constexpr (requires { own.iterations; })
          need(own.iterations >= 1 && own.iterations <= kMaxIterations, "iterations", own.iterations,
               "1 to 100000");
        if constexpr (requires { own.tolerance; })
          need(own.tolerance >= kMinTolerance && own.tolerance <= kMaxTolerance, "tolerance", own.tolerance,
               "1e-11 to 1e-2");
      },
      settings.own);
  if (auto problem = missing_library(settings)) problems.push_back(std::move(*problem));
  return problems;
}

std::vector<Problem> missing_effects(const Settings& settings, bool with_stops) {
  const bool smooth =
      settings.engine() != EngineKind::ode && settings.method() != ArticulatedMethod::semi_implicit_euler;
  std::vector<Problem> problems;
  const auto refuse = [&](model::Effect effect, const char* what) {
    if (smooth && settings.effects.has(effect))
      problems.push_back({std::nullopt, "effects", std::string(model::name(effect)),
                          fmt::format("{} {}: leave the effect out, or use engine ode, or articulated with "
                                      "semi_implicit_euler",
                                      what, name(settings.method()))});
  };
  for (const model::Effect effect :
       {model::Effect::object_contact, model::Effect::self_contact, model::Effect::ground_contact})
    refuse(effect, "no contact with");
  if (with_stops) refuse(model::Effect::joint_stops, "smooth motion for");
  if (settings.engine() == EngineKind::articulated)
    for (const model::Effect effect : {model::Effect::muscles, model::Effect::tendon_coupling})
      refuse(effect, "no tendons with");
  return problems;
}

}  // namespace handsim::engine
