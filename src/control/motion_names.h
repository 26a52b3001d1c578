// The names that other programs give to joint angles, and what an angle that a table lacks follows: the
// content of a file such as controllers/names_arms.yaml, and of the block `motion` of a scene's control.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "handsim/core/yaml_reader.h"

namespace handsim::control {

/// angle of `axis` = sign * value in the file + offset.
struct ColumnName {
  std::string axis;   ///< `index_mcp.flexion`, or of one hand `right.index_mcp.flexion`
  double sign = 1;    ///< 1 or -1
  double offset = 0;  ///< [rad]
};

/// angle = ratio * angle of `axis` + offset.
struct Coupling {
  std::string axis;  ///< `index_pip.flexion`
  double ratio = 1;
  double offset = 0;  ///< [rad]
};

struct MotionNames {
  std::map<std::string, ColumnName> columns;  ///< by the file's name
  std::map<std::string, Coupling> couplings;  ///< by the axis that follows, used where a table lacks it
};

/// How the motion files of a scene are read.
struct MotionOptions {
  MotionNames names;
  bool clamp = false;            ///< moves angles beyond a stop to it and counts them; otherwise refused
  std::optional<double> filter;  ///< cut-off of a low-pass [Hz] (filter.h); absent: as recorded
  bool spline = false;           ///< joins the samples by a spline, for rates and accelerations
};

/// Reads a file of names; every defect goes into the diagnostics.
MotionNames read_motion_names(YamlNode& node, const std::string& path, Diagnostics& diagnostics);

}  // namespace handsim::control
