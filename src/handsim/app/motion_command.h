// The commands for recorded motion.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "handsim/study/inverse/inverse.h"
#include "handsim/study/track/track.h"

namespace handsim::app {

struct InverseArguments {
  std::filesystem::path scene;
  std::optional<std::filesystem::path> motion, names, loads;
  std::filesystem::path out;
  std::vector<std::string> overrides;
  bool clamp = false;
  std::optional<double> cutoff = 6;  ///< [Hz]
  bool no_check = false;
  bool muscles = false;
  double co_contraction = 0;  ///< least activation
  bool apart = false;         ///< with muscles: no contact in the check, which is no part of the torques
  bool json = false;
  std::optional<int> uncertain;  ///< hands that are drawn
  std::string on;                ///< address of the Dask scheduler that runs these; empty: this machine
  bool report = false;           ///< of these: writes report.html
};
/// @throws Error (input) for a file of names that is none.
study::InverseInput inverse_input(const InverseArguments& arguments);
int inverse_command(const InverseArguments& arguments);

struct TrackArguments {
  std::filesystem::path recording;
  std::filesystem::path out;
  std::optional<std::filesystem::path> person, model, markers, truth;
  bool keep_person = false;
  bool no_smoothing = false;
  bool activations = false;  ///< and inverse dynamics with muscles, into out/activations
  double noise = 0;          ///< [m]
  unsigned seed = 1;
  bool json = false;
};
/// @throws Error (input) with every problem of the files.
study::TrackInput track_input(const TrackArguments& arguments);
int track_command(const TrackArguments& arguments);

}  // namespace handsim::app
