// Small models for the engine tests.
#pragma once

#include <bit>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/model/kinematics.h"

namespace handsim::engine::test {

using model::Effect;

inline Settings settings(std::initializer_list<Effect> effects, double step = 1e-3,
                         Method method = OdeMethod::world_step) {
  Settings out;
  out.step = step;
  out.use(method);
  for (const Effect effect : effects) out.effects.add(effect);
  return out;
}

inline void set_erp(Settings& settings, double erp) {
  std::visit([erp](auto& own) { own.erp = erp; }, settings.own);
}

/// Of engines that have one.
inline void set_tolerance(Settings& settings, double tolerance) {
  std::visit(
      [tolerance](auto& own) {
        if constexpr (requires { own.tolerance; }) own.tolerance = tolerance;
      },
      settings.own);
}

/// Continues from the state of another engine of the same model.
inline void resume(Engine& engine, const model::State& state, const std::string& bytes) {
  ArchiveReader in(bytes, "saved");
  engine.restore(state, in);
}

inline model::Body body(const std::string& name, double mass, const Vec3& inertia, const Pose& pose = {}) {
  model::Body out;
  out.name = name;
  out.mass = mass;
  out.inertia = inertia.asDiagonal();
  out.zero_pose = pose;
  return out;
}

inline int add_body(model::Model& model, model::Body body) {
  model.bodies.push_back(std::move(body));
  return static_cast<int>(model.bodies.size()) - 1;
}

/// Adds a joint between two bodies; axes along the given directions of F.
inline model::Joint& add_joint(model::Model& model, const std::string& name, model::JointKind kind,
                               int parent, int child, const Pose& parent_frame, const Pose& child_frame,
                               const std::vector<Vec3>& axes) {
  model::Joint joint;
  joint.name = name;
  joint.kind = kind;
  joint.parent = parent;
  joint.child = child;
  joint.parent_frame = parent_frame;
  joint.child_frame = child_frame;
  joint.first_dof = model.dof_count();
  for (std::size_t i = 0; i < axes.size(); ++i) {
    model::JointAxis axis;
    axis.name = "axis" + std::to_string(i);
    axis.axis = axes[i];
    joint.axes.push_back(axis);
  }
  model.joints.push_back(joint);
  model::Body& body = model.bodies[static_cast<std::size_t>(child)];
  body.zero_pose =
      model.bodies[static_cast<std::size_t>(parent)].zero_pose * parent_frame * child_frame.inverse();
  return model.joints.back();
}

/// A body of 0.1 kg hinged to the world about y at the origin, its centre of mass `arm` below along -z.
inline model::Model hinged_body(double arm = 0, const Vec3& inertia = {1e-4, 1e-4, 1e-4}) {
  model::Model model = model::make_model();
  add_body(model, body("bob", 0.1, inertia));
  add_joint(model, "pin", model::JointKind::hinge, 0, 1, {}, {Vec3(0, 0, arm), Quat::Identity()},
            {Vec3::UnitY()});
  return model;
}

inline Vec3 random_vector(std::mt19937& random) {
  std::uniform_real_distribution<double> u(-1, 1);
  return {u(random), u(random), u(random)};
}

inline Pose random_pose(std::mt19937& random, double size = 0.3) {
  return {size * random_vector(random), rotation_quaternion(2.0 * random_vector(random))};
}

inline model::Shape shape(const std::string& name, model::ShapeKind kind, int on) {
  model::Shape out;
  out.name = name;
  out.kind = kind;
  out.body = on;
  return out;
}

inline model::Material material(const std::string& name, double friction) {
  model::Material out;
  out.name = name;
  out.friction = friction;
  return out;
}

/// One contact group with contact within the group, one material, a ground plane on the world.
inline void add_ground(model::Model& model, double friction = 0.5, const Quat& tilt = Quat::Identity()) {
  model.groups = {{"all"}};
  model.contact_rules = {{0, 0}};
  model.materials = {material("rubber", friction)};
  model::Shape ground = shape("ground", model::ShapeKind::plane, 0);
  ground.pose.q = tilt;
  model.shapes.push_back(ground);
}

/// A palm (kinematic) and five fingers of three capsules: a universal joint and two hinges each.
inline model::Model five_fingers(bool stops, bool tissue, bool shapes = false) {
  model::Model model = model::make_model();
  model::Body palm = body("palm", 0.3, {3e-4, 3e-4, 5e-4});
  palm.kinematic = true;
  add_body(model, palm);
  if (shapes) {
    model.groups = {{"fingers"}};
    model.contact_rules = {{0, 0}};
    model.materials = {material("skin", 0.8)};
  }
  for (int finger = 0; finger < 5; ++finger) {
    int parent = 1;
    Pose at{Vec3(0.02 * (finger - 2), 0.05, 0), rotation_quaternion({-M_PI / 2, 0, 0})};
    for (int k = 0; k < 3; ++k) {
      const std::string name = "f" + std::to_string(finger) + "_" + std::to_string(k);
      const double length = 0.045 - 0.01 * k;
      const double mass = 0.015 - 0.004 * k;
      const double across = mass * length * length / 12 + mass * 64e-6 / 4;
      const int child = add_body(model, body(name, mass, {across, across, mass * 64e-6 / 2}));
      const bool knuckle = k == 0;
      model::Joint& joint = add_joint(
          model, name + "_joint", knuckle ? model::JointKind::universal : model::JointKind::hinge, parent,
          child, at, {Vec3(0, 0, -length / 2), Quat::Identity()},
          knuckle ? std::vector<Vec3>{Vec3::UnitX(), Vec3::UnitY()} : std::vector<Vec3>{Vec3::UnitX()});
      for (model::JointAxis& axis : joint.axes) {
        if (stops) axis.stop = model::Stop{-0.2, 1.2, 0};
        if (tissue) axis.tissue = model::Tissue{0.02, 2e-4, 0.1};
      }
      if (shapes) {
        model::Shape capsule = shape(name + "_capsule", model::ShapeKind::capsule, child);
        capsule.radius = 0.008;
        capsule.length = length;
        model.shapes.push_back(capsule);
      }
      parent = child;
      at = {Vec3(0, 0, length / 2), Quat::Identity()};
    }
  }
  return model;
}

/// All bits of the bodies' state and the time.
inline std::vector<std::uint64_t> bits(const model::State& state) {
  std::vector<std::uint64_t> out;
  const auto add = [&](double x) { out.push_back(std::bit_cast<std::uint64_t>(x)); };
  add(state.time);
  for (const model::BodyState& b : state.bodies) {
    for (int i = 0; i < 3; ++i) add(b.p[i]), add(b.v[i]), add(b.w[i]);
    for (int i = 0; i < 4; ++i) add(b.q.coeffs()[i]);
  }
  return out;
}

/// The message of the error that make_engine throws; empty if it does not throw.
inline std::string refusal(const model::Model& model, const Settings& with) {
  try {
    make_engine(model, with);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::input) throw;
    return error.what();
  }
  return "";
}

inline void run(Engine& engine, int steps) {
  for (int i = 0; i < steps; ++i) engine.step({});
}

}  // namespace handsim::engine::test
