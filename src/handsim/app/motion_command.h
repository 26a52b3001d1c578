// The command for recorded motion.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "handsim/study/track/track.h"

namespace handsim::app {

struct TrackArguments : study::TrackInput {
  std::filesystem::path out;
  std::optional<std::filesystem::path> person_file, hand_file, marker_file, points_file;
  bool activations = false;  ///< and inverse dynamics with muscles, into out/activations
  bool json = false;
};
/// The input with what its files say. @throws Error (input) with every problem of the files.
study::TrackInput track_input(const TrackArguments& arguments);
int track_command(const TrackArguments& arguments);

}  // namespace handsim::app
