// The `climbs:` of a scene: a hand is to hang on a hold until the grip fails, in one block. The palm hangs on
// a rail along the load's direction. A stiff servo lowers it to the hold and keeps it there while the fingers
// close; then it is freed and pulled by a load that grows. All geometry is given for a right hand; a left
// hand gets its mirror image in the world's y-z plane.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/hand/grip_strength.h"
#include "handsim/scene/task/grasp.h"

namespace handsim::scene {

/// A load at the wrist that grows with time.
struct LoadSpec {
  Vec3 direction = {0, 0, -1};  ///< world, unit
  double rate = 50;             ///< [N/s]
  double most = 1000;           ///< the climb ends there [N]
};

struct ClimbSpec {
  std::string hand;  ///< name; empty: the scene's only hand
  std::string hold;  ///< name of a static object
  Pose wrist;        ///< X_WH at the hold, right hand
  /// Of the hand that the wrist's position is for [m]: other hands stand off the hold's origin in proportion.
  std::optional<double> hand_length;
  std::string open;                 ///< pose until the hand closes
  std::vector<std::string> closed;  ///< poses that close it, one after the other
  double approach_height = 0.03;    ///< where the wrist comes from, against the load [m]
  double approach_time = 0.5;       ///< [s]
  double close_time = 0.6;          ///< of each closing pose [s]
  double settle_time = 0.3;         ///< closed, before the load [s]
  LoadSpec load;
  hand::GripTable strength;  ///< norms that the person's grip is held against
  Place place;
};

/// A climb as it is run.
struct ClimbPlan {
  std::size_t hand = 0;            ///< in SceneSpec::hands
  std::string hold;                ///< name of the object
  std::vector<GraspPhase> phases;  ///< approach, close, load
  double height = 0;               ///< of the wrist above its place at the start [m]
  LoadSpec load;                   ///< of this side
  hand::GripStrength strength;     ///< of the person

  const GraspPhase& approach() const { return phases[0]; }
  const GraspPhase& loading() const { return phases[2]; }
};

/// The `climbs` list; absent: none. Names are looked up by place_climbs().
std::vector<ClimbSpec> read_climbs(MapReader& reader);

/// Turns the climbs of a scene whose hands and objects are read into places of hands and holds; fills
/// SceneSpec::climb_plans. Problems go into the diagnostics.
void place_climbs(SceneSpec& scene, Diagnostics& diagnostics);

/// Turns them into programs of the scene's control.
void add_climb_programs(SceneSpec& scene, Diagnostics& diagnostics);

/// End of the last climb that carries its largest load [s].
double climbs_end(const SceneSpec& scene);

}  // namespace handsim::scene
