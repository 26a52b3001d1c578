// The options of drawing on the command line, as the library takes them.
#pragma once

#include <optional>

#include "handsim/app/commands.h"
#include "handsim/simulation/run/film.h"

namespace handsim::app {

inline std::optional<simulation::VideoSpec> video_of(const DrawArguments& arguments) {
  if (!arguments.video) return std::nullopt;
  return simulation::VideoSpec{*arguments.video, arguments.fps, arguments.speed};
}

inline std::optional<output::Gl> gl_of(const DrawArguments& arguments) {
  if (arguments.gl.empty()) return std::nullopt;
  return arguments.gl == "egl" ? output::Gl::egl : output::Gl::osmesa;
}

}  // namespace handsim::app
