// Recordings of hands: positions of keypoints or markers, orientations of sensors, over time.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "handsim/core/pose.h"

namespace handsim::study {

/// What was recorded under one name, at the indices of Recording::times; absent: not seen in that frame.
struct Channel {
  std::vector<std::optional<Vec3>> points;        ///< world [m]
  std::vector<std::optional<Quat>> orientations;  ///< q_WorldSensor
};

struct Recording {
  std::string file;
  std::vector<double> times;                ///< [s], increasing
  std::map<std::string, Channel> channels;  ///< keypoints: `right.index_pip`; markers, sensors: their names
};

/// Reads a recording by its file's ending:
/// - .csv: `time[s],NAME.x[m],NAME.y[m],NAME.z[m],...` (or [mm]), sensors `NAME.qw,NAME.qx,NAME.qy,NAME.qz`;
///   keypoints are `right.wrist`, ... or by number, `right.0` to `right.20`. An empty field or `nan`: not
///   seen.
/// - .json: `{"frames": [{"time": 0, "hands": [{"side": "right", "points": [[x, y, z], ...]}]}]}` with 21
///   points in the usual order, each [x, y, z], {"x":, "y":, "z":} or null; `"rate"` in Hz in place of times,
///   `"unit"`: m (default) or mm.
/// - .trc: markers as OpenSim and Motion Analysis write them.
/// @throws Error (input) with the place of what cannot be read.
Recording read_recording(const std::filesystem::path& path);

}  // namespace handsim::study
