// What a picture is drawn from, and a video, as Python holds them.
#pragma once

#include <filesystem>
#include <tuple>

#include "handsim/simulation/run/film.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/snapshot.h"

namespace handsim::python {

struct Frame {
  simulation::PictureState moment;
};

/// The motion that a reset goes to, within this process.
struct Motion {
  simulation::MotionSnapshot motion;
};

/// File, frames in a second, and simulated seconds in a second of video.
using VideoChoice = std::tuple<std::filesystem::path, double, double>;

/// A picture of an array [height, width, 3] of uint8. @throws Error (input) for another shape
template <class Pixels>
output::Image image_of(const Pixels& pixels) {
  if (pixels.ndim() != 3 || pixels.shape(2) != 3)
    throw input_error("pictures", "an array of another shape", "shape (height, width, 3), dtype uint8");
  output::Image image{static_cast<int>(pixels.shape(1)), static_cast<int>(pixels.shape(0)), {}};
  image.rgb.assign(pixels.data(), pixels.data() + pixels.size());
  return image;
}

inline simulation::VideoSpec video_of(const VideoChoice& choice) {
  return {std::get<0>(choice), std::get<1>(choice), std::get<2>(choice)};
}

}  // namespace handsim::python
