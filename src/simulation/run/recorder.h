// Records a run: rows of its tables and moments for its pictures.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "handsim/output/table/motion_table.h"
#include "handsim/simulation/run/extra_tables.h"
#include "handsim/simulation/run/output_size.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"

namespace handsim::simulation {

class Recorder {
 public:
  /// The simulation must outlive the recorder.
  Recorder(const Simulation& simulation, const RunOptions& options);

  /// Records the state after a step; the first call records the start, or the state of the snapshot.
  void record(long step);
  /// Completes the tables: trajectory.csv and .mot, control.sto, contacts.csv, those of extra_tables.h.
  void finish();
  /// Moments of the pictures, with their captions.
  const std::vector<Moment>& moments() const { return moments_; }
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
  void show(Moment moment, std::string caption);
  void finish_climb();
  void add_rows();
  void measure();
  void add_monitor_row();
  void add_muscle_row();

  const Simulation& simulation_;
  double step_;
  output::AtomicFile trajectory_;
  std::optional<output::MotionTableWriter> motion_;  ///< joint angles
  std::optional<output::MotionTableWriter> control_, muscles_;
  std::optional<output::AtomicFile> contacts_;
  std::optional<output::AtomicFile> monitor_;
  /// Largest residuals of joints [m/s], [rad/s] and contacts [m/s] since the last row; absent: not measured.
  std::array<std::optional<double>, 3> residuals_;
  std::optional<ExtraTables> extra_;
  long every_;  ///< number of steps between two rows
  std::vector<Planned> planned_;
  std::size_t taken_ = 0;
  /// Of a climb: moments under load; after its failure, some of them are chosen for pictures.
  const ClimbWatch* climb_ = nullptr;
  std::vector<std::pair<double, Moment>> loaded_;  ///< by load [N]
  std::vector<Moment> moments_;
  std::optional<Film> film_;
};

}  // namespace handsim::simulation
