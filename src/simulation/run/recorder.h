// What a run leaves behind while it goes: rows of its tables and moments for its pictures.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/output/table/contact_table.h"
#include "handsim/output/table/motion_table.h"
#include "handsim/output/table/trajectory.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"

namespace handsim::simulation {

class Recorder {
 public:
  /// The simulation must outlive the recorder.
  Recorder(const Simulation& simulation, const RunOptions& options);

  /// Records the state after a step; the first is the one that the simulation starts or goes on from.
  void record(long step);
  /// Gives the tables their names: trajectory.csv, trajectory.mot, control.sto, contacts.csv.
  void finish();
  const std::vector<Snapshot>& snapshots() const { return snapshots_; }
  /// Of the pictures, one for each snapshot.
  const std::vector<std::string>& captions() const { return captions_; }

 private:
  /// A step after which a picture is taken.
  struct Moment {
    long step = 0;
    std::string caption;  ///< empty: the time
  };
  void plan_frames(int frames);
  void plan_poses();
  void plan_phases(const scene::GraspPlan& plan);
  void plan_climb(const scene::ClimbPlan& plan);
  void record_climb();
  void finish_climb();
  void add_rows();

  const Simulation& simulation_;
  double step_;
  output::TrajectoryWriter trajectory_;
  std::optional<output::MotionTableWriter> motion_;  ///< joint angles
  std::optional<output::MotionTableWriter>
      control_;  ///< target and angle [deg], torque [N m] of each driven axis
  std::optional<output::ContactTableWriter> contacts_;
  long every_;
  std::vector<Moment> moments_;
  std::size_t taken_ = 0;
  /// Of a climb: moments under load, among which those to show are chosen once it has failed.
  const ClimbWatch* climb_ = nullptr;
  std::vector<std::pair<double, Snapshot>> loaded_;  ///< by load [N]
  std::vector<Snapshot> snapshots_;
  std::vector<std::string> captions_;
};

}  // namespace handsim::simulation
