#include "handsim/output/render/mesh.h"

#include <cmath>
#include <numbers>

namespace handsim::output {

namespace {

constexpr float kQuarter = std::numbers::pi_v<float> / 2;

/// One meridian: the x and y of its point of the core, and its longitude [rad].
struct Meridian {
  float x, y, longitude;
};

std::uint32_t index(int ring, int meridian, int meridians) {
  return static_cast<std::uint32_t>(ring * meridians + meridian % meridians);
}

/// A sphere that is cut along the equator, and along meridians where neighbours have different points of the
/// core, with the gaps filled. `capped`: the poles are faces, not points.
Mesh rounded_mesh(const std::vector<Meridian>& meridians, int rings, bool capped) {
  Mesh mesh;
  const int n = static_cast<int>(meridians.size());
  const int levels = 2 * (rings + 1);
  for (int level = 0; level < levels; ++level) {
    const bool upper = level > rings;
    const int step = upper ? level - rings - 1 : level - rings;
    const float latitude = kQuarter * static_cast<float>(step) / static_cast<float>(rings);
    for (const Meridian& meridian : meridians)
      mesh.vertices.push_back({{meridian.x, meridian.y, upper ? 1.0F : -1.0F},
                               {std::cos(latitude) * std::cos(meridian.longitude),
                                std::cos(latitude) * std::sin(meridian.longitude), std::sin(latitude)}});
  }
  for (int level = 0; level + 1 < levels; ++level)
    for (int i = 0; i < n; ++i)
      for (const auto& [ring, meridian] : {std::pair{level, i},
                                           {level, i + 1},
                                           {level + 1, i + 1},
                                           {level, i},
                                           {level + 1, i + 1},
                                           {level + 1, i}})
        mesh.indices.push_back(index(ring, meridian, n));
  if (!capped) return mesh;
  for (int i = 1; i + 1 < n; ++i) {
    for (const int meridian : {0, i + 1, i}) mesh.indices.push_back(index(0, meridian, n));
    for (const int meridian : {0, i, i + 1}) mesh.indices.push_back(index(levels - 1, meridian, n));
  }
  return mesh;
}

/// One meridian for each side of the circle; core points are on its rim (`core` 1) or its axis (0).
std::vector<Meridian> circle(int sides, float core) {
  std::vector<Meridian> meridians;
  for (int i = 0; i < sides; ++i) {
    const float longitude = 4 * kQuarter * static_cast<float>(i) / static_cast<float>(sides);
    meridians.push_back({core * std::cos(longitude), core * std::sin(longitude), longitude});
  }
  return meridians;
}

}  // namespace

Mesh capsule_mesh(int sides) { return rounded_mesh(circle(sides, 0), sides / 5, false); }

Mesh cylinder_mesh(int sides) { return rounded_mesh(circle(sides, 1), 3, true); }

Mesh box_mesh() {
  constexpr int kSteps = 6;
  std::vector<Meridian> meridians;
  for (int quadrant = 0; quadrant < 4; ++quadrant)
    for (int i = 0; i <= kSteps; ++i)
      meridians.push_back({quadrant == 0 || quadrant == 3 ? 1.0F : -1.0F, quadrant < 2 ? 1.0F : -1.0F,
                           kQuarter * (static_cast<float>(quadrant) + static_cast<float>(i) / kSteps)});
  return rounded_mesh(meridians, kSteps, true);
}

Mesh faceted_mesh(const model::ConvexMesh& polyhedron) {
  Mesh mesh;
  for (int face = 0; face < polyhedron.face_count(); ++face) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    const auto corners = polyhedron.corners(face);
    for (const unsigned corner : corners)
      mesh.vertices.push_back(
          {polyhedron.vertex(corner).cast<float>(), polyhedron.normal(face).cast<float>()});
    for (std::uint32_t i = 1; i + 1 < corners.size(); ++i)
      for (const std::uint32_t v : {first, first + i, first + i + 1}) mesh.indices.push_back(v);
  }
  return mesh;
}

Mesh cone_mesh(float length) {
  constexpr int kSides = 32;
  Mesh mesh;
  const Eigen::Vector3f tip = Eigen::Vector3f::UnitZ();
  for (const Meridian& meridian : circle(kSides, 1)) {
    const Eigen::Vector3f rim = {meridian.x, meridian.y, 0};
    const Eigen::Vector3f slope = Eigen::Vector3f(length * meridian.x, length * meridian.y, 1).normalized();
    mesh.vertices.push_back({rim, slope});
    mesh.vertices.push_back({tip, slope});
    mesh.vertices.push_back({rim, -tip});
  }
  const auto vertex = [](int side, int kind) {
    return static_cast<std::uint32_t>(3 * (side % kSides) + kind);
  };
  for (int i = 0; i < kSides; ++i) {
    for (const std::uint32_t v : {vertex(i, 0), vertex(i + 1, 0), vertex(i, 1)}) mesh.indices.push_back(v);
    if (i > 1)
      for (const std::uint32_t v : {vertex(0, 2), vertex(i, 2), vertex(i - 1, 2)}) mesh.indices.push_back(v);
  }
  return mesh;
}

Mesh ring_mesh(float inner) {
  constexpr std::uint32_t kSides = 32;
  Mesh mesh;
  for (const Meridian& meridian : circle(kSides, 1))
    for (const float radius : {inner, 1.0F})
      mesh.vertices.push_back({{radius * meridian.x, radius * meridian.y, 0}, Eigen::Vector3f::UnitZ()});
  for (std::uint32_t i = 0; i < 2 * kSides; i += 2) {
    const std::uint32_t next = (i + 2) % (2 * kSides);
    for (const std::uint32_t v : {i, i + 1, next + 1, i, next + 1, next}) mesh.indices.push_back(v);
  }
  return mesh;
}

}  // namespace handsim::output
