// Grip strength of a person: measured, or the norm of a survey by sex, age and stature.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/hand/person.h"

namespace handsim::hand {

/// People of one sex, age and stature.
struct GripNorm {
  Sex sex = Sex::male;
  std::pair<double, double> age;      ///< [years], both ends included
  std::pair<double, double> stature;  ///< [m], from the first to below the second
  double mean = 0;                    ///< on a dynamometer [N]
  double deviation = 0;               ///< standard deviation [N]
};

struct GripTable {
  std::vector<GripNorm> norms;  ///< at least one of each sex
};

/// Reads a table of norms; every defect goes into the diagnostics.
GripTable read_grip_table(const YamlNode& node, const std::string& path, Diagnostics& diagnostics);

/// Grip strength of a person and its norm.
struct GripStrength {
  double norm = 0;       ///< mean for this sex, age and stature [N]
  double deviation = 0;  ///< standard deviation of the norm [N]
  double own = 0;        ///< measured if the person states it, else the norm, with its deviation [N]
  bool measured = false;
  bool extrapolated = false;  ///< age or stature outside the table: nearest row used
};

/// Age assumed if the person states none [years].
inline constexpr double kDefaultAge = 30;

/// The row of the person's sex whose age and stature are nearest, times (stature / its smallest)^2 for
/// shorter people: areas of muscles. Of children, linear in age between the middles of their groups. Unknown
/// sex: the mean of both.
GripStrength grip_strength(const GripTable& table, const Person& person);

}  // namespace handsim::hand
