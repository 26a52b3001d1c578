// Records a run: rows of its tables and moments for its pictures.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/run/run_tables.h"

namespace handsim::simulation {

class Recorder {
 public:
  /// The simulation must outlive the recorder.
  Recorder(const Simulation& simulation, const RunOptions& options);

  /// Records the state after a step; the first call records the start, or the state of the snapshot.
  void record(long step);
  /// Completes the tables.
  void finish();
  /// Moments of the pictures, with their captions.
  const std::vector<PictureState>& moments() const { return moments_; }
  /// Null if there is no video.
  const Film* film() const { return film_ ? &*film_ : nullptr; }

 private:
  /// A step after which a picture is taken.
  struct Planned {
    long step = 0;
    std::string caption;  ///< empty: the time
    Vec3 shaken = Vec3::Zero();
  };
  void plan_pictures(const RunOptions& options);
  void plan_frames(int frames);
  void plan_poses();
  void plan_phases(const std::vector<scene::TaskPhase>& phases);
  Planned extreme_of(const scene::TaskPhase& phase, std::size_t level) const;
  void record_climb();
  void show(PictureState moment, std::string caption);
  void finish_climb();

  const Simulation& simulation_;
  double step_;
  RunTables tables_;
  std::vector<Planned> planned_;
  std::size_t taken_ = 0;
  /// Null without a climb. Its moments under load are kept; finish() shows some of them in pictures.
  const ClimbWatch* climb_ = nullptr;
  std::vector<std::pair<double, PictureState>> loaded_;  ///< by load [N]
  std::vector<PictureState> moments_;
  std::optional<Film> film_;
};

}  // namespace handsim::simulation
