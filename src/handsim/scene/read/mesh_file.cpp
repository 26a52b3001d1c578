#include "handsim/scene/read/mesh_file.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <unordered_map>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/qhull.h"
#include "handsim/core/text.h"

namespace handsim::scene {

namespace {

constexpr std::size_t kMostCorners = 1000;
/// Largest depth of the surface inside the hull, per size of the mesh: formats round to single precision.
constexpr double kFlat = 1e-4;
constexpr double kThinnest = 1e-4, kLargest = 100;
constexpr const char* kSolid = "a solid body, nowhere thinner than 0.0001 m";
constexpr double kUncovered = 1e-3;  ///< Largest fraction of the hull's area without a face of the mesh.

[[noreturn]] void refuse(std::string got, std::string need) {
  throw input_error("", std::move(got), std::move(need));
}

using Triangle = std::array<Vec3, 3>;

/// Triangles of a scaled surface; polygons as triangle fans.
std::vector<Triangle> triangles_of(const Surface& surface, double scale = 1) {
  std::vector<Triangle> out;
  const auto point = [&](int vertex) -> Vec3 {
    return scale * surface.vertices[static_cast<std::size_t>(vertex)];
  };
  for (const std::vector<int>& face : surface.faces)
    for (std::size_t i = 1; i + 1 < face.size(); ++i)
      out.push_back({point(face[0]), point(face[i]), point(face[i + 1])});
  return out;
}

/// Number of edges that do not belong to exactly two faces; coincident corners count as one.
int count_open_edges(const Surface& surface) {
  const auto before = [](const Vec3& a, const Vec3& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
  };
  std::map<Vec3, std::uint32_t, decltype(before)> places(before);
  std::vector<std::uint32_t> place_of;
  for (const Vec3& point : surface.vertices)
    place_of.push_back(places.emplace(point, static_cast<std::uint32_t>(places.size())).first->second);
  std::unordered_map<std::uint64_t, int> faces_at;
  for (const std::vector<int>& face : surface.faces)
    for (std::size_t i = 0; i < face.size(); ++i) {
      const auto at = [&](std::size_t corner) {
        return std::uint64_t{place_of[static_cast<std::size_t>(face[corner % face.size()])]};
      };
      const auto [low, high] = std::minmax({at(i), at(i + 1)});
      if (low != high) ++faces_at[high << 32U | low];
    }
  return static_cast<int>(std::ranges::count_if(faces_at, [](const auto& edge) { return edge.second != 2; }));
}

double area_of(const std::vector<Triangle>& triangles) {
  double sum = 0;
  for (const Triangle& t : triangles) sum += 0.5 * (t[1] - t[0]).cross(t[2] - t[0]).norm();
  return sum;
}

/// Largest depth of a mesh's surface inside its hull: largest height of a corner above a triangle's plane.
double depth_in_hull(const std::vector<Triangle>& triangles, const std::vector<Vec3>& corners) {
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
    // The orientation of triangles is not reliable.
    deepest = std::max(deepest, std::min(above, below));
  }
  return deepest;
}

/// Least distance between a face and the parallel support plane opposite to it [m].
double thickness(const model::ConvexMesh& mesh) {
  double least = std::numeric_limits<double>::infinity();
  for (int f = 0; f < mesh.face_count(); ++f)
    least = std::min(least, mesh.support(mesh.normal(f)) + mesh.support(-mesh.normal(f)));
  return least;
}

/// @returns the longest edge of the points' bounding box [m].
double checked_size(const std::vector<Vec3>& points) {
  Vec3 low = points.front(), high = low;
  for (const Vec3& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const double size = (high - low).maxCoeff();
  if (!(size >= kThinnest && size <= kLargest) || low.cwiseAbs().cwiseMax(high.cwiseAbs()).maxCoeff() > 1000)
    refuse(fmt::format("a mesh of {:.3g} m", size),
           fmt::format("a size of {:.3g} to {:g} m, near the origin (for a file in mm: scale: 0.001)",
                       kThinnest, kLargest));
  return size;
}

Surface checked_hull(const std::vector<Vec3>& points) {
  Surface hull;
  try {
    hull = convex_hull(points);
  } catch (const Error&) {
    refuse("a mesh that is flat", kSolid);
  }
  if (hull.vertices.size() > kMostCorners)
    refuse(fmt::format("a hull of {} corners", hull.vertices.size()),
           fmt::format("at most {} corners: a simpler mesh", kMostCorners));
  return hull;
}

/// The surface must cover the hull and must not be inside it.
void check_convex(const std::vector<Triangle>& triangles, const Surface& hull, double size, int open_edges) {
  const double inside = depth_in_hull(triangles, hull.vertices);
  if (inside > kFlat * size)
    refuse(fmt::format("a mesh that is not convex: surface {:.3g} m inside its hull", inside),
           "a convex mesh: handsim object writes a compound of them");
  const double uncovered = 1 - area_of(triangles) / area_of(triangles_of(hull));
  if (uncovered > kUncovered)
    refuse(fmt::format("a mesh with holes: {} edges that are not shared by two faces, and {:.2g} % of its "
                       "hull without a face",
                       open_edges, 100 * uncovered),
           "a closed surface");
}

}  // namespace

LoadedMesh load_convex_mesh(const std::filesystem::path& path, double scale) {
  const std::string ending = lower_case(path.extension().string());
  if (ending != ".obj" && ending != ".stl")
    refuse(path.filename().string(), "the path of an OBJ or STL file, relative to this file");
  const Surface surface = read_surface_file(path);
  const std::vector<Triangle> triangles = triangles_of(surface, scale);
  if (triangles.empty()) refuse("a mesh without faces", "the surface of a convex body");
  std::vector<Vec3> points;
  for (const Triangle& triangle : triangles) points.insert(points.end(), triangle.begin(), triangle.end());
  const double size = checked_size(points);
  const Surface hull = checked_hull(points);
  LoadedMesh out;
  const auto mesh =
      std::make_shared<model::ConvexMesh>(model::make_convex_mesh(hull.vertices, hull.faces, out.centroid));
  if (!(thickness(*mesh) >= kThinnest))
    refuse(fmt::format("a mesh {:.3g} m thick", thickness(*mesh)), kSolid);
  out.open_edges = count_open_edges(surface);
  check_convex(triangles, hull, size, out.open_edges);
  out.mesh = mesh;
  return out;
}

Surface convex_hull(const std::vector<Vec3>& points) {
  std::vector<double> input;
  for (const Vec3& point : points) input.insert(input.end(), point.begin(), point.end());
  // Qhull merges coplanar facets into polygons.
  const QhullState state = run_qhull(input, 3, "qhull Pp");
  if (!state) throw input_error("", "points that span no volume", "points of a solid body");
  qhT* qh = state.get();

  Surface hull;
  std::map<int, int> index;
  facetT* facet = nullptr;
  FORALLfacets {
    std::vector<int>& face = hull.faces.emplace_back();
    setT* corners = qh_facet3vertex(qh, facet);
    vertexT* vertex = nullptr;
    vertexT** vertexp = nullptr;
    FOREACHvertex_(corners) {
      const int point = qh_pointid(qh, vertex->point);
      const auto [found, fresh] = index.emplace(point, static_cast<int>(hull.vertices.size()));
      if (fresh) hull.vertices.push_back(points[static_cast<std::size_t>(point)]);
      face.push_back(found->second);
    }
    qh_settempfree(qh, &corners);
    const auto at = [&](std::size_t i) { return hull.vertices[static_cast<std::size_t>(face[i])]; };
    Vec3 normal = Vec3::Zero();
    for (std::size_t i = 1; i + 1 < face.size(); ++i) normal += (at(i) - at(0)).cross(at(i + 1) - at(0));
    if (normal.dot(Vec3(facet->normal[0], facet->normal[1], facet->normal[2])) < 0)
      std::ranges::reverse(face);
  }
  return hull;
}

}  // namespace handsim::scene
