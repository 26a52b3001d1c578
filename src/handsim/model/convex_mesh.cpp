#include "handsim/model/convex_mesh.h"

#include <algorithm>
#include <limits>
#include <map>

namespace handsim::model {

namespace {

/// Unit normal of a polygon: sum of the cross products over its triangle fan (Newell's method).
Vec3 polygon_normal(const std::vector<Vec3>& vertices, const std::vector<int>& corners) {
  const auto at = [&](std::size_t i) { return vertices[static_cast<std::size_t>(corners[i])]; };
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) sum += (at(i) - at(0)).cross(at(i + 1) - at(0));
  return sum.normalized();
}

struct Integrals {
  double volume = 0;
  Vec3 first = Vec3::Zero();   ///< of x
  Mat3 second = Mat3::Zero();  ///< of x x^T
};

/// Sums over the tetrahedra of the origin and each triangle a, b, c of the faces: with s = a + b + c,
/// V = det/6, int x = V s/4, int x x^T = V/20 (a a^T + b b^T + c c^T + s s^T).
Integrals integrate(const std::vector<Vec3>& vertices, const std::vector<std::vector<int>>& faces) {
  Integrals sum;
  for (const std::vector<int>& corners : faces)
    for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
      const Vec3& a = vertices[static_cast<std::size_t>(corners[0])];
      const Vec3& b = vertices[static_cast<std::size_t>(corners[i])];
      const Vec3& c = vertices[static_cast<std::size_t>(corners[i + 1])];
      const double volume = a.dot(b.cross(c)) / 6;
      const Vec3 s = a + b + c;
      sum.volume += volume;
      sum.first += volume / 4 * s;
      sum.second +=
          volume / 20 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + s * s.transpose());
    }
  return sum;
}

void add_edges(ConvexMesh& mesh) {
  std::map<std::pair<unsigned, unsigned>, int> places;
  mesh.owners = mesh.twins = std::vector<int>(mesh.loops.size(), -1);
  for (int f = 0; f < mesh.face_count(); ++f) {
    const auto corners = mesh.corners(f);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const int place = mesh.loop_starts[as_index(f)] + 1 + static_cast<int>(i);
      places[{corners[i], corners[(i + 1) % corners.size()]}] = place;
      mesh.owners[as_index(place)] = f;
    }
  }
  for (const auto& [ends, place] : places) {
    const auto twin = places.find({ends.second, ends.first});
    if (twin == places.end()) continue;
    mesh.twins[as_index(place)] = twin->second;
    if (ends.first < ends.second)
      mesh.edges.push_back({static_cast<int>(ends.first), static_cast<int>(ends.second),
                            mesh.owners[as_index(place)], mesh.owners[as_index(twin->second)]});
  }
}

void add_rims(ConvexMesh& mesh) {
  mesh.rims.resize(mesh.loops.size());
  for (int f = 0; f < mesh.face_count(); ++f) {
    const auto corners = mesh.corners(f);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Vec3& from = mesh.vertex(corners[i]);
      const Vec3& to = mesh.vertex(corners[(i + 1) % corners.size()]);
      const Vec3 out = (to - from).cross(mesh.normal(f)).normalized();
      mesh.rims[as_index(mesh.loop_starts[as_index(f)]) + 1 + i] << out, out.dot(from);
    }
  }
}

void add_pierced(ConvexMesh& mesh) {
  constexpr int kCells = ConvexMesh::kCells;
  for (int side = 0; side < 6; ++side)
    for (int row = 0; row < kCells; ++row)
      for (int column = 0; column < kCells; ++column) {
        Vec3 way;
        way[side / 2] = side % 2 == 0 ? 1 : -1;
        way[(side / 2 + 1) % 3] = (2 * row + 1) / static_cast<double>(kCells) - 1;
        way[(side / 2 + 2) % 3] = (2 * column + 1) / static_cast<double>(kCells) - 1;
        const auto first = std::ranges::max_element(mesh.planes, {}, [&](const Eigen::Vector4d& plane) {
          return plane.head<3>().dot(way) / plane.w();
        });
        mesh.pierced.push_back(static_cast<int>(first - mesh.planes.begin()));
      }
}

}  // namespace

int ConvexMesh::face_towards(const Vec3& point) const {
  const Vec3 size = point.cwiseAbs();
  const int axis = size.x() > size.y() ? (size.x() > size.z() ? 0 : 2) : (size.y() > size.z() ? 1 : 2);
  const double scale = size[axis] > 0 ? 0.5 * kCells / size[axis] : 0;
  const auto cell = [&](int other) {
    const double at = 0.5 * kCells + scale * point[other];
    return at > 0 ? std::min(static_cast<int>(at), kCells - 1) : 0;  // also what is no number
  };
  const int row = cell(axis == 2 ? 0 : axis + 1), column = cell(axis == 0 ? 2 : axis - 1);
  return pierced[as_index(((2 * axis + (point[axis] < 0 ? 1 : 0)) * kCells + row) * kCells + column)];
}

double ConvexMesh::support(const Vec3& n) const {
  double most = -std::numeric_limits<double>::infinity();
  for (const Vec3& vertex : vertices) most = std::max(most, n.dot(vertex));
  return most;
}

ConvexMesh make_convex_mesh(std::vector<Vec3> vertices, const std::vector<std::vector<int>>& faces,
                            Vec3& centroid) {
  // The origin is first moved inside: far from it, cancellation would spoil the sums.
  const Vec3 inside = Eigen::Map<const Eigen::Matrix3Xd>(vertices.front().data(), 3,
                                                         static_cast<Eigen::Index>(vertices.size()))
                          .rowwise()
                          .mean();
  for (Vec3& vertex : vertices) vertex -= inside;
  const Integrals about_inside = integrate(vertices, faces);
  const Vec3 shift = about_inside.first / about_inside.volume;
  for (Vec3& vertex : vertices) vertex -= shift;
  centroid = inside + shift;

  ConvexMesh mesh;
  const Integrals sums = integrate(vertices, faces);
  mesh.volume = sums.volume;
  const Mat3 spread = sums.second / sums.volume;
  mesh.unit_inertia = spread.trace() * Mat3::Identity() - 0.5 * (spread + spread.transpose());
  mesh.vertices = std::move(vertices);
  for (const std::vector<int>& corners : faces) {
    const Vec3 n = polygon_normal(mesh.vertices, corners);
    mesh.planes.emplace_back(n.x(), n.y(), n.z(), mesh.support(n));
    mesh.loop_starts.push_back(static_cast<int>(mesh.loops.size()));
    mesh.loops.push_back(static_cast<unsigned>(corners.size()));
    for (const int corner : corners) mesh.loops.push_back(static_cast<unsigned>(corner));
  }
  add_edges(mesh);
  add_rims(mesh);
  add_pierced(mesh);
  mesh.inner = std::ranges::min(mesh.planes, {}, [](const auto& plane) { return plane.w(); }).w();
  for (const Vec3& vertex : mesh.vertices) mesh.reach = std::max(mesh.reach, vertex.norm());
  return mesh;
}

ConvexMesh box_polyhedron(const Vec3& edges) {
  std::vector<Vec3> corners;
  for (int i = 0; i < 8; ++i)
    corners.push_back(0.5 * edges.cwiseProduct(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1)));
  Vec3 centroid;
  return make_convex_mesh(
      std::move(corners),
      {{1, 3, 7, 5}, {0, 4, 6, 2}, {2, 6, 7, 3}, {0, 1, 5, 4}, {4, 5, 7, 6}, {0, 2, 3, 1}}, centroid);
}

}  // namespace handsim::model
