// A video as Python asks for it: file, frames in a second, and simulated seconds in a second of video.
#pragma once

#include <filesystem>
#include <tuple>

#include "handsim/simulation/run/film.h"

namespace handsim::python {

using VideoChoice = std::tuple<std::filesystem::path, double, double>;

inline simulation::VideoSpec video_of(const VideoChoice& choice) {
  return {std::get<0>(choice), std::get<1>(choice), std::get<2>(choice)};
}

}  // namespace handsim::python
