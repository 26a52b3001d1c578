// OBJ and STL files. Oracle: the points and faces written here; formats as their authors describe them.

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdint>
#include <cstring>
#include <fstream>

#include "handsim/scene/read/mesh_file.h"
#include "scene_files.h"

namespace handsim::scene {
namespace {

namespace fs = std::filesystem;
using Ints = std::vector<int>;

class MeshFile : public testing::Test {
 protected:
  fs::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_.path() / name, std::ios::binary) << bytes;
    return folder_.path() / name;
  }
  Surface read(const std::string& name, const std::string& bytes) const {
    return read_surface_file(write(name, bytes));
  }
  /// The error message, from the line number on.
  std::string refusal(const std::string& name, const std::string& bytes) const {
    try {
      read(name, bytes);
    } catch (const Error& error) {
      const std::string text = error.what(), path = (folder_.path() / name).string() + ":";
      EXPECT_TRUE(text.starts_with(path)) << text;
      return text.substr(std::min(path.size(), text.size()));
    }
    return "";
  }
  test::TemporaryFolder folder_;
};

const std::string kPoints = "v 0 0 0\nv 1 0 0 0.5\nv 0 1 0 1 1 1\nv 0 0 1e0\n";

TEST_F(MeshFile, ObjHasPointsAndPolygonsInEveryFormOfIndex) {
  const Surface surface = read(
      "a.obj",
      "# a comment\r\nmtllib none.mtl\nvn 0 0 1\nvt 0 0\no x\ng y\ns 1\n" + kPoints +
          "usemtl m\nf 1 3 2\r\nf 1/1 2/1 4/1 # comment\nf 1//1 4//1 3//1\nf -3/1/1 -2/1/1 -1/1/1\nl 1 2\n"
          "f 1 2 3 4\n");
  ASSERT_EQ(surface.vertices.size(), 4U);
  EXPECT_EQ(surface.vertices[3], Vec3(0, 0, 1));
  EXPECT_EQ(surface.faces, (std::vector<Ints>{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}, {0, 1, 2, 3}}));
}

// A reader that opened a pipe without a writer would wait for ever.
TEST_F(MeshFile, ObjOpensNoOtherFile) {
  ASSERT_EQ(mkfifo((folder_.path() / "m.mtl").c_str(), 0600), 0);
  EXPECT_EQ(read("a.obj", "mtllib m.mtl\nusemtl m\n" + kPoints + "f 1 2 3\n").faces.size(), 1U);
}

TEST_F(MeshFile, ObjIsRefusedWithLineAndColumn) {
  EXPECT_EQ(refusal("a.obj", "v 0 0\n"), "1:1: got too few coordinates, need three finite coordinates");
  EXPECT_EQ(refusal("a.obj", "v 0 0 x\n"), "1:7: got \"x\", need three finite coordinates");
  EXPECT_EQ(refusal("a.obj", "\nv 0 inf 0\n"), "2:5: got \"inf\", need three finite coordinates");
  EXPECT_EQ(refusal("a.obj", kPoints + "f 1 2\n"), "5:1: got a face of 2 corners, need at least 3");
  for (const char* index : {"0", "5", "-5", "1.5", "x", "/1", "99999999999999999999", "nan"})
    EXPECT_TRUE(refusal("a.obj", kPoints + "f 1 2 " + index + "\n")
                    .starts_with(std::string("5:7: got \"") + index + "\", need the index of one of the 4"))
        << index;
  EXPECT_EQ(refusal("a.obj", "curv 0 1\n"), "1:1: got \"curv\", need a statement of OBJ such as v or f");
  EXPECT_TRUE(refusal("a.obj", std::string("\x7f"
                                           "ELF\0\0",
                                           6))
                  .starts_with("1:1: got"));
}

std::string text_stl(const std::string& end) {
  return "solid x\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   vertex 0 1 0\n" +
         end;
}

TEST_F(MeshFile, StlIsReadAsTextAndAsBinary) {
  const Surface text = read("a.stl", text_stl("  endloop\n endfacet\nendsolid x\n"));
  EXPECT_EQ(text.faces.size(), 1U);
  EXPECT_EQ(text.vertices[2], Vec3(0, 1, 0));
  // A binary file whose title begins like a text file.
  std::string binary = "solid" + std::string(75, ' ') + std::string("\x01\0\0\0", 4);
  for (const float value : {0.F, 0.F, 1.F, 0.F, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F, -2.5F, 0.F}) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < 4; ++i) binary += static_cast<char>(bits >> (8 * i));
  }
  const Surface same = read("b.STL", binary + std::string(2, '\0'));
  EXPECT_EQ(same.faces, text.faces);
  EXPECT_EQ(same.vertices[2], Vec3(0, -2.5, 0));
  EXPECT_TRUE(refusal("c.stl", "x" + binary.substr(1, 100))
                  .ends_with("need 134 bytes for its 1 triangles in binary, or STL in text"));
}

TEST_F(MeshFile, IncompleteStlIsRefused) {
  const std::string whole = text_stl("  endloop\n endfacet\nendsolid x\n");
  for (const char* end :
       {"", "  endloop\n", "  endloop\n endfacet\n", "  endloop\n endfacet\n facet normal 0 0 1\n"})
    EXPECT_TRUE(refusal("a.stl", text_stl(end))
                    .ends_with("got a file that ends before endsolid, need a complete STL file"))
        << end;
  EXPECT_EQ(refusal("a.stl", text_stl("   vertex 1 1 1\n")),
            "7:4: got \"vertex\" after 3 corners, need three corners in each facet");
  EXPECT_EQ(refusal("a.stl", "solid x\nvertex 0 0 0\n"), "2:1: got \"vertex\", need facet or endsolid");
}

TEST_F(MeshFile, IsBounded) {
  std::string points, corners = "v 0 0 0\nf";
  for (int i = 0; i < 300'001; ++i) points += "v 0 0 0\n";
  for (int i = 0; i < 100'003; ++i) corners += " 1";
  EXPECT_EQ(refusal("a.obj", points), "300001:1: got more than 300000 points, need fewer: a simpler mesh");
  EXPECT_EQ(refusal("a.obj", corners), "2:1: got more than 100000 triangles, need fewer: a simpler mesh");
}

const std::string kCube =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
    "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\n";

TEST_F(MeshFile, WithAMissingFaceIsRefused) {
  EXPECT_EQ(load_convex_mesh(write("a.obj", kCube + "f 4 1 5 8\n"), 0.1).open_edges, 0);
  try {
    load_convex_mesh(write("b.obj", kCube), 0.1);
    FAIL();
  } catch (const Error& error) {
    // One of six equal faces, and its four edges.
    EXPECT_EQ(
        error.problems().front().got,
        "a mesh with holes: 4 edges that are not shared by two faces, and 17 % of its hull without a face");
  }
}

// A corner of one face within an edge of another leaves no hole, but is reported.
TEST_F(MeshFile, WithACornerWithinAnEdgeIsABodyWithOpenEdges) {
  const LoadedMesh mesh = load_convex_mesh(write("a.obj", kCube + "v 0 0.5 0\nf 9 1 5 8\nf 4 9 8\n"), 0.1);
  EXPECT_EQ(mesh.open_edges, 3);
  EXPECT_NEAR(mesh.mesh->volume, 1e-3, 1e-12);
}

std::vector<std::string> warnings_of(const std::string& object, bool with_hand) {
  const std::string hand =
      "hands: [{model: ../handmodels/prototype.yaml, person: persons/median_man.yaml, side: right}]\n";
  return compile_scene(parse_yaml((with_hand ? hand : "") + "objects: [{name: stone, position: [0, 0, 60], " +
                                      object + "}]\nduration: 1\n",
                                  test::in_source("config/test.yaml")))
      .warnings;
}

// A stone of 90 mm whose file is in mm, without its scale.
TEST_F(MeshFile, OfAnUnusualSizeBesideAHandIsReportedWithTheScaleThatFits) {
  std::string cube = kCube + "f 4 1 5 8\n";
  const std::string mesh = "shape: convex_mesh, mass: 1, mesh: " + write("c.obj", cube).string();
  EXPECT_TRUE(warnings_of(mesh + ", scale: 0.09", true).empty());
  const auto large = warnings_of(mesh + ", scale: 90", true);
  ASSERT_EQ(large.size(), 1U);
  EXPECT_NE(large[0].find("stone is 90 m long, a hand about 0.2 m: scale: 0.09 if the file is in mm"),
            std::string::npos)
      << large[0];
  const auto small = warnings_of(mesh + ", scale: 0.0005", true);
  ASSERT_EQ(small.size(), 1U);
  EXPECT_NE(small[0].find("scale: 0.5 if the file is in m"), std::string::npos) << small[0];
  EXPECT_TRUE(warnings_of(mesh + ", scale: 90", false).empty());
}

TEST(SizeBesideAHand, IsReportedForMovableObjectsAndNotForWalls) {
  const std::string box = "shape: box, edges: [90, 0.1, 0.1]";
  EXPECT_EQ(warnings_of(box + ", mass: 1", true).size(), 1U);
  EXPECT_TRUE(warnings_of(box + ", static: true", true).empty());
  EXPECT_TRUE(warnings_of("shape: box, edges: [0.9, 0.1, 0.1], mass: 1", true).empty());
}

}  // namespace
}  // namespace handsim::scene
