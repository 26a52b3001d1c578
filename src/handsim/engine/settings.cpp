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

namespace {

/// False for a condition that the settings do not meet.
template <class Own, class Form>
bool met(const Own& own, const Form& form) {
  if constexpr (std::predicate<Form, const Own&>)
    return form(own);
  else
    return true;
}

std::optional<Quantity> range_of(const Quantity& range) { return range; }
std::optional<Quantity> range_of(const WholeRange& range) {
  return Quantity{Dimension::none, static_cast<double>(range.min), static_cast<double>(range.max)};
}
template <class Form>
std::optional<Quantity> range_of(const Form&) {
  return std::nullopt;
}

}  // namespace

bool uses(const Settings& settings, std::string_view key) {
  bool used = true;
  const auto look = [&](const auto& own) {
    own.fields([&](std::string_view each, auto, const auto&... form) {
      if (each == key) used = (met(own, form) && ...);
    });
  };
  std::visit(look, settings.own);
  return used;
}

std::vector<Problem> defects(const Settings& settings) {
  std::vector<Problem> problems;
  const auto check = [&](std::string_view key, double value, const std::optional<Quantity>& range) {
    if (range && !range->allows(value))
      problems.push_back(
          {std::nullopt, fmt::format("solver.{}", key), fmt::format("{:g}", value), range->need()});
  };
  check("step", settings.step, kStepRange);
  each_setting(settings, [&]<class T>(std::string_view key, const T& value, const auto&... form) {
    if constexpr (std::is_arithmetic_v<T>) (check(key, static_cast<double>(value), range_of(form)), ...);
  });
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
