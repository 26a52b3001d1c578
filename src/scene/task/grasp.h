// The `grasps:` of a scene: a hand is to grasp an object, in one block. It becomes the wrist's motion with
// its shakes, the program of the hand's poses, the object's place and support, and a plan of phases that
// figures are taken over. All geometry is given for a right hand; a left hand gets its mirror image in the
// world's y-z plane.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/model/model.h"
#include "handsim/model/motion.h"

namespace handsim::scene {

struct SceneSpec;
struct HandEntry;

/// To and fro in six directions, +-x, +-y, +-z of the world.
struct ShakeLevel {
  double acceleration = 9.81;  ///< largest [m/s^2]
  double frequency = 2;        ///< [Hz]
};

/// A still cylinder under the object.
struct PostSpec {
  double radius = 0.01;  ///< [m]
  double height = 0.1;   ///< [m]
  model::Material material;
};

struct GraspSpec {
  std::string hand;                 ///< name; empty: the scene's only hand
  std::string object;               ///< name
  Pose wrist;                       ///< X_WH at the grasp, right hand
  Pose at;                          ///< X_HO: where a right hand finds the object
  std::optional<PostSpec> post;     ///< absent: the object rests on the ground or on objects of the scene
  std::string open;                 ///< pose until the hand closes
  std::vector<std::string> closed;  ///< poses that close it, one after the other
  Vec3 from = Vec3::Zero();         ///< where the wrist comes from, in the hand frame at the grasp [m]
  double approach_time = 0.5;       ///< [s]
  double close_time = 0.6;          ///< of each closing pose [s]
  double settle_time = 0.3;         ///< closed, before the lift [s]
  double lift_height = 0.2;         ///< [m]
  double lift_time = 0.6;           ///< [s]
  double hold = 5;                  ///< [s]
  std::vector<ShakeLevel> shake;    ///< one after the other, six directions each
  int shake_cycles = 2;             ///< in each direction
  double rest = 0.5;                ///< still, after the shake [s]
  Place place;
};

/// A part of a grasp.
struct GraspPhase {
  std::string name;  ///< approach, close, lift, hold, shake_1, ..., rest
  double start = 0;  ///< [s]
  double end = 0;    ///< [s]
};

/// A grasp as it is run: what figures are taken over.
struct GraspPlan {
  std::size_t hand = 0;  ///< in SceneSpec::hands
  std::string object;    ///< name of a body
  std::vector<GraspPhase> phases;

  double end() const { return phases.back().end; }
  /// Null where the grasp has no such phase.
  const GraspPhase* phase(std::string_view name) const;
};

/// The `grasps` list; absent: none. Names are looked up by place_grasps().
std::vector<GraspSpec> read_grasps(MapReader& reader);

/// True where a grasp gives an object its place.
bool places_object(const std::vector<GraspSpec>& grasps, const std::string& object);

/// Turns the grasps of a scene whose hands and objects are read into wrist motions, places and supports;
/// fills SceneSpec::grasp_plans. Problems go into the diagnostics.
void place_grasps(SceneSpec& scene, Diagnostics& diagnostics);

/// Turns them into programs of the scene's control, for hands that have none; starts these hands in their
/// open pose. Problems: poses that the pose file has not, a scene without control.
void add_grasp_programs(SceneSpec& scene, Diagnostics& diagnostics);

/// End of the last grasp [s].
double grasps_end(const SceneSpec& scene);

}  // namespace handsim::scene
