// What grasps and climbs have in common: they name a hand and poses that open and close it, and write that
// hand's program.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"

namespace handsim::scene {

struct SceneSpec;

/// Index of the hand of a name in the scene; of its only hand where the name is empty. Problem: none.
std::optional<std::size_t> find_hand(const SceneSpec& scene, const std::string& name, const Place& place,
                                     const std::string& key, Diagnostics& diagnostics);

/// One pose or a list of them, at least one.
std::vector<std::string> read_pose_names(MapReader& reader, const char* key);

/// A hand opens, and closes later.
struct HandProgram {
  std::size_t hand = 0;             ///< in SceneSpec::hands
  std::string open;                 ///< pose from the start
  std::vector<std::string> closed;  ///< poses one after the other
  double close = 0;                 ///< when the first begins [s]
  double move = 0;                  ///< time for each [s]
  std::string title;
  Place place;
  std::string path;  ///< of the entry that asks for it
  std::string what;  ///< `a grasp`
};

/// Puts it into the scene's control, and the hand at the start into its open pose. Problems: a scene without
/// control, poses that its file has not, a hand with a program of its own.
void add_hand_program(SceneSpec& scene, const HandProgram& program, Diagnostics& diagnostics);

}  // namespace handsim::scene
