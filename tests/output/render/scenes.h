// Scenes and measures for the picture tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "handsim/output/render/renderer.h"

namespace handsim::output {

/// A capsule from a to b (centres of its caps).
inline DrawShape capsule(const Vec3& a, const Vec3& b, double radius, const Colour& colour) {
  const Vec3 along = b - a;
  return {{Core::box,
           {0, 0, along.norm() / 2},
           radius,
           {(a + b) / 2, Quat::FromTwoVectors(Vec3::UnitZ(), along)}},
          colour};
}

inline DrawShape ball(const Vec3& centre, double radius, const Colour& colour) {
  return {{Core::box, Vec3::Zero(), radius, {centre, Quat::Identity()}}, colour};
}

/// A camera that shows one list.
inline Camera framed_camera(View view, const Pose& hand_frame, model::Side side, const DrawList& list,
                            double aspect) {
  Framing framing(view, hand_frame, side, aspect);
  framing.add(list);
  return framing.camera();
}

/// A palm and five fingers in the hand frame, mirrored for a left hand; fingers in order from the thumb.
inline model::Model hand_model(model::Side side, const Pose& x_WH) {
  model::Model model = model::make_model();
  const auto add = [&](const Pose& x_H, model::Shape shape, model::Part part) {
    model::Body body;
    body.zero_pose = x_WH * (side == model::Side::left ? mirrored(x_H) : x_H);
    shape.body = static_cast<int>(model.bodies.size());
    shape.part = part;
    model.bodies.push_back(body);
    model.shapes.push_back(shape);
  };
  model::Shape palm;
  palm.kind = model::ShapeKind::box;
  palm.edges = {0.084, 0.094, 0.028};
  add({{0, 0.047, 0}, Quat::Identity()}, palm, model::Part::palm);
  model::Shape finger;
  finger.kind = model::ShapeKind::capsule;
  finger.radius = 0.009;
  finger.length = 0.07;
  finger.pose.q = Quat::FromTwoVectors(Vec3::UnitZ(), Vec3::UnitY());
  for (int i = 0; i < 5; ++i)
    add({{-0.055 + 0.024 * i, i == 0 ? 0.06 : 0.135, 0}, Quat::Identity()}, finger,
        static_cast<model::Part>(static_cast<int>(model::Part::thumb) + i));
  return model;
}

inline model::State at_zero(const model::Model& model) {
  model::State state;
  for (const model::Body& body : model.bodies)
    state.bodies.push_back({body.zero_pose.p, body.zero_pose.q, Vec3::Zero(), Vec3::Zero()});
  return state;
}

/// Projects points with a pinhole camera: pixels from the upper left corner, pixel centres at .5.
struct Projection {
  Vec3 x, y, z, eye;
  double focus, width, height;

  Projection(const Camera& camera, int w, int h) : eye(camera.position), width(w), height(h) {
    z = (camera.position - camera.target).normalized();
    x = camera.up.cross(z).normalized();
    y = z.cross(x);
    focus = h / 2.0 / std::tan(camera.field_of_view / 2);
  }
  Eigen::Vector2d operator()(const Vec3& p) const {
    const Vec3 v = p - eye;
    const double depth = -v.dot(z);
    return {width / 2 + focus * v.dot(x) / depth, height / 2 - focus * v.dot(y) / depth};
  }
};

inline int brightness(const Image& image, int x, int y) {
  const std::uint8_t* p = image.pixel(x, y);
  return p[0] + p[1] + p[2];
}

/// Largest difference of a colour component between two pictures at one pixel.
inline int difference(const Image& a, const Image& b, int x, int y) {
  int most = 0;
  for (int i = 0; i < 3; ++i) most = std::max(most, std::abs(a.pixel(x, y)[i] - b.pixel(x, y)[i]));
  return most;
}

/// Share of the pixels that differ by more than k in some component.
inline double share_differing(const Image& a, const Image& b, int k) {
  int count = 0;
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x) count += difference(a, b, x, y) > k;
  return static_cast<double>(count) / a.width / a.height;
}

}  // namespace handsim::output
