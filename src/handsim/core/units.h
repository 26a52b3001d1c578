// Reads numbers with units of mechanics, in YAML and options: `"35 mm"` or a bare SI number in, SI out.
#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace handsim {

inline constexpr double kDegree = M_PI / 180;  ///< [rad]
inline constexpr double kDegreesPerRadian = 1 / kDegree;

enum class Dimension {
  none,
  length,
  angle,
  time,
  mass,
  density,
  speed,
  angular_speed,
  acceleration,
  torque,
  rotational_stiffness,
  rotational_damping,
  rotational_integral,  ///< of an integral gain, N m/(rad s)
  frequency,
  stiffness,  ///< of a translation, N/m
  damping,    ///< of a translation, N s/m
  force,
};

/// What a number must be: its dimension and range in SI.
struct Quantity {
  Dimension dimension = Dimension::none;
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool above_min = false;  ///< the minimum itself is not allowed

  /// For messages, e.g. `a length, above 0 to 0.5 m, such as 0.02 or "20 mm"`. @param got may lack its unit
  std::string need(std::string_view got = {}) const;
  bool allows(double value) const;
};

/// Parses a bare finite number (SI) or a number and a unit of this dimension; nothing otherwise.
std::optional<double> parse_quantity(std::string_view text, Dimension dimension);

/// Units that a number of this dimension may have.
std::vector<std::string_view> units_of(Dimension dimension);

/// Parses all of the text as one finite number, with `.` as the decimal point in every locale.
std::optional<double> parse_number(std::string_view text);

/// Shortest text that reads back as the same double.
std::string number_text(double value);

}  // namespace handsim
