#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/units.h"
#include "handsim/output/render/draw_list.h"

namespace handsim::output {

namespace {

/// Share of the half picture that stays empty on each side.
constexpr double kMargin = 0.07;

/// Unit vector from the scene to the camera, and the up direction of its picture.
struct Direction {
  Vec3 back;
  Vec3 up;
};

/// Raises a direction to at least 25 degrees above the horizon.
Vec3 from_above(const Vec3& direction) {
  const double lowest = std::sin(25 * kDegree);
  if (direction.z() >= lowest) return direction;
  Vec3 level = {direction.x(), direction.y(), 0};
  level = level.norm() > 1e-6 ? Vec3(level.normalized()) : Vec3(-Vec3::UnitY());
  return std::sqrt(1 - lowest * lowest) * level + lowest * Vec3::UnitZ();
}

Direction direction(View view, const Pose& hand_frame, model::Side side) {
  const Vec3 distal = hand_frame.q * Vec3::UnitY();
  const Vec3 dorsal = hand_frame.q * Vec3::UnitZ();
  const Vec3 radial = hand_frame.q * Vec3(side == model::Side::right ? -1 : 1, 0, 0);
  switch (view) {
    case View::dorsal:
      return {dorsal, distal};
    case View::palmar:
      return {-dorsal, distal};
    case View::radial:
      return {radial, dorsal};
    case View::three_quarter:
      break;
  }
  const Vec3 back = from_above((0.52 * radial + 0.52 * distal + 0.68 * dorsal).normalized());
  return {back, back.z() < 0.95 ? Vec3(Vec3::UnitZ()) : distal};
}

constexpr double kFieldOfView = 0.5;

}  // namespace

// In camera axes (x right, y up, z back) a point c lies left of the picture's right edge, for a camera at p
// and slope t of that edge, if c_x - p_x <= t (p_z - c_z), that is p_x + t p_z >= (x + t z) . c. The worst c
// is the support s_r of everything along x + t z; likewise s_l for the left edge. Both conditions hold, with
// equal distances left and right, at p_x = (s_r - s_l) / 2 and p_z >= (s_r + s_l) / (2 t). The same for y.
Framing::Framing(View view, const Pose& hand_frame, model::Side side, double aspect)
    : hand_frame_(hand_frame),
      slope_y_(std::tan(kFieldOfView / 2) * (1 - kMargin)),
      slope_x_(slope_y_ * aspect) {
  if (!(aspect > 0) || !std::isfinite(aspect))
    throw input_error("aspect", fmt::format("{}", aspect), "width over height, greater than 0");
  const Direction wanted = direction(view, hand_frame, side);
  z_ = wanted.back;
  x_ = wanted.up.cross(z_).normalized();
  y_ = z_.cross(x_);
  directions_ = {x_ + slope_x_ * z_, -x_ + slope_x_ * z_, y_ + slope_y_ * z_, -y_ + slope_y_ * z_, z_, -z_};
  extents_.fill(-std::numeric_limits<double>::infinity());
}

void Framing::add(const DrawList& list) {
  for (std::size_t i = 0; i < directions_.size(); ++i)
    extents_[i] = std::max(extents_[i], support(list, directions_[i]));
}

Camera Framing::camera(const Extents& extents) const {
  const auto [right, left, top, bottom, front, back] = extents;
  Camera camera;
  camera.field_of_view = kFieldOfView;
  camera.up = y_;
  if (!std::isfinite(front)) {
    // Empty lists: aim at the place of a hand.
    camera.target = hand_frame_ * Vec3(0, 0.09, 0);
    camera.position = camera.target + 0.6 * z_;
    return camera;
  }
  const double distance =
      std::max({(right + left) / (2 * slope_x_), (top + bottom) / (2 * slope_y_), front + 0.01});
  const Vec3 axis = (right - left) / 2 * x_ + (top - bottom) / 2 * y_;
  camera.position = axis + distance * z_;
  camera.target = axis + (front - back) / 2 * z_;
  return camera;
}

}  // namespace handsim::output
