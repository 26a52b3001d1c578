#include "handsim/simulation/run/film.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/output/video/video.h"
#include "handsim/simulation/simulation.h"

namespace handsim::simulation {

namespace {

/// Memory for the moments at most, estimated with this many contacts each [bytes].
constexpr double kMostBytes = 1e9, kContacts = 40;
/// A camera that follows the hand looks this far ahead and back [s of video].
constexpr double kSmooth = 0.5;

}  // namespace

Film::Film(const scene::Scene& scene, const VideoSpec& spec, long first, long last)
    : model_(scene.model), step_(scene.spec.solver.step), spec_(spec), first_(first), last_(last) {
  output::check_video(spec.file, spec.fps);
  const double span = static_cast<double>(last - first) * step_;
  const double frames = std::min(span / spec.speed * spec.fps, static_cast<double>(last - first)) + 1;
  // Slow motion repeats frames.
  constexpr double kMostFrames = 1e6, kFastest = 1e4;
  if (!(spec.speed > 0 && spec.speed <= kFastest) || span / spec.speed * spec.fps > kMostFrames)
    throw input_error(
        "--speed", fmt::format("{:g}", spec.speed),
        fmt::format("one above 0, at most {:g}, that gives at most {:.0f} frames", kFastest, kMostFrames));
  const double bytes = frames * (static_cast<double>(scene.model.bodies.size()) * sizeof(model::BodyState) +
                                 kContacts * sizeof(engine::Contact));
  if (bytes > kMostBytes)
    throw input_error("--video",
                      fmt::format("a video of {:.0f} frames, which take {:.1f} GB", frames, bytes / 1e9),
                      "at most 1 GB: a smaller --fps, or a larger --speed");
}

long Film::step_of(long frame) const {
  const double time = static_cast<double>(frame) / spec_.fps * spec_.speed;
  return first_ + std::lround(time / step_);
}

void Film::record(long step, const engine::Engine& engine) {
  if (step > last_ || step_of(frames_) > step) return;
  moments_.push_back(picture_state(engine));
  repeats_.push_back(0);
  for (; step_of(frames_) <= step; ++frames_) ++repeats_.back();
}

void Film::write(const scene::PictureSpec& pictures, const Drawing& drawing,
                 const output::Progress& progress) const {
  const auto [width, height] = pictures.size;
  output::VideoWriter video({spec_.file, width, height, spec_.fps});
  Drawing own = drawing;
  const double moments_per_second =
      static_cast<double>(moments_.size()) / static_cast<double>(std::max(1L, frames_)) * spec_.fps;
  own.smooth = static_cast<std::size_t>(std::lround(kSmooth * moments_per_second));
  draw({model_, pictures}, moments_, own, {}, [&](std::size_t i, const Picture& picture) {
    for (int k = 0; k < repeats_[i]; ++k) video.add(picture.image);
    if (progress) progress(static_cast<double>(i + 1) / static_cast<double>(moments_.size()));
  });
  video.finish();
}

Film film_until(const scene::Scene& scene, const VideoSpec& spec, double time,
                const output::Progress& progress) {
  const long last = std::lround(time / scene.spec.solver.step);
  Film film(scene, spec, 0, last);
  Simulation simulation(std::shared_ptr<const scene::Scene>(std::shared_ptr<void>(), &scene), only<Monitor>);
  film.record(0, simulation.engine());
  for (long i = 1; i <= last; ++i) {
    simulation.step();
    film.record(i, simulation.engine());
    if (progress && i % 100 == 0) progress(static_cast<double>(i) / static_cast<double>(last));
  }
  return film;
}

}  // namespace handsim::simulation
