// How strongly people grip: norms of a survey by sex, age and stature, and what a person makes of them.
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
GripTable read_grip_table(YamlNode& node, const std::string& path, Diagnostics& diagnostics);

/// What a person's grip is held against.
struct GripStrength {
  double norm = 0;       ///< mean of people alike [N]
  double deviation = 0;  ///< of them [N]
  double own = 0;        ///< measured, where the person states it, else the norm [N]
  bool measured = false;
  bool extrapolated = false;  ///< age or stature outside the table: its nearest row
};

/// Age of a person who states none [years].
inline constexpr double kUsualAge = 30;

/// The row of the person's sex whose age and stature are nearest; unknown sex: the mean of both.
GripStrength grip_strength(const GripTable& table, const Person& person);

}  // namespace handsim::hand
