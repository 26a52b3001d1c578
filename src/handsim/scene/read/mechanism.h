// The `bodies` and `joints` of a scene: mechanisms such as a slider-crank, given in the world at their start.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/model/model.h"

namespace handsim::scene {

/// A rigid body; its frame is at the centre of mass along the principal axes of inertia.
struct BodySpec {
  std::string name;
  double mass = 0;                       ///< [kg]
  Vec3 inertia = Vec3::Zero();           ///< principal moments about the centre of mass [kg m^2]
  Pose pose;                             ///< X_WB at the start
  Vec3 velocity = Vec3::Zero();          ///< of the centre of mass, world axes [m/s]
  Vec3 angular_velocity = Vec3::Zero();  ///< world axes [rad/s]
  std::optional<model::Shape> shape;     ///< kind, size and pose in the body
  bool collides = false;                 ///< the shape touches objects and ground; otherwise it is only drawn
  model::Material material;
  Place place;
};

/// A joint; its coordinates are zero at the start.
struct MechanismJointSpec {
  std::string name;
  model::JointKind kind = model::JointKind::hinge;
  std::string parent;                  ///< a body's name, or `world`
  std::string child;                   ///< a body's name
  Vec3 position = Vec3::Zero();        ///< of the joint centre in the world at the start [m]
  std::vector<model::JointAxis> axes;  ///< in world axes at the start
  Place place;
};

struct MechanismSpec {
  std::vector<BodySpec> bodies;
  std::vector<MechanismJointSpec> joints;
};

/// Reads `bodies` and `joints` of a scene; both may be absent. @param taken names that no body may have.
MechanismSpec read_mechanism(MapReader& scene, std::vector<std::string> taken,
                             const std::vector<model::Material>& materials);

}  // namespace handsim::scene
