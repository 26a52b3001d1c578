// Reads the limits of a run's success. Refuses limits on figures that a scene lacks: they would always pass.
#pragma once

#include <optional>

#include "handsim/control/plan.h"
#include "handsim/core/yaml_reader.h"

namespace handsim::scene {

struct SceneSpec;

/// Limits of the tracking figures; figures without a limit are only reported.
struct TrackingCriteria {
  std::optional<double> rms_error;      ///< of the worst joint over the run [rad]
  std::optional<double> largest_error;  ///< of any joint at any step [rad]
  std::optional<double> steady_error;   ///< largest at the end of any hold [rad]
  std::optional<double> overshoot;      ///< largest, as a share of the movement
  std::optional<double> settling_time;  ///< longest, to 2 % of a movement [s]
};

/// Limits that decide whether a run has succeeded; figures without a limit are only reported.
struct Criteria {
  std::optional<double> joint_gap;       ///< largest gap of any joint at any step [m]
  std::optional<double> stop_overshoot;  ///< largest overshoot of a stop beyond impact rate times step [rad]
  std::optional<double> stop_rest;       ///< largest overshoot of a stop at the end [rad]
  std::optional<int> lcp_failures;       ///< of the LCP solver in the run
  std::optional<double> penetration;     ///< largest depth of any contact at any step [m]
  std::optional<int> tunnelling;         ///< pairs of shapes that passed through or deep into each other
  std::optional<double> grasp_slip;      ///< mean drift of a grasped object in the palm during the hold [m/s]
  std::optional<double> climb_load;      ///< least load that a climb must carry [N]
  TrackingCriteria tracking;             ///< of a controlled scene
};

Criteria read_criteria(MapReader reader);

/// Problems: limits on figures that the scene does not measure. Call after all other blocks are read.
void check_criteria(MapReader reader, const SceneSpec& scene);

/// Problems: limits on holds and movements that the hands' programs do not have. @param root of the scene.
void check_tracked(const YamlNode& root, const control::Plan& plan, Diagnostics& diagnostics);

}  // namespace handsim::scene
