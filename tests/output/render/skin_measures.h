// What tests measure on the skin of a hand.
#pragma once

#include <Eigen/LU>
#include <map>
#include <numbers>

#include "handsim/control/poses.h"
#include "handsim/hand/build.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/render/skin.h"
#include "scene_files.h"

namespace handsim::output {

using Edge = std::pair<std::uint32_t, std::uint32_t>;

/// How many triangles run along each directed edge.
inline std::map<Edge, int> directed_edges(const Skin& skin) {
  std::map<Edge, int> out;
  for (const auto& face : skin.faces)
    for (std::size_t i = 0; i < 3; ++i) ++out[{face[i], face[(i + 1) % 3]}];
  return out;
}

/// Vertices - edges + triangles: 2 for a closed surface in one piece without a hole.
inline long euler_characteristic(const Skin& skin) {
  return static_cast<long>(skin.points.size()) - static_cast<long>(skin.faces.size()) / 2;
}

/// Volume of the part of a closed surface with y above `from` (divergence theorem; the cut's own area is in a
/// plane through the origin of the sum, and adds nothing).
inline double volume_beyond(const Skin& skin, const std::vector<Vec3>& points, double from) {
  double sum = 0;
  for (const auto& face : skin.faces) {
    std::vector<Vec3> part;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3 a = points[face[i]] - from * Vec3::UnitY(),
                 b = points[face[(i + 1) % 3]] - from * Vec3::UnitY();
      if (a.y() >= 0) part.push_back(a);
      if ((a.y() >= 0) != (b.y() >= 0)) part.push_back(a + a.y() / (a.y() - b.y()) * (b - a));
    }
    for (std::size_t i = 1; i + 1 < part.size(); ++i) sum += part[0].dot(part[i].cross(part[i + 1])) / 6;
  }
  return sum;
}

/// Where the edges of the skin cross the plane at y: x and z [m].
inline std::vector<Eigen::Vector2d> section(const Skin& skin, const std::vector<Vec3>& points, double y) {
  std::vector<Eigen::Vector2d> cut;
  for (const auto& face : skin.faces)
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3 &a = points[face[i]], &b = points[face[(i + 1) % 3]];
      if ((a.y() < y) == (b.y() < y)) continue;
      const Vec3 p = a + (y - a.y()) / (b.y() - a.y()) * (b - a);
      cut.push_back({p.x(), p.z()});
    }
  return cut;
}

/// Breadth of the section [m].
inline double extent_at(const Skin& skin, const std::vector<Vec3>& points, double y) {
  double low = 1, high = -1;
  for (const Eigen::Vector2d& p : section(skin, points, y)) {
    low = std::min(low, p.x());
    high = std::max(high, p.x());
  }
  return high - low;
}

/// Circumference of a tape about the section [m].
inline double tape(const Skin& skin, const std::vector<Vec3>& points, double y) {
  const std::vector<Eigen::Vector2d> cut = section(skin, points, y);
  // Cauchy: the perimeter of the convex hull is the integral of its support over all directions.
  double sum = 0;
  constexpr int kDirections = 90;
  for (int k = 0; k < kDirections; ++k) {
    const double angle = 2 * std::numbers::pi * k / kDirections;
    double most = -1;
    for (const Eigen::Vector2d& p : cut)
      most = std::max(most, p.dot(Eigen::Vector2d(std::cos(angle), std::sin(angle))));
    sum += most;
  }
  return sum * 2 * std::numbers::pi / kDirections;
}

/// Angles of a named pose of the scene's pose file, for its first hand.
inline model::State in_pose(const scene::Scene& scene, const std::string& name) {
  const control::PoseFile& file = *scene.spec.control->poses;
  const control::HandAxes axes = control::hand_axes(scene.model, scene.model.hands.front());
  Diagnostics diagnostics;
  const std::vector<double> angles = control::pose_angles(name, file.poses.at(name), axes, diagnostics);
  std::vector<double> q(static_cast<std::size_t>(scene.model.dof_count()));
  for (std::size_t i = 0; i < angles.size(); ++i) q[axes.axes[i].dof] = angles[i];
  return model::state_at(scene.model, q);
}

/// X_HB of the skin's bodies at a state.
inline std::vector<Pose> in_hand(const scene::Scene& scene, const Skin& skin, const model::State& state) {
  const model::HandIndex& hand = scene.model.hands.front();
  const Pose x_HW = (state.bodies[static_cast<std::size_t>(hand.palm)].pose() * hand.wrist_frame).inverse();
  std::vector<Pose> out;
  for (const int body : skin.bodies)
    out.push_back(x_HW * state.bodies[static_cast<std::size_t>(body)].pose());
  return out;
}

/// A triangle that is turned over: it points against how the bodies that move its corners have turned it.
inline bool is_inverted(const Skin& skin, const std::vector<Pose>& bodies, const std::vector<Vec3>& points,
                        const std::array<std::uint32_t, 3>& face) {
  const auto normal = [&](const std::vector<Vec3>& p) {
    return Vec3((p[face[1]] - p[face[0]]).cross(p[face[2]] - p[face[0]]));
  };
  const Vec3 before = normal(skin.points);
  Vec3 turned = Vec3::Zero();
  for (const std::uint32_t corner : face)
    for (std::size_t b = 0; b < bodies.size(); ++b)
      turned += static_cast<double>(skin.weights(static_cast<long>(corner), static_cast<long>(b))) *
                (bodies[b].q * (skin.rest[b].q.conjugate() * before));
  return normal(points).dot(turned) < 0;
}

inline long inverted(const Skin& skin, const std::vector<Pose>& bodies, const std::vector<Vec3>& points) {
  return std::ranges::count_if(skin.faces,
                               [&](const auto& face) { return is_inverted(skin, bodies, points, face); });
}

}  // namespace handsim::output
