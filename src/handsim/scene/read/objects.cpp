#include "handsim/scene/read/objects.h"

#include <algorithm>
#include <charconv>
#include <filesystem>

#include <fmt/format.h>

#include "handsim/model/shape_extent.h"
#include "handsim/model/surface_reader.h"
#include "handsim/scene/read/blocks.h"
#include "handsim/scene/read/contacts_block.h"
#include "handsim/scene/read/mesh_file.h"
#include "handsim/scene/read/scene_file.h"

namespace handsim::scene {

namespace {

using model::ShapeKind;

const Quantity kSize = {Dimension::length, 1e-4, 100};
const Quantity kMass = {Dimension::mass, 1e-6, 1e4};
constexpr std::size_t kMostObjects = 1000;
constexpr std::size_t kMostParts = 200;

/// Keys that state the same property in different ways: one of them in an entry replaces all of its file.
using Keys = std::vector<std::string_view>;
const Keys kMassKeys = {"mass", "density"};
const Keys kFormKeys = {"shape", "parts"};
const Keys kSizeKeys = {"shape", "parts", "edges", "radius", "length", "mesh", "scale", "inertia"};
const Keys kPropertyKeys = field_keys<model::Material>();

bool has_any(const YamlNode& map, const Keys& keys) {
  return std::ranges::any_of(keys, [&](std::string_view key) { return map.find(key) != nullptr; });
}

bool among(const std::string& key, const Keys& keys) { return std::ranges::find(keys, key) != keys.end(); }

/// True if the entry's own keys replace the file's `key`.
bool overridden(const YamlNode& entry, const std::string& key) {
  return entry.find(key) != nullptr || (among(key, kMassKeys) && has_any(entry, kMassKeys)) ||
         (among(key, kSizeKeys) && has_any(entry, kFormKeys)) ||
         (among(key, kPropertyKeys) && entry.find("material") != nullptr) ||
         (key == "material" && has_any(entry, kPropertyKeys));
}

/// Reads `mesh`.
void read_mesh(MapReader& reader, model::Shape& shape) {
  const double scale = reader.number("scale", {Dimension::none, 1e-6, 1e6}, 1.0);
  reader.text("mesh");
  if (!reader.has("mesh") || !reader.sound()) return;
  const std::filesystem::path path = reader.file_path("mesh", *reader.child("mesh"));
  try {
    LoadedMesh loaded = load_convex_mesh(path, scale);
    shape.mesh = std::move(loaded.mesh);
    shape.pose.p = loaded.centroid;
    if (loaded.open_edges > 0)
      reader.warning("mesh", fmt::format("{} edges of {} are not shared by two faces: its convex hull is "
                                         "used",
                                         loaded.open_edges, path.filename().string()));
  } catch (const Error& error) {
    // Problems within the mesh's file have a place there.
    for (const Problem& problem : error.problems())
      if (problem.place)
        reader.diagnostics().problems.push_back(
            {problem.place, reader.path_of("mesh"), problem.got, problem.need});
      else
        reader.problem("mesh", problem.got, problem.need);
  }
}

std::string read_name(MapReader& reader, const std::vector<ObjectSpec>& before) {
  std::string name = reader.name("name");
  const char* need = "a unique name for each object, other than world and ground";
  if (name == "world" || name == "ground") reader.problem("name", name, need);
  for (const ObjectSpec& other : before)
    if (!name.empty() && other.name == name) reader.problem("name", name + " a second time", need);
  return name;
}

bool places_object(const Tasks& tasks, const std::string& object) {
  return std::ranges::any_of(
      tasks, [&](const auto& task) { return task->kind->moves_object && task->object == object; });
}

/// The mass from `mass`, or from `density` and this volume.
double read_mass(MapReader& reader, double volume) {
  const auto mass = reader.maybe_number("mass", kMass);
  const auto density = reader.maybe_number("density", {Dimension::density, 1, 1e5});
  if (reader.has("mass") == reader.has("density"))
    reader.problem("mass", reader.has("mass") ? "a mass and a density" : "neither a mass nor a density",
                   "one of the two");
  const double result = mass.value_or(density.value_or(1000) * volume);
  if (reader.sound() && !kMass.allows(result))
    reader.problem("density", fmt::format("a density that gives a mass of {:.3g} kg", result), kMass.need());
  return result;
}

/// A shape with its pose in the object. Sizes of an unknown kind of shape are not checked.
model::Shape read_form(MapReader& reader) {
  model::Shape shape;
  if (!read_solid(reader, "shape", shape))
    for (const char* key : {"edges", "radius", "length", "mesh", "scale"}) reader.child(key);
  return shape;
}

/// The parts of a compound. Without a mass or density of the whole, each part has its own.
void read_parts(MapReader& reader, ObjectSpec& object) {
  const bool of_whole = !object.is_static && (reader.has("mass") || reader.has("density"));
  const bool of_parts = !object.is_static && !of_whole;
  std::vector<model::MassProperties> parts;
  double whole_volume = 0;
  reader.each("parts", 1, kMostParts, [&](MapReader part) {
    model::Shape shape = read_form(part);
    const Pose at{part.vector("position", kCoordinate, Vec3::Zero()), part.rotation("rotation")};
    shape.pose = at * shape.pose;
    shape.colour = read_colour(part);
    const double own = model::volume(shape);
    whole_volume += own;
    parts.push_back(model::solid_properties(shape, of_parts ? read_mass(part, own) : own));
    part.finish();
    object.shapes.push_back(std::move(shape));
  });
  if (object.is_static || parts.empty()) return;
  object.body = model::joined(parts);
  if (!of_whole || !reader.sound()) return;
  // The parts' masses are their volumes so far; all have one density.
  const double density = read_mass(reader, whole_volume) / whole_volume;
  object.body.mass *= density;
  object.body.inertia *= density;
}

/// Reads `inertia`: where the mass lies, in place of one density of the shapes.
void read_inertia(MapReader& reader, model::MassProperties& body) {
  if (!reader.has("inertia")) return;
  MapReader block = reader.map("inertia");
  body.centre = block.vector("centre", kCoordinate);
  const Vec3 moments = block.vector("radii", kSize).cwiseAbs2();
  const Mat3 axes = block.rotation("rotation").toRotationMatrix();
  if (block.sound() && 2 * moments.maxCoeff() > moments.sum() * (1 + 1e-9))
    block.problem("radii", "a square that exceeds the sum of the other two",
                  "radii of gyration of a rigid body");
  body.inertia = body.mass * axes * moments.asDiagonal() * axes.transpose();
  block.finish();
}

/// The `scale` of a mesh; nothing for other shapes.
std::optional<double> mesh_scale(const YamlNode& node) {
  const YamlNode* form = &node;
  if (const YamlNode* parts = node.find("parts"); parts && !parts->items.empty())
    form = &parts->items.front();
  const YamlNode* scale = form->find("mesh") ? form->find("scale") : nullptr;
  return scale ? parse_number(scale->text) : std::nullopt;
}

/// A size that is unusual beside a hand is mostly a wrong unit. A static object may be a wall.
void warn_of_size(MapReader& reader, const ObjectSpec& object) {
  constexpr double kLongest = 2, kShortest = 1e-3;
  const double size = model::box_edges(object.shapes).maxCoeff();
  const std::optional<double> scale = mesh_scale(reader.node());
  const bool large = size > kLongest && (!object.is_static || scale), small = size < kShortest;
  if (!large && !small) return;
  const std::string remedy = !scale  ? "a bare number is in m, \"90 mm\" is in mm"
                             : large ? fmt::format("scale: {:g} if the file is in mm", *scale / 1000)
                                     : fmt::format("scale: {:g} if the file is in m", *scale * 1000);
  reader.warning("name",
                 fmt::format("{} is {:.3g} m long, a hand about 0.2 m: {}", object.name, size, remedy));
}

/// @param in_scene false for a file of its own, which may lack name and pose.
ObjectSpec read_object(MapReader reader, const std::vector<ObjectSpec>& before,
                       const std::vector<model::Material>& materials, const Tasks& tasks, bool beside_hand,
                       bool in_scene) {
  ObjectSpec object;
  object.place = reader.node().place();
  // inline_file() has replaced an entry's file by its content.
  if (reader.has("file"))
    reader.problem("file", "a file that refers to another", "a file with the object itself");
  object.name = in_scene || reader.has("name") ? read_name(reader, before) : "object";
  object.is_static = reader.flag("static", false);
  if (reader.has("shape") && reader.has("parts")) {
    reader.problem("parts", "parts beside a shape", "one of the two");
    for (const std::string_view key : kSizeKeys) reader.child(key);
    for (const std::string_view key : kMassKeys) reader.child(key);
    object.shapes.emplace_back();
  } else if (reader.has("parts")) {
    read_parts(reader, object);
  } else {
    object.shapes.push_back(read_form(reader));
    const model::Shape& shape = object.shapes.front();
    if (!object.is_static)
      object.body = model::solid_properties(shape, read_mass(reader, model::volume(shape)));
  }
  if (reader.sound() && beside_hand) warn_of_size(reader, object);
  if (!object.is_static) {
    read_inertia(reader, object.body);
    object.velocity = reader.vector("velocity", kVelocity, Vec3::Zero());
    object.angular_velocity = reader.vector("angular_velocity", kAngularVelocity, Vec3::Zero());
  }
  if (!places_object(tasks, object.name))
    object.pose = read_pose(reader, in_scene ? std::nullopt : std::optional<Vec3>(Vec3::Zero()));
  else if (reader.child("position") || reader.child("rotation"))
    reader.problem("position", "a pose beside the task that gives it", "one of the two");
  object.may_overlap = reader.choice<bool>("overlap", {{"refused", false}, {"allowed", true}}, false);
  object.material = read_surface(reader, object.name, materials);
  const std::optional<std::uint32_t> colour = read_colour(reader);
  for (model::Shape& shape : object.shapes)
    if (!shape.colour) shape.colour = colour;
  object.source = reader.maybe_text("source");
  reader.finish();
  return object;
}

}  // namespace

std::optional<std::uint32_t> read_colour(MapReader& reader, const char* key) {
  const char* need = "six hexadecimal digits in quotes, such as \"#c0392b\"";
  const YamlNode* node = reader.value(key, {{YamlNode::Kind::scalar}, need, false});
  if (!node) return std::nullopt;
  std::uint32_t colour = 0;
  const char* end = node->text.data() + node->text.size();
  const bool good = node->text.size() == 7 && node->text.front() == '#' &&
                    std::from_chars(node->text.data() + 1, end, colour, 16).ptr == end;
  if (!good) reader.problem(key, node->described(), need);
  return good ? std::optional(colour) : std::nullopt;
}

model::Material read_surface(MapReader& reader, std::string name,
                             const std::vector<model::Material>& materials) {
  if (!reader.has("material")) return model::read_material(reader, std::move(name));
  for (const std::string_view key : kPropertyKeys)
    if (reader.child(key))
      reader.problem(key, "a property beside the material that states it", "one of the two");
  return named_material(reader, "material", materials).value_or(model::Material{});
}

bool read_solid(MapReader& reader, std::string_view kind_key, model::Shape& shape) {
  const std::size_t before = reader.diagnostics().problems.size();
  shape.kind = reader.choice<ShapeKind>(kind_key, {{"box", ShapeKind::box},
                                                   {"sphere", ShapeKind::sphere},
                                                   {"cylinder", ShapeKind::cylinder},
                                                   {"capsule", ShapeKind::capsule},
                                                   {"convex_mesh", ShapeKind::convex_mesh}});
  if (reader.diagnostics().problems.size() > before) return false;
  if (shape.kind == ShapeKind::convex_mesh) {
    read_mesh(reader, shape);
    return true;
  }
  if (shape.kind == ShapeKind::box)
    shape.edges = reader.vector("edges", kSize);
  else
    shape.radius = reader.number("radius", kSize);
  if (shape.kind == ShapeKind::cylinder || shape.kind == ShapeKind::capsule)
    shape.length = reader.number("length", kSize);
  return true;
}

std::vector<ObjectSpec> read_objects(MapReader& reader, const std::vector<model::Material>& materials,
                                     const Tasks& tasks, bool beside_hand) {
  std::vector<ObjectSpec> objects;
  reader.each("objects", 0, kMostObjects, [&](MapReader block) {
    if (inline_file(block, FileKind::object, overridden))
      objects.push_back(read_object(std::move(block), objects, materials, tasks, beside_hand, true));
  });
  return objects;
}

ObjectSpec read_object_file(const YamlNode& root, Diagnostics& diagnostics) {
  if (!is_of_kind(root, "", FileKind::object, diagnostics)) return {};
  return read_object(MapReader(root, "", diagnostics), {}, {}, {}, true, false);
}

std::optional<GroundSpec> read_ground(MapReader& reader, const std::vector<model::Material>& materials) {
  if (!reader.has("ground")) return std::nullopt;
  MapReader ground = reader.map("ground");
  const GroundSpec spec{ground.number("height", kCoordinate, 0.0), read_surface(ground, "ground", materials)};
  ground.finish();
  return spec;
}

}  // namespace handsim::scene
