// The `objects` and the `ground` of a scene. An object file holds the shapes, mass, surface and source of an
// object, without a pose. An object of a scene may refer to one; its own keys override those of its `file`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/model/mass_properties.h"
#include "handsim/model/model.h"
#include "handsim/scene/read/task_block.h"

namespace handsim::scene {

/// A rigid object. Its shapes are given in frame O; its body's frame has O's axes, at the mass centre.
struct ObjectSpec {
  std::string name;
  std::vector<model::Shape> shapes;      ///< kind, size and pose X_OS, nothing else; at least one
  model::MassProperties body;            ///< in O; static: none
  bool is_static = false;                ///< does not move
  bool may_overlap = false;              ///< may overlap a hand at the start
  Pose pose;                             ///< X_WO at the start
  Vec3 velocity = Vec3::Zero();          ///< of the centre of mass [m/s]
  Vec3 angular_velocity = Vec3::Zero();  ///< world axes [rad/s]
  model::Material material;
  std::optional<std::string> source;  ///< where its data come from
  Place place;                        ///< in the file, for problems found later

  Pose body_frame() const { return {body.centre, Quat::Identity()}; }  ///< X_OB
};

struct GroundSpec {
  double height = 0;  ///< z of the plane [m]
  model::Material material;
};

/// The `objects` list; absent: none.
/// @param tasks the objects that they place have no pose of their own.
/// @param beside_hand true if the scene has a hand: sizes that are unusual beside one give a warning.
std::vector<ObjectSpec> read_objects(MapReader& reader, const std::vector<model::Material>& materials,
                                     const Tasks& tasks, bool beside_hand);

std::optional<GroundSpec> read_ground(MapReader& reader, const std::vector<model::Material>& materials);

/// Reads an object file on its own, as an object at the world's origin.
ObjectSpec read_object_file(const YamlNode& root, Diagnostics& diagnostics);

/// Reads kind and size of a solid; `kind_key` is the key of the kind. Sets the pose to that of its centre: a
/// mesh's centroid differs from the origin of its file.
/// @returns false, with a problem, if the kind is unknown.
bool read_solid(MapReader& reader, std::string_view kind_key, model::Shape& shape);

/// A color "#RRGGBB", sRGB; without quotes it is a comment of YAML.
std::optional<std::uint32_t> read_colour(MapReader& reader, const char* key = "color");

/// Reads a surface: `material`, the name of one of the scene's, or its properties.
model::Material read_surface(MapReader& reader, std::string name,
                             const std::vector<model::Material>& materials);

}  // namespace handsim::scene
