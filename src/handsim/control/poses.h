// The content of a pose file: named poses of a hand by joint, and programs, timed sequences. Angles are of
// the axes (flexion positive, abduction away from the middle finger): one pose serves both sides.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "handsim/control/hand_axes.h"
#include "handsim/control/trajectory.h"
#include "handsim/core/yaml_reader.h"

namespace handsim::control {

/// Angles of one joint in a pose.
struct PoseAngles {
  std::vector<double> angles;  ///< by axis [rad]; further axes of the joint are at 0
  Place place;
};

struct PoseSpec {
  std::map<std::string, PoseAngles> joints;  ///< joints not named are at 0
  bool pressing = false;  ///< targets of springs that press: may lie beyond the joints' ranges
  Place place;
};

/// One movement of a program.
struct ProgramKey {
  double time = 0;  ///< start of the movement [s]
  double move = 0;  ///< its duration [s]; the pose is then held until the next key
  std::string pose;
  Place place;
};

struct ProgramSpec {
  model::Interpolation interpolation = model::Interpolation::minimum_jerk;
  std::vector<ProgramKey> keys;                          ///< for every hand; empty if `hands` has them
  std::map<std::string, std::vector<ProgramKey>> hands;  ///< by the hand's name, e.g. `right`
  Place place;

  /// Keys for a hand; null if the program does not name it.
  const std::vector<ProgramKey>* keys_for(const std::string& hand) const;
};

struct PoseFile {
  std::map<std::string, PoseSpec> poses;
  std::map<std::string, ProgramSpec> programs;
};

/// Reads a pose file. Defects: also unknown poses, times that do not increase, movements that overlap.
PoseFile read_pose_file(const YamlNode& node, const std::string& path, Diagnostics& diagnostics);

/// Angles of a pose for a hand's axes [rad]. Problems: joints that the hand model does not have, more angles
/// than axes, an angle outside its joint's range. Angles of absent joints are ignored, with a warning.
std::vector<double> pose_angles(const std::string& name, const PoseSpec& pose, const HandAxes& hand,
                                Diagnostics& diagnostics);

/// Trajectory of a hand through a program's keys. @param start angles before the first key, size hand.axes
Trajectory program_trajectory(const ProgramSpec& program, const std::vector<ProgramKey>& keys,
                              const PoseFile& file, const HandAxes& hand, std::span<const double> start,
                              Diagnostics& diagnostics);

}  // namespace handsim::control
