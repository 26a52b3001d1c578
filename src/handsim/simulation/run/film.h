// A video of a run: its moments at equal times of the video, drawn and encoded after the run.
#pragma once

#include <filesystem>
#include <vector>

#include "handsim/output/child.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/simulation/run/pictures.h"

namespace handsim::simulation {

struct VideoSpec {
  std::filesystem::path file;  ///< .mp4 or .gif
  double fps = 30;             ///< frames in a second of video
  double speed = 1;            ///< simulated seconds in a second of video
};

/// Collects the moments of a video while a simulation runs.
class Film {
 public:
  /// @param first, last steps shown. @param step [s]. @throws Error (input) as check_video; too many frames
  Film(const scene::Scene& scene, const VideoSpec& spec, long first, long last);

  /// To be called after every step from `first` on; a step that no frame shows costs nothing.
  void record(long step, const engine::Engine& engine);
  bool empty() const { return moments_.empty(); }
  /// Draws and writes the video. @throws Error (output) if it cannot be written.
  void write(const scene::PictureSpec& pictures, const Drawing& drawing,
             const output::Progress& progress) const;

 private:
  const model::Model& model_;
  double step_;
  VideoSpec spec_;
  long first_, last_;
  long frames_ = 0;  ///< planned so far
  std::vector<PictureState> moments_;
  std::vector<int> repeats_;  ///< frames that show each moment: several in slow motion

  long step_of(long frame) const;
};

/// A video of a scene from its start to a time [s], without other files. @throws Error (physics): it diverges
Film film_until(const scene::Scene& scene, const VideoSpec& spec, double time,
                const output::Progress& progress);

}  // namespace handsim::simulation
