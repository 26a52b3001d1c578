// The `objects` and the `ground` of a scene. An object file holds the shapes, mass, surface and source of a
// thing, without a place in the world: a scene's object names one under `file`, and its own keys go before
// the file's.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/model/mass_properties.h"
#include "handsim/model/model.h"
#include "handsim/scene/read/task_spec.h"

namespace handsim::scene {

/// A thing of one shape, or a compound of several that move as one. Its frame O is the one in which its
/// shapes are given; its body's frame has O's axes and is at the centre of mass.
struct ObjectSpec {
  std::string name;
  std::vector<model::Shape> shapes;      ///< kind, size and pose X_OS, nothing else; at least one
  model::MassProperties body;            ///< in O; static: none
  bool is_static = false;                ///< does not move
  bool may_overlap = false;              ///< starts inside a hand if it does
  Pose pose;                             ///< X_WO at the start
  Vec3 velocity = Vec3::Zero();          ///< of the centre of mass [m/s]
  Vec3 angular_velocity = Vec3::Zero();  ///< world axes [rad/s]
  model::Material material;
  std::optional<std::string> source;  ///< where its figures come from
  Place place;                        ///< in the file, for problems found later

  Pose body_frame() const { return {body.centre, Quat::Identity()}; }  ///< X_OB
};

struct GroundSpec {
  double height = 0;  ///< z of the plane [m]
  model::Material material;
};

/// The `objects` list; absent: none.
/// @param tasks give places to objects that then have none of their own.
/// @param beside_hand the scene has a hand: sizes that are unlikely beside one are warned of.
std::vector<ObjectSpec> read_objects(MapReader& reader, const std::vector<model::Material>& materials,
                                     const Tasks& tasks, bool beside_hand);

std::optional<GroundSpec> read_ground(MapReader& reader, const std::vector<model::Material>& materials);

/// Reads an object file as it stands, as an object of its own at the world's origin.
ObjectSpec read_object_file(YamlNode& root, Diagnostics& diagnostics);

/// Kind and size of a solid: `kind_key` names the kind. The pose is that of its centre: a mesh's lies off the
/// origin of its file. False, with a problem, where the kind, and so which sizes it has,
/// is not known.
bool read_solid(MapReader& reader, std::string_view kind_key, model::Shape& shape);

/// The surface of a thing: `material`, one of the scene's by name, or its properties.
model::Material read_surface(MapReader& reader, std::string name,
                             const std::vector<model::Material>& materials);

}  // namespace handsim::scene
