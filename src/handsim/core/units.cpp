#include "handsim/core/units.h"

#include <algorithm>
#include <array>
#include <charconv>

#include <fmt/format.h>

#include "handsim/core/text.h"

namespace handsim {

namespace {

struct Unit {
  std::string_view name;
  Dimension dimension;
  double factor;
};

constexpr std::array kUnits = {
    Unit{"m", Dimension::length, 1},
    Unit{"cm", Dimension::length, 1e-2},
    Unit{"mm", Dimension::length, 1e-3},
    Unit{"um", Dimension::length, 1e-6},
    Unit{"rad", Dimension::angle, 1},
    Unit{"deg", Dimension::angle, kDegree},
    Unit{"s", Dimension::time, 1},
    Unit{"ms", Dimension::time, 1e-3},
    Unit{"us", Dimension::time, 1e-6},
    Unit{"kg", Dimension::mass, 1},
    Unit{"g", Dimension::mass, 1e-3},
    Unit{"mg", Dimension::mass, 1e-6},
    Unit{"kg/m3", Dimension::density, 1},
    Unit{"g/cm3", Dimension::density, 1e3},
    Unit{"m/s", Dimension::speed, 1},
    Unit{"mm/s", Dimension::speed, 1e-3},
    Unit{"um/s", Dimension::speed, 1e-6},
    Unit{"rad/s", Dimension::angular_speed, 1},
    Unit{"deg/s", Dimension::angular_speed, kDegree},
    Unit{"m/s2", Dimension::acceleration, 1},
    Unit{"N m", Dimension::torque, 1},
    Unit{"N mm", Dimension::torque, 1e-3},
    Unit{"mN m", Dimension::torque, 1e-3},
    Unit{"N m/rad", Dimension::rotational_stiffness, 1},
    Unit{"N m/deg", Dimension::rotational_stiffness, 1 / kDegree},
    Unit{"N m s/rad", Dimension::rotational_damping, 1},
    Unit{"N m/(rad s)", Dimension::rotational_integral, 1},
    Unit{"Hz", Dimension::frequency, 1},
    Unit{"N/m", Dimension::stiffness, 1},
    Unit{"N/mm", Dimension::stiffness, 1e3},
    Unit{"N s/m", Dimension::damping, 1},
    Unit{"N", Dimension::force, 1},
    Unit{"mN", Dimension::force, 1e-3},
};

/// A value in SI for messages, and the unit in which it is also shown.
struct Example {
  double value = 0;
  std::string_view unit = {};
};

struct DimensionText {
  std::string_view name;
  std::string_view unit;
  std::array<Example, 3> examples;
};

/// In the order of Dimension.
constexpr DimensionText kTexts[] = {{"a number", "", {}},
                                    {"a length", "m", {{{0.02, "mm"}, {0.1, "mm"}, {1.75, "cm"}}}},
                                    {"an angle", "rad", {{{90 * kDegree, "deg"}}}},
                                    {"a time", "s", {{{0.001, "ms"}, {0.5, "ms"}}}},
                                    {"a mass", "kg", {{{0.4, "g"}, {70, "kg"}}}},
                                    {"a density", "kg/m3", {{{1148, "g/cm3"}}}},
                                    {"a speed", "m/s", {{{0.1, "mm/s"}}}},
                                    {"an angular speed", "rad/s", {{{6, "rad/s"}}}},
                                    {"an acceleration", "m/s2", {{{9.81, "m/s2"}}}},
                                    {"a torque", "N m", {{{0.5, "N m"}}}},
                                    {"a stiffness", "N m/rad", {{{0.04, "N m/rad"}}}},
                                    {"a damping", "N m s/rad", {{{0.001, "N m s/rad"}}}},
                                    {"an integral gain", "N m/(rad s)", {{{0.1, "N m/(rad s)"}}}},
                                    {"a frequency", "Hz", {{{5, "Hz"}}}},
                                    {"a stiffness", "N/m", {{{2000, "N/mm"}}}},
                                    {"a damping", "N s/m", {{{5, "N s/m"}}}},
                                    {"a force", "N", {{{20, "N"}}}}};
static_assert(std::size(kTexts) == static_cast<std::size_t>(Dimension::force) + 1);

/// Removes a number from the start of `text` and returns it.
std::optional<double> take_number(std::string_view& text) {
  double value = 0;
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  if (result.ec != std::errc() || !std::isfinite(value)) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(result.ptr - text.data()));
  return value;
}

}  // namespace

std::optional<double> parse_number(std::string_view text) {
  const std::optional<double> value = take_number(text);
  return text.empty() ? value : std::nullopt;
}

std::optional<double> parse_quantity(std::string_view text, Dimension dimension) {
  text = trimmed(text);
  const std::optional<double> value = take_number(text);
  text = trimmed(text);
  if (!value || text.empty()) return value;
  for (const Unit& unit : kUnits)
    if (unit.name == text && unit.dimension == dimension) return *value * unit.factor;
  return std::nullopt;
}

std::vector<std::string_view> units_of(Dimension dimension) {
  std::vector<std::string_view> out;
  for (const Unit& unit : kUnits)
    if (unit.dimension == dimension) out.push_back(unit.name);
  return out;
}

std::string number_text(double value) { return fmt::format("{}", value); }

bool Quantity::allows(double value) const {
  return std::isfinite(value) && value <= max && (above_min ? value > min : value >= min);
}

std::string Quantity::need(std::string_view got) const {
  const DimensionText& text = kTexts[static_cast<std::size_t>(dimension)];
  const std::string unit = text.unit.empty() ? "" : fmt::format(" {}", text.unit);
  std::string out(text.name);
  if (std::isfinite(min) && std::isfinite(max))
    out += fmt::format(", {}{:g} to {:g}{}", above_min ? "above " : "", min, max, unit);
  else if (std::isfinite(min))
    out += fmt::format(", {} {:g}{}", above_min ? "above" : "at least", min, unit);
  else if (std::isfinite(max))
    out += fmt::format(", at most {:g}{}", max, unit);
  else if (!unit.empty())
    out += fmt::format(" in{}", unit);
  const std::optional<double> bare = parse_number(trimmed(got));
  for (const Unit& other : kUnits)
    if (bare && other.dimension == dimension && allows(*bare * other.factor))
      return out + fmt::format(", such as \"{} {}\"", trimmed(got), other.name);
  for (const auto& [value, in] : text.examples)
    if (!in.empty() && allows(value))
      return out + fmt::format(", such as {:.4g} or \"{:g} {}\"", value,
                               value / std::ranges::find(kUnits, in, &Unit::name)->factor, in);
  return out;
}

}  // namespace handsim
