// What the page of a run shows, as JSON: the scene's shapes, poses, contacts and curves. Arrays of numbers
// are base64 (output/report/binary.h), thinned to what a screen can show.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "handsim/engine/engine.h"
#include "handsim/model/state.h"
#include "handsim/output/table/table_files.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

using Json = nlohmann::ordered_json;

/// A run that is read back.
struct RunFiles {
  std::filesystem::path folder;
  std::string resolved;  ///< text of resolved.yaml
  scene::Scene scene;    ///< of it
  Json summary;
  output::NumberTable trajectory;
  std::vector<double> times;  ///< of the trajectory's rows [s]

  /// The state of a row: time and poses of bodies.
  model::State state(std::size_t row) const;
  /// Column of the first body's x.
  std::size_t first_pose() const;
};

/// @throws Error (input) if the folder has no run of its scene.
RunFiles read_run(const std::filesystem::path& folder);

/// Poses are kept within this distance of the recorded ones on any point of a body [m].
inline constexpr double kPoseTolerance = 1e-4;
/// Bytes of numbers at most for poses, contacts and curves, before base64.
inline constexpr double kPoseBytes = 0.9e6, kContactBytes = 0.45e6, kCurveBytes = 0.4e6;

/// Contact points of the rows of a trajectory.
struct RecordedContacts {
  std::vector<engine::Contact> contacts;
  std::vector<std::size_t> first;  ///< of each row, and the end

  std::span<const engine::Contact> of(std::size_t row) const {
    return std::span(contacts).subspan(first[row], first[row + 1] - first[row]);
  }
};
/// contacts.csv; nothing if the run recorded none.
std::optional<RecordedContacts> read_contacts(const RunFiles& run);

/// Bodies, shapes in the colours of the pictures, joint axes, fingertips, camera and floor.
Json scene_json(const RunFiles& run, const std::optional<RecordedContacts>& contacts);
Json poses_json(const RunFiles& run);

/// Normal forces of a hand's parts over time [N].
struct PartCurve {
  std::string name;
  std::vector<double> values;  ///< at RunFiles::times
};
/// Contact points and forces; null if the run recorded none.
Json contacts_json(const RunFiles& run, const std::optional<RecordedContacts>& contacts,
                   std::vector<PartCurve>& sums);
/// @param zero names of the groups of curves that are left out because all their values are 0.
Json curves_json(const RunFiles& run, const std::vector<PartCurve>& sums, Json& zero);
/// Phases of tasks, and events: times of figures, verdicts and faults.
Json marks_json(const RunFiles& run);

}  // namespace handsim::simulation
