// The commands for recorded motion.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace handsim::app {

struct InverseArguments {
  std::filesystem::path scene;
  std::optional<std::filesystem::path> motion, names, loads;
  std::filesystem::path out;
  std::vector<std::string> overrides;
  bool clamp = false;
  std::optional<double> cutoff = 6;  ///< [Hz]
  bool no_check = false;
  bool json = false;
};
int inverse_command(const InverseArguments& arguments);

struct TrackArguments {
  std::filesystem::path recording;
  std::filesystem::path out;
  std::optional<std::filesystem::path> person, model, markers, truth;
  bool keep_person = false;
  bool no_smoothing = false;
  double noise = 0;  ///< [m]
  unsigned seed = 1;
  bool json = false;
};
int track_command(const TrackArguments& arguments);

}  // namespace handsim::app
