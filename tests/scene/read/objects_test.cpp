// Objects: files, compounds, the shipped collection.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>

#include "handsim/scene/read/objects.h"
#include "scene_files.h"

namespace handsim::scene {
namespace {

using model::ShapeKind;

Scene scene_of(const std::string& objects) {
  return compile_scene(
      parse_yaml("objects:\n" + objects + "\nduration: 1\n", test::in_source("config/test.yaml")));
}

/// Extents of an object along the axes of its frame O, by support functions.
std::pair<Vec3, Vec3> extents(const ObjectSpec& object) {
  const auto support = [](const model::Shape& shape, const Vec3& n) {
    const Vec3 m = shape.pose.q.conjugate() * n;
    const double along = n.dot(shape.pose.p);
    switch (shape.kind) {
      case ShapeKind::box:
        return along + 0.5 * shape.edges.dot(m.cwiseAbs());
      case ShapeKind::cylinder:
        return along + shape.radius * m.head<2>().norm() + 0.5 * shape.length * std::abs(m.z());
      case ShapeKind::capsule:
        return along + shape.radius + 0.5 * shape.length * std::abs(m.z());
      default:
        return along + shape.radius;
    }
  };
  std::pair<Vec3, Vec3> out{Vec3::Constant(1e9), Vec3::Constant(-1e9)};
  for (const model::Shape& shape : object.shapes)
    for (int i = 0; i < 3; ++i) {
      out.first[i] = std::min(out.first[i], -support(shape, -Vec3::Unit(i)));
      out.second[i] = std::max(out.second[i], support(shape, Vec3::Unit(i)));
    }
  return out;
}

// Oracle: the file's text; an entry's keys override those of its file.
TEST(ObjectFile, SuppliesTheKeysThatTheEntryLacks) {
  const Scene plain = scene_of("  - {name: can, file: objects/tomato_soup_can.yaml, position: [0, 0, 1]}");
  ASSERT_EQ(plain.spec.objects.size(), 1U);
  EXPECT_DOUBLE_EQ(plain.model.bodies[1].mass, 0.349);
  EXPECT_EQ(plain.model.shapes[0].radius, 0.0339);
  EXPECT_EQ(plain.resolved.find("objects")->items[0].find("file"), nullptr);

  const Scene denser = scene_of(
      "  - {name: can, file: objects/tomato_soup_can.yaml, position: [0, 0, 1], density: 1000, radius: "
      "0.03}");
  EXPECT_NEAR(denser.model.bodies[1].mass, 1000 * M_PI * 0.0009 * 0.102, 1e-12);
  const Scene box = scene_of(
      "  - {name: can, file: objects/tomato_soup_can.yaml, position: [0, 0, 1], shape: box, edges: [1, 1, "
      "1]}");
  EXPECT_EQ(box.model.shapes[0].kind, ShapeKind::box);
  EXPECT_DOUBLE_EQ(box.model.bodies[1].mass, 0.349);
}

// Oracle: the resolved text compiles to itself.
TEST(ObjectFile, IsInlinedInTheResolvedScene) {
  const Scene first = scene_of("  - {name: mug, file: objects/mug.yaml, position: [0, 0, 1]}");
  const std::string text = emit_yaml(first.resolved);
  const Scene second = compile_scene(parse_yaml(text, "/elsewhere/resolved.yaml"));
  EXPECT_EQ(emit_yaml(second.resolved), text);
  EXPECT_EQ(first.model.bodies[1].inertia, second.model.bodies[1].inertia);
}

// Oracle: three slices of a brick together are the brick.
TEST(Compound, OfTheSlicesOfABrickIsTheBrick) {
  const Scene whole = scene_of(
      "  - {name: brick, shape: box, edges: [0.3, 0.1, 0.2], density: 700, position: [1, 2, 3], rotation: "
      "{axis: [1, 1, 0], angle: 1}}");
  const Scene sawn = scene_of(
      "  - name: brick\n"
      "    density: 700\n"
      "    position: [1, 2, 3]\n"
      "    rotation: {axis: [1, 1, 0], angle: 1}\n"
      "    parts:\n"
      "      - {shape: box, edges: [0.05, 0.1, 0.2], position: [-0.125, 0, 0]}\n"
      "      - {shape: box, edges: [0.1, 0.05, 0.2], position: [-0.075, 0, 0], rotation: {axis: [0, 0, 1], "
      "angle: \"90 deg\"}}\n"
      "      - {shape: box, edges: [0.2, 0.1, 0.2], position: [0.05, 0, 0]}");
  const model::Body& a = whole.model.bodies[1];
  const model::Body& b = sawn.model.bodies[1];
  EXPECT_NEAR(a.mass, b.mass, 1e-12);
  EXPECT_LT((a.inertia - b.inertia).norm(), 1e-14);
  EXPECT_LT((a.zero_pose.p - b.zero_pose.p).norm(), 1e-14);
  EXPECT_EQ(sawn.model.shapes.size(), 3U);
}

// Oracle: closed form of a dumb-bell; the object's pose is that of its own frame, the body's frame is at the
// centre of mass, and the parts are at their stated positions.
TEST(Compound, HasItsBodyFrameAtTheCentreOfMass) {
  const Scene scene = scene_of(
      "  - name: bell\n"
      "    position: [0, 0, 1]\n"
      "    rotation: {axis: [0, 0, 1], angle: \"90 deg\"}\n"
      "    parts:\n"
      "      - {shape: sphere, radius: 0.02, mass: 1, position: [0, 0, 0]}\n"
      "      - {shape: sphere, radius: 0.01, mass: 3, position: [0.4, 0, 0]}");
  const model::Body& body = scene.model.bodies[1];
  EXPECT_DOUBLE_EQ(body.mass, 4);
  EXPECT_LT((body.zero_pose.p - Vec3(0, 0.3, 1)).norm(), 1e-15);
  const double axial = 0.4 * (1 * 4e-4 + 3 * 1e-4);
  const double across = axial + 1 * 0.09 + 3 * 0.01;
  EXPECT_LT((body.inertia - Mat3(Vec3(axial, across, across).asDiagonal())).norm(), 1e-15);
  EXPECT_LT(((body.zero_pose * scene.model.shapes[1].pose).p - Vec3(0, 0.4, 1)).norm(), 1e-15);
}

// Oracle: the digits of the text; a part's own colour comes before that of its object.
TEST(Colour, IsThatOfThePartOrOfTheObject) {
  const Scene scene = scene_of(
      "  - name: two\n"
      "    position: [0, 0, 1]\n"
      "    mass: 1\n"
      "    color: \"#0a0B0c\"\n"
      "    parts:\n"
      "      - {shape: sphere, radius: 0.02}\n"
      "      - {shape: sphere, radius: 0.01, position: [0.4, 0, 0], color: \"#FF8000\"}\n"
      "  - {name: plain, shape: sphere, radius: 0.02, mass: 1, position: [0, 1, 1]}");
  EXPECT_EQ(scene.model.shapes[0].colour, std::optional<std::uint32_t>(0x0A0B0C));
  EXPECT_EQ(scene.model.shapes[1].colour, std::optional<std::uint32_t>(0xFF8000));
  EXPECT_FALSE(scene.model.shapes[2].colour.has_value());
}

TEST(Colour, IsSixDigitsInQuotes) {
  for (const char* colour :
       {"red", "\"#12345\"", "\"#12345g\"", "\"1234567\"", "\"#-12345\"", "[1, 2, 3]", "#ff8000"})
    EXPECT_THROW(scene_of(std::string("  - name: a\n    shape: sphere\n    radius: 0.02\n    mass: 1\n"
                                      "    position: [0, 0, 1]\n    color: ") +
                          colour),
                 Error)
        << colour;
}

std::vector<std::filesystem::path> shipped_objects() {
  std::vector<std::filesystem::path> files;
  for (const auto& file : std::filesystem::directory_iterator(test::source("config/objects")))
    files.push_back(file.path());
  std::sort(files.begin(), files.end());
  return files;
}

ObjectSpec object_of(const std::filesystem::path& file) {
  YamlNode root = load_yaml(file);
  Diagnostics diagnostics;
  ObjectSpec object = read_object_file(root, diagnostics);
  diagnostics.throw_if_any();
  return object;
}

TEST(ShippedObjects, AllLoadAndNameTheirSource) {
  EXPECT_GE(shipped_objects().size(), 31U);
  for (const auto& file : shipped_objects()) {
    ObjectSpec object;
    EXPECT_NO_THROW(object = object_of(file)) << file;
    EXPECT_TRUE(object.source) << file;
  }
}

// Oracle: the table the files were written from, row by the name that the source starts with.
TEST(ShippedObjects, HaveMassSizeAndFrictionOfTheTable) {
  const std::filesystem::path table = test::source("tests/data/oracles/grasp_objects.csv");
  std::map<std::string, std::vector<std::string>> rows;
  std::istringstream lines(test::text_of(table));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("#")) continue;
    std::vector<std::string> cells(1);
    bool quoted = false;
    for (const char c : line) {
      if (c == '"')
        quoted = !quoted;
      else if (c == ',' && !quoted)
        cells.emplace_back();
      else
        cells.back() += c;
    }
    rows[cells[0]] = cells;
  }
  int compared = 0;
  for (const auto& file : shipped_objects()) {
    const ObjectSpec object = object_of(file);
    const auto row = rows.find(object.source->substr(0, object.source->find(':')));
    if (row == rows.end()) {
      EXPECT_TRUE(object.is_static) << file << ": neither a hold nor a row of the table";
      continue;
    }
    ++compared;
    const auto number = [&](std::size_t column) { return std::stod(row->second.at(column)); };
    EXPECT_NEAR(object.body.mass, number(5), 1e-9) << file;
    const auto [low, high] = extents(object);
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(high[i] - low[i], number(2 + static_cast<std::size_t>(i)), 1e-9) << file << ", axis " << i;
    if (!row->second.at(6).empty()) {
      EXPECT_EQ(object.material.friction, number(6)) << file;
    }
  }
  // All rows but those whose only size is a bounding box: drill, scissors, hammer; and the head of the table.
  EXPECT_EQ(compared + 3 + 1, static_cast<int>(rows.size()));
}

}  // namespace
}  // namespace handsim::scene
