#include "handsim/scene/mesh_file.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/text.h"
#include "handsim/scene/convex_hull.h"

namespace handsim::scene {

namespace {

constexpr std::uintmax_t kMostBytes = 64U << 20U;
constexpr unsigned kMostFaces = 100'000;
constexpr std::size_t kMostCorners = 1000;
/// Share of a mesh's size by which its surface may lie inside the hull; formats round to single precision.
constexpr double kFlat = 1e-4;
constexpr double kThinnest = 1e-4, kLargest = 100;

[[noreturn]] void refuse(std::string got, std::string need) {
  throw input_error("", std::move(got), std::move(need));
}

void check_file(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  const char* need = "the path of an OBJ or STL file, relative to this file";
  if (ending != ".obj" && ending != ".stl") refuse(path.filename().string(), need);
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path, failure))
    refuse(path.filename().string() + ", which is no file", need);
  const std::uintmax_t bytes = std::filesystem::file_size(path, failure);
  if (failure || bytes > kMostBytes)
    refuse(fmt::format("a file of {} bytes", bytes), fmt::format("at most {} bytes", kMostBytes));
}

using Triangle = std::array<Vec3, 3>;

std::vector<Triangle> triangles_of(const std::filesystem::path& path, double scale) {
  Assimp::Importer importer;
  const aiScene* scene =
      importer.ReadFile(path.string(), aiProcess_Triangulate | aiProcess_JoinIdenticalVertices |
                                           aiProcess_PreTransformVertices);
  if (scene == nullptr)
    refuse(fmt::format("a mesh that cannot be read ({})", printable(importer.GetErrorString())),
           "a mesh in OBJ or STL");
  std::vector<Triangle> triangles;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& mesh = *scene->mMeshes[m];
    if (triangles.size() + mesh.mNumFaces > kMostFaces)
      refuse(fmt::format("{} faces", triangles.size() + mesh.mNumFaces),
             fmt::format("at most {} faces", kMostFaces));
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      // Points and lines have no surface.
      if (mesh.mFaces[f].mNumIndices != 3) continue;
      Triangle& triangle = triangles.emplace_back();
      for (std::size_t i = 0; i < 3; ++i) {
        const aiVector3D& v = mesh.mVertices[mesh.mFaces[f].mIndices[i]];
        triangle[i] = scale * Vec3(v.x, v.y, v.z);
        if (!triangle[i].allFinite()) refuse("a corner that is not finite", "finite coordinates");
      }
    }
  }
  if (triangles.empty()) refuse("a mesh without faces", "the surface of a convex body");
  return triangles;
}

/// How far the surface of a mesh lies inside its hull: the most that any triangle's plane has above it.
double dent(const std::vector<Triangle>& triangles, const std::vector<Vec3>& corners) {
  double deepest = 0;
  for (const Triangle& t : triangles) {
    const Vec3 normal = (t[1] - t[0]).cross(t[2] - t[0]);
    if (!(normal.norm() > 1e-30)) continue;
    const Vec3 n = normal.normalized();
    double above = 0, below = 0;
    for (const Vec3& corner : corners) {
      above = std::max(above, n.dot(corner - t[0]));
      below = std::max(below, -n.dot(corner - t[0]));
    }
    // Files do not agree on which way round a triangle is.
    deepest = std::max(deepest, std::min(above, below));
  }
  return deepest;
}

/// Least distance of two parallel planes that hold all of it [m].
double thickness(const model::ConvexMesh& mesh) {
  double least = std::numeric_limits<double>::infinity();
  for (int f = 0; f < mesh.face_count(); ++f)
    least = std::min(least, mesh.support(mesh.normal(f)) + mesh.support(-mesh.normal(f)));
  return least;
}

}  // namespace

LoadedMesh load_convex_mesh(const std::filesystem::path& path, double scale) {
  check_file(path);
  const std::vector<Triangle> triangles = triangles_of(path, scale);
  std::vector<Vec3> points;
  for (const Triangle& triangle : triangles) points.insert(points.end(), triangle.begin(), triangle.end());
  Vec3 low = points.front(), high = low;
  for (const Vec3& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const double size = (high - low).maxCoeff();
  const std::string extent = fmt::format("{:.3g} to {:g} m", kThinnest, kLargest);
  if (!(size >= kThinnest && size <= kLargest) || low.cwiseAbs().cwiseMax(high.cwiseAbs()).maxCoeff() > 1000)
    refuse(fmt::format("a mesh of {:.3g} m", size), "a size of " + extent + ", near the origin");
  const std::string solid = fmt::format("a solid body, nowhere thinner than {:g} m", kThinnest);
  Hull hull;
  try {
    hull = convex_hull(points);
  } catch (const Error&) {
    refuse("a mesh that is flat", solid);
  }
  if (hull.vertices.size() > kMostCorners)
    refuse(fmt::format("a hull of {} corners", hull.vertices.size()),
           fmt::format("at most {} corners: a simpler mesh", kMostCorners));
  LoadedMesh out;
  const auto mesh =
      std::make_shared<model::ConvexMesh>(model::make_convex_mesh(hull.vertices, hull.faces, out.centroid));
  if (!(thickness(*mesh) >= kThinnest)) refuse(fmt::format("a mesh {:.3g} m thick", thickness(*mesh)), solid);
  const double inside = dent(triangles, hull.vertices);
  if (inside > kFlat * size)
    refuse(fmt::format("a mesh that is not convex: surface {:.3g} m inside its hull", inside),
           "a convex mesh; several of them make a compound");
  out.mesh = mesh;
  return out;
}

}  // namespace handsim::scene
