#include "handsim/output/render/lighting.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/output/render/mesh.h"
#include "handsim/output/render/shaders.h"

namespace handsim::output {

namespace {

/// Smallest elevation of the key light over a ground (its sine).
constexpr double kLowestKey = 0.62;

/// Skin is shaded by its hand's shapes at this share of their radius: it lies outside, and its own shape, or
/// the next one at a joint, does not darken it.
constexpr double kUnderSkin = 0.8;
/// A box under skin is made smaller by this share of its half thickness: its skin is as round as possible.
constexpr double kUnderRoundSkin = 0.45;

/// The box about a mesh in the world, with the axes of a pose.
Solid box_about(const Mesh& mesh, const Pose& axes) {
  Vec3 low = Vec3::Constant(1e9), high = -low;
  for (const Vertex& vertex : mesh.vertices) {
    const Vec3 local = axes.inverse() * Vec3(vertex.core.cast<double>());
    low = low.cwiseMin(local);
    high = high.cwiseMax(local);
  }
  if (mesh.vertices.empty()) low = high = Vec3::Zero();
  return {Core::box, (high - low) / 2, 0, {axes * Vec3((low + high) / 2), axes.q}, {}};
}

/// Right, up and back directions of a camera.
struct CameraAxes {
  Vec3 x, y, z;
};

CameraAxes axes_of(const Camera& camera) {
  const Vec3 z = camera.position - camera.target;
  const Vec3 x = camera.up.cross(z);
  if (!(z.norm() > 0) || !(x.norm() > 1e-9 * z.norm() * camera.up.norm()) || !z.allFinite())
    throw input_error(
        "camera",
        fmt::format("position - target = ({:.3g}, {:.3g}, {:.3g}) m, up = ({:.3g}, {:.3g}, {:.3g})", z.x(),
                    z.y(), z.z(), camera.up.x(), camera.up.y(), camera.up.z()),
        "a target apart from the position, and an up that is not along the line of sight");
  if (!(camera.field_of_view > 0 && camera.field_of_view < 3))
    throw input_error("camera.field_of_view", fmt::format("{}", camera.field_of_view), "0..3 rad");
  const Vec3 right = x.normalized();
  const Vec3 back = z.normalized();
  return {right, back.cross(right), back};
}

Eigen::Matrix4f projected(const CameraAxes& axes, const Camera& camera, double aspect, double far) {
  const double near = far / 2000;
  const double slope = 1 / std::tan(camera.field_of_view / 2);
  Eigen::Matrix4d view = Eigen::Matrix4d::Identity();
  view.row(0) << axes.x.transpose(), -axes.x.dot(camera.position);
  view.row(1) << axes.y.transpose(), -axes.y.dot(camera.position);
  view.row(2) << axes.z.transpose(), -axes.z.dot(camera.position);
  Eigen::Matrix4d projection = Eigen::Matrix4d::Zero();
  projection(0, 0) = slope / aspect;
  projection(1, 1) = slope;
  projection(2, 2) = (far + near) / (near - far);
  projection(2, 3) = 2 * far * near / (near - far);
  projection(3, 2) = -1;
  return (projection * view).cast<float>();
}

/// From above and behind the left of the camera; the light moves with the camera.
Vec3 key_direction(const CameraAxes& axes, bool over_ground) {
  Vec3 key = (-0.62 * axes.x + 0.72 * axes.y + 0.62 * axes.z).normalized();
  if (!over_ground || key.z() >= kLowestKey) return key;
  const Vec3 level = Vec3(key.x(), key.y(), 0).normalized();
  return std::sqrt(1 - kLowestKey * kLowestKey) * level + kLowestKey * Vec3::UnitZ();
}

/// Sixteen directions perpendicular to the light; the opposite of entry i is entry i + 8.
std::vector<Vec3> separating_directions(const Vec3& to_key) {
  std::vector<Vec3> directions;
  const Vec3 u = to_key.unitOrthogonal();
  const Vec3 v = to_key.cross(u);
  for (int i = 0; i < 16; ++i) directions.push_back(std::cos(i * M_PI / 8) * u + std::sin(i * M_PI / 8) * v);
  return directions;
}

/// Supports of one solid along each separating direction, then along the light and against it.
std::vector<double> supports(const Solid& solid, const std::vector<Vec3>& across, const Vec3& to_key) {
  std::vector<double> out;
  for (const Vec3& n : across) out.push_back(support(solid, n));
  out.push_back(support(solid, to_key));
  out.push_back(support(solid, -to_key));
  return out;
}

/// What the solid with supports `theirs` may hide from the solid with supports `mine`; nothing: then it is
/// certain that a plane separates them by more than the half shadow and the sky's reach.
std::optional<Hides> may_hide(const std::vector<double>& theirs, const std::vector<double>& mine,
                              double sky_reach) {
  const std::size_t count = mine.size() - 2;
  // Distance of the occluder's highest point above the receiver's lowest point, along the light; and the
  // widest gap between the two, seen along the light or across it.
  const double above = theirs[count] + mine[count + 1];
  double gap = -above, across = -above;
  gap = std::max(gap, -theirs[count + 1] - mine[count]);
  for (std::size_t i = 0; i < count; ++i) {
    const double between = -theirs[(i + count / 2) % count] - mine[i];
    gap = std::max(gap, between);
    across = i == 0 ? between : std::max(across, between);
  }
  const bool key = above >= -sky_reach && across <= kLightSize * std::max(above, 0.0) + 0.1 * sky_reach;
  const bool sky = gap <= sky_reach;
  if (!key && !sky) return std::nullopt;
  return !sky ? Hides::key : key ? Hides::both : Hides::sky;
}

/// A solid that may shade another one.
struct Found {
  double distance = 0;  ///< to its bounding sphere [m]
  const Solid* solid = nullptr;
  Hides hides = Hides::both;
};

void collect_occluders(std::vector<LitSolid>& solids, const Vec3& to_key) {
  const std::vector<Vec3> across = separating_directions(to_key);
  std::vector<std::vector<double>> reaches, casts;
  for (const LitSolid& lit : solids) {
    reaches.push_back(supports(lit.solid, across, to_key));
    casts.push_back(lit.skin ? supports(lit.caster, across, to_key) : reaches.back());
  }
  std::vector<Found> found;
  for (std::size_t i = 0; i < solids.size(); ++i) {
    found.clear();
    for (std::size_t j = 0; j < solids.size(); ++j) {
      const Solid& other = solids[j].caster;
      if ((j == i && !solids[i].skin) || !solids[j].shades) continue;
      if (const auto hides = may_hide(casts[j], reaches[i], kSkyReach * other.thickness()))
        found.push_back({(other.pose.p - solids[i].solid.pose.p).norm() - other.reach(), &other, *hides});
    }
    // The nearest are kept.
    std::ranges::sort(found, [](const Found& a, const Found& b) { return a.distance < b.distance; });
    int capsules = 0, others = 0;
    std::erase_if(found, [&](const Found& one) {
      return ++(is_capsule(*one.solid) ? capsules : others) > kMaxOccluders;
    });
    std::ranges::stable_sort(found, [](const Found& a, const Found& b) { return a.hides < b.hides; });
    for (const Found& one : found) solids[i].occluders.add(*one.solid, one.hides);
  }
}

/// A rectangle of the ground, extended to contain others.
struct Rectangle {
  Eigen::Array2d low = Eigen::Array2d::Constant(1e30);
  Eigen::Array2d high = Eigen::Array2d::Constant(-1e30);

  void include(const Eigen::Array2d& from, const Eigen::Array2d& to, double border) {
    low = low.min(from - border);
    high = high.max(to + border);
  }
  Eigen::Vector4f packed() const {
    const Eigen::Array2d size = high - low;
    return Eigen::Vector4d(low.x(), low.y(), size.x(), size.y()).cast<float>();
  }
};

/// The part of the ground that the solid darkens, by its shadow or by hiding the sky.
Rectangle shade_of(const Solid& solid, double ground, const Vec3& to_key) {
  Eigen::Array2d low, high;
  for (int i = 0; i < 2; ++i) {
    low[i] = -support(solid, -Vec3::Unit(i));
    high[i] = support(solid, Vec3::Unit(i));
  }
  const double bottom = std::max(-support(solid, -Vec3::UnitZ()) - ground, 0.0);
  const double top = std::max(support(solid, Vec3::UnitZ()) - ground, 0.0);
  const Eigen::Array2d shift = -to_key.head<2>().array() / to_key.z();
  // The half shadow grows with the distance along the light, and on the ground with the light's slope.
  const double blur = kLightSize * top / (to_key.z() * to_key.z()) + 0.1 * solid.thickness();
  Rectangle area;
  area.include(low + (shift * bottom).min(shift * top), high + (shift * bottom).max(shift * top), blur);
  const double reach = kSkyReach * solid.thickness();
  if (bottom < reach) area.include(low, high, reach);
  return area;
}

Ground make_ground(double height, const std::vector<LitSolid>& solids, const Vec3& to_key, const Vec3& centre,
                   double radius) {
  Ground ground;
  ground.height = static_cast<float>(height);
  const double fade = 7 * radius + 2 * std::abs(centre.z() - height);
  ground.disc = Eigen::Vector4d(centre.x(), centre.y(), height, fade).cast<float>();
  ground.spacing = static_cast<float>(std::pow(10, std::floor(std::log10(3 * radius))));
  ground.line_width = 0.008F;
  Rectangle all;
  for (const LitSolid& lit : solids) {
    if (!lit.shades || support(lit.solid, Vec3::UnitZ()) <= height) continue;
    const Rectangle area = shade_of(lit.caster, height, to_key);
    all.include(area.low, area.high, 0);
    Shade& shade = ground.shades.emplace_back();
    shade.quad = area.packed();
    shade.occluder.add(lit.caster, Hides::both);
  }
  if (ground.shades.empty()) all.include({0, 0}, {1, 1}, 0);
  ground.region = all.packed();
  return ground;
}

}  // namespace

void Occluders::add(const Solid& solid, Hides hides) {
  const auto row = [](const Vec3& v, double w) {
    return Eigen::Vector4f(Eigen::Vector4d(v.x(), v.y(), v.z(), w).cast<float>());
  };
  OccluderRows& out = is_capsule(solid) ? capsules : solids;
  ++out.count;
  if (hides != Hides::sky) out.key_end = out.count;
  if (hides == Hides::key) out.sky_begin = out.count;
  if (is_capsule(solid)) {
    const Vec3 half = solid.pose.q * Vec3(0, 0, solid.half.z());
    out.rows.push_back(row(solid.pose.p - half, solid.round));
    out.rows.push_back(row(2 * half, 0));
    return;
  }
  out.rows.push_back(row(solid.pose.p, solid.round));
  out.rows.push_back(solid.pose.q.coeffs().cast<float>());
  // A hull shades like a box of 0.75 times the size of its bounding box.
  const Vec3 half = (solid.core == Core::hull ? 0.75 : 1) * solid.half;
  out.rows.push_back(row(half, solid.core == Core::cylinder ? 1 : 0));
}

LitScene::LitScene(const DrawList& drawn, const Camera& from, double aspect) : list(&drawn), camera(from) {
  const CameraAxes axes = axes_of(camera);
  const bool over_ground = drawn.ground_height && camera.position.z() > *drawn.ground_height;
  const Vec3 key = key_direction(axes, over_ground);
  to_key = key.cast<float>();
  to_fill = (0.55 * axes.x + 0.1 * axes.y + 0.83 * axes.z).cast<float>();
  sky_up = (over_ground ? Vec3(Vec3::UnitZ()) : Vec3((0.8 * axes.y + 0.6 * axes.z))).cast<float>();
  eye = camera.position.cast<float>();

  const Bounds box = bounds(drawn);
  const bool empty = !((box.high - box.low).norm() > 0);
  const Vec3 centre = empty ? camera.target : Vec3((box.low + box.high) / 2);
  const double distance = (camera.position - centre).norm();
  const double radius = empty ? distance / 4 : (box.high - box.low).norm() / 2;

  for (const DrawShape& shape : drawn.shapes) {
    LitSolid& lit = solids.emplace_back();
    static_cast<DrawShape&>(lit) = shape;
    lit.caster = lit.solid = bevelled(shape.solid);
    if (!shape.skin) continue;
    const double thickness = lit.caster.thickness();
    lit.caster = shape.solid;
    if (is_capsule(shape.solid))
      lit.caster.round *= kUnderSkin;
    else
      lit.caster.half -= Vec3::Constant(kUnderRoundSkin * thickness);
    lit.solid = box_about(*shape.skin, shape.solid.pose);
  }
  std::ranges::stable_sort(solids, [&](const LitSolid& a, const LitSolid& b) {
    return (a.solid.pose.p - b.solid.pose.p).dot(axes.z) > 0;
  });
  collect_occluders(solids, key);
  double far = distance + radius;
  if (over_ground) {
    ground = make_ground(*drawn.ground_height, solids, key, centre, radius);
    far += std::abs(centre.z() - *drawn.ground_height) + 1.5 * static_cast<double>(ground->disc.w());
  }
  view_projection = projected(axes, camera, aspect, far);
}

}  // namespace handsim::output
