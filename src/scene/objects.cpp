// The `objects` and the `ground` of a scene.
#include <cmath>

#include <fmt/format.h>

#include "handsim/hand/material.h"
#include "handsim/scene/readers.h"

namespace handsim::scene {

namespace {

using model::ShapeKind;

const Quantity kSize = {Dimension::length, 1e-4, 100};
const Quantity kMass = {Dimension::mass, 1e-6, 1e4};
constexpr std::size_t kMostObjects = 1000;

double solid_volume(const model::Shape& shape) {
  switch (shape.kind) {
    case ShapeKind::box:
      return shape.edges.prod();
    case ShapeKind::sphere:
      return 4.0 / 3.0 * M_PI * std::pow(shape.radius, 3);
    case ShapeKind::cylinder:
      return M_PI * shape.radius * shape.radius * shape.length;
    case ShapeKind::capsule:
      return hand::capsule_inertia(shape.radius, shape.length).volume;
    case ShapeKind::plane:
      return 0;
  }
  return 0;
}

std::string read_name(MapReader& reader, const std::vector<ObjectSpec>& before) {
  const std::string name = reader.name("name");
  const char* need = "a name of its own for each object, other than world and ground";
  if (name == "world" || name == "ground") reader.problem("name", name, need);
  for (const ObjectSpec& other : before)
    if (!name.empty() && other.name == name) reader.problem("name", name + " a second time", need);
  return name;
}

double read_mass(MapReader& reader, const model::Shape& shape) {
  const auto mass = reader.maybe_number("mass", kMass);
  const auto density = reader.maybe_number("density", {Dimension::density, 1, 1e5});
  if (reader.has("mass") == reader.has("density"))
    reader.problem("mass", reader.has("mass") ? "a mass and a density" : "neither a mass nor a density",
                   "one of the two");
  const double result = mass.value_or(density.value_or(1000) * solid_volume(shape));
  if (reader.sound() && !kMass.allows(result))
    reader.problem("density", fmt::format("a mass of {:.3g} kg by it", result), kMass.need());
  return result;
}

ObjectSpec read_object(MapReader reader, const std::vector<ObjectSpec>& before,
                       const std::vector<model::Material>& materials, const std::vector<GraspSpec>& grasps) {
  ObjectSpec object;
  object.place = reader.node().place();
  object.name = read_name(reader, before);
  const bool shaped = read_solid(reader, "shape", object.shape);
  object.is_static = reader.flag("static", false);
  if (!object.is_static) {
    object.mass = read_mass(reader, object.shape);
    object.velocity = reader.vector("velocity", kVelocity, Vec3::Zero());
    object.angular_velocity = reader.vector("angular_velocity", kAngularVelocity, Vec3::Zero());
  }
  if (!places_object(grasps, object.name))
    object.pose = read_pose(reader);
  else if (reader.child("position") || reader.child("rotation"))
    reader.problem("position", "a place beside the grasp that gives it", "one of the two");
  object.material = read_surface(reader, object.name, materials);
  // Sizes of an unknown shape can be neither right nor wrong.
  if (!shaped)
    for (const char* key : {"edges", "radius", "length"}) reader.child(key);
  reader.finish();
  return object;
}

}  // namespace

model::Material read_surface(MapReader& reader, std::string name,
                             const std::vector<model::Material>& materials) {
  if (!reader.has("material")) return hand::read_material(reader, std::move(name));
  for (const char* key : {"friction", "restitution", "restitution_speed", "rolling_friction",
                          "spinning_friction", "stiffness", "damping"})
    if (reader.child(key))
      reader.problem(key, "a property beside the material that has it", "one of the two");
  return named_material(reader, "material", materials).value_or(model::Material{});
}

bool read_solid(MapReader& reader, std::string_view kind_key, model::Shape& shape) {
  const std::size_t before = reader.diagnostics().problems.size();
  shape.kind = reader.choice<ShapeKind>(kind_key, {{"box", ShapeKind::box},
                                                   {"sphere", ShapeKind::sphere},
                                                   {"cylinder", ShapeKind::cylinder},
                                                   {"capsule", ShapeKind::capsule}});
  if (reader.diagnostics().problems.size() > before) return false;
  if (shape.kind == ShapeKind::box)
    shape.edges = reader.vector("edges", kSize);
  else
    shape.radius = reader.number("radius", kSize);
  if (shape.kind == ShapeKind::cylinder || shape.kind == ShapeKind::capsule)
    shape.length = reader.number("length", kSize);
  return true;
}

std::vector<ObjectSpec> read_objects(MapReader& reader, const std::vector<model::Material>& materials,
                                     const std::vector<GraspSpec>& grasps) {
  std::vector<ObjectSpec> objects;
  YamlNode* list = reader.list("objects", false);
  if (!list) return objects;
  if (list->items.size() > kMostObjects) {
    reader.problem("objects", list->described(), fmt::format("at most {} objects", kMostObjects));
    return objects;
  }
  for (std::size_t i = 0; i < list->items.size(); ++i)
    objects.push_back(read_object(MapReader(list->items[i], item_path("objects", i), reader.diagnostics()),
                                  objects, materials, grasps));
  return objects;
}

std::optional<GroundSpec> read_ground(MapReader& reader, const std::vector<model::Material>& materials) {
  if (!reader.has("ground")) return std::nullopt;
  MapReader ground = reader.map("ground");
  const GroundSpec spec{ground.number("height", kCoordinate, 0.0), read_surface(ground, "ground", materials)};
  ground.finish();
  return spec;
}

}  // namespace handsim::scene
