// Forces of a hand that keep an object at rest: fingers press as asked, palm and other fingers balance them.
#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "handsim/core/pose.h"
#include "handsim/core/yaml_reader.h"
#include "handsim/hand/grip_strength.h"
#include "handsim/model/model.h"

namespace handsim::scene {

/// A `grip` block: fingers close until they touch and press with a force. Without it the hand follows poses.
struct GripSpec {
  /// Sum of the normal forces of fingers [N], of a person with the controller's grip strength; for others in
  /// proportion to theirs. Fingers that move and are not named balance these.
  std::map<model::Part, double> forces;
  hand::GripTable strength;  ///< norms of grip strength
  double squeeze = 0.3;      ///< time from touching to pressing [s]
  /// Coefficient that the hand reckons with; absent: that of the surfaces that touch.
  std::optional<double> friction;
  double reserve = 1;   ///< forces are raised to what holds so many times the weight and shake
  double search = 0.2;  ///< the object may lie so far from its named place in the hand [hand lengths]
};

GripSpec read_grip(MapReader reader);

/// `thumb`, `index`, ...; all other parts are `palm`.
std::string_view part_name(model::Part part);

struct GripContact {
  Vec3 point = Vec3::Zero();   ///< [m]
  Vec3 normal = Vec3::Zero();  ///< unit, into the object
  double friction = 0;         ///< coefficient that may be used
  std::size_t presser = 0;     ///< the finger, in GripTask::asked
  double limit = friction;     ///< coefficient at which it slides
  double spinning = 0;         ///< largest moment about the normal over the normal force [m]
  /// Points of a rigid part share its normal force as their pads' depths say: each its share of the sum of
  /// the contacts from `first` to `last`, which are those of the part.
  double share = 1;
  std::optional<std::pair<std::size_t, std::size_t>> part = std::nullopt;  ///< first, last; absent: it alone
};

struct GripTask {
  std::vector<GripContact> contacts;
  std::vector<std::optional<double>> asked;  ///< sum of the normal forces of each presser [N]; absent: any
  Vec3 load = Vec3::Zero();                  ///< other force on the object, at `centre` [N]
  Vec3 centre = Vec3::Zero();                ///< [m]
  double size = 0.05;                        ///< of the object: a moment counts as a force at this arm [m]
};

struct GripForces {
  std::vector<Vec3> forces;  ///< on the object, of each contact [N]
  /// Force that is left over, with the moment over the size, as a share of the sum of normal forces.
  double unbalanced = 0;
};

/// Least squares with forces within friction cones (8 edges; of a part of several points all along one edge,
/// or round their middle): equilibrium, then asked, then small forces.
GripForces balance(const GripTask& task);

/// The share that the worst of several loads at the centre takes of what the contacts hold besides `forces`.
/// Each contact holds an ellipsoid of forces: along the normal as much as it presses, along the surface the
/// friction that is left. Each carries at most this share of its own where the sum of squares is least; so
/// they hold up to the square root of their number more. @param loads [N]
double load_share(const GripTask& task, const GripForces& forces, const std::vector<Vec3>& loads);

}  // namespace handsim::scene
