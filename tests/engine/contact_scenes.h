// Solids, and contact scenes with closed forms, for the tests of all engines.
#pragma once

#include <cmath>
#include <initializer_list>
#include <string>

#include <gtest/gtest.h>

#include "engine/models.h"

namespace handsim::engine::test {

inline constexpr double kG = 9.80665;
/// What solids that touch need.
inline const std::initializer_list<model::Effect> kContact = {
    model::Effect::gravity, model::Effect::object_contact, model::Effect::friction};

inline Settings articulated_settings(std::initializer_list<model::Effect> effects, double step = 1e-3) {
  return settings(effects, step, ArticulatedMethod::semi_implicit_euler);
}

inline model::Shape sized(const std::string& name, model::ShapeKind kind, double radius, double length,
                          Vec3 edges = Vec3::Zero()) {
  model::Shape out = shape(name, kind, 0);
  out.radius = radius;
  out.length = length;
  out.edges = edges;
  return out;
}

/// Adds a free solid of uniform density with one shape.
inline int add_solid(model::Model& model, model::Shape shape, double mass, const Pose& at) {
  Vec3 inertia = Vec3::Constant(0.4 * mass * shape.radius * shape.radius);
  if (shape.kind == model::ShapeKind::box) {
    const Vec3 e = shape.edges.cwiseAbs2();
    inertia = mass / 12 * Vec3(e.y() + e.z(), e.z() + e.x(), e.x() + e.y());
  } else if (shape.kind != model::ShapeKind::sphere) {
    const double across = mass * (shape.radius * shape.radius / 4 + shape.length * shape.length / 12);
    inertia = Vec3(across, across, mass * shape.radius * shape.radius / 2);
  }
  shape.body = add_body(model, body(shape.name, mass, inertia, at));
  model.shapes.push_back(shape);
  return shape.body;
}

/// A ground tilted by `angle` about the horizontal direction `heading` [rad].
inline Quat tilted(double angle, double heading) {
  return rotation_quaternion(angle * Vec3(std::cos(heading), std::sin(heading), 0));
}

/// A box of 100 g, 40 mm, body 1, lying on tilted ground.
inline model::Model box_on_incline(const Quat& tilt, double friction = 0.5) {
  model::Model model = model::make_model();
  add_ground(model, friction, tilt);
  add_solid(model, sized("box", model::ShapeKind::box, 0, 0, Vec3::Constant(0.04)), 0.1,
            {tilt * Vec3(0, 0, 0.02), tilt});
  return model;
}

/// Speed of a box on an incline after 1 s, with Coulomb friction [m/s].
inline double gain_on_incline(double angle, double friction = 0.5) {
  return std::max(0.0, kG * (std::sin(angle) - friction * std::cos(angle)));
}

/// A ball of 100 g, 20 mm, body 1, its centre at `height` [m] above the ground.
inline model::Model ball_above_ground(double height, double restitution) {
  model::Model model = model::make_model();
  add_ground(model);
  model.materials[0].restitution = restitution;
  add_solid(model, sized("ball", model::ShapeKind::sphere, 0.02, 0), 0.1,
            {Vec3(0, 0, height), Quat::Identity()});
  return model;
}

/// Largest downward and upward speeds of body 1 within 0.6 s [m/s].
struct Bounce {
  double impact = 0, rebound = 0;
};
inline Bounce bounce(Engine& engine) {
  Bounce out;
  while (engine.state().time < 0.6) {
    const double up = engine.state().bodies[1].v.z();
    out.impact = std::max(out.impact, -up);
    out.rebound = std::max(out.rebound, up);
    engine.step({});
  }
  return out;
}

/// A ball of 100 g, 30 mm, body 1, on the ground: sliding at 1 m/s, rolling at 1 m/s under rolling friction,
/// or spinning at 50 rad/s under spinning friction.
enum class BallMotion { sliding, rolling, spinning };
inline constexpr double kBallRadius = 0.03, kBallFriction = 0.0015;
inline model::Model moving_ball(BallMotion motion) {
  model::Model model = model::make_model();
  add_ground(model, 0.8);
  model::Material& material = model.materials[0];
  const int ball = add_solid(model, sized("ball", model::ShapeKind::sphere, kBallRadius, 0), 0.1,
                             {Vec3(0, 0, kBallRadius), Quat::Identity()});
  model::Body& body = model.bodies[static_cast<std::size_t>(ball)];
  if (motion != BallMotion::spinning) body.initial_velocity = Vec3(1, 0, 0);
  if (motion == BallMotion::rolling) {
    material.rolling_friction = kBallFriction;
    body.initial_angular_velocity = Vec3(0, 1 / kBallRadius, 0);
  }
  if (motion == BallMotion::spinning) {
    material.spinning_friction = kBallFriction;
    body.initial_angular_velocity = Vec3(0, 0, 50);
  }
  return model;
}

/// Closed forms after 1 s: a ball that slides at v finally rolls at 5/7 v; rolling friction rho decelerates a
/// rolling ball by rho g / r / (1 + 2/5); spinning friction rho decelerates a spin by rho m g / I.
inline void expect_ball_as_in_closed_form(BallMotion motion, Engine& engine) {
  run(engine, 1000);
  const model::BodyState& now = engine.state().bodies[1];
  if (motion == BallMotion::spinning) {
    EXPECT_NEAR(now.w.z(), 50 - kBallFriction * kG / (0.4 * kBallRadius * kBallRadius), 0.3);
    return;
  }
  const double want = motion == BallMotion::sliding ? 5.0 / 7 : 1 - kBallFriction * kG / kBallRadius / 1.4;
  EXPECT_NEAR(now.v.x(), want, 5e-3);
  EXPECT_NEAR(now.w.y() * kBallRadius, want, 5e-3);
}

/// Root mean square of body 1's speed over 4 s, after the first second [m/s].
inline double rms_speed_at_rest(Engine& engine, double step) {
  run(engine, static_cast<int>(1 / step));
  double square = 0;
  const int steps = static_cast<int>(4 / step);
  for (int i = 0; i < steps; ++i) {
    engine.step({});
    square += engine.state().bodies[1].v.squaredNorm();
  }
  return std::sqrt(square / steps);
}

}  // namespace handsim::engine::test
