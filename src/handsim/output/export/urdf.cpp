#include "handsim/output/export/export.h"

#include <cmath>

#include <fmt/format.h>

#include "handsim/model/kinematics.h"
#include "handsim/output/export/export_tree.h"

namespace handsim::output {

namespace {

using model::Effect;

constexpr double kUnlimited = 1000, kVelocity = 1000;
/// The link in the middle of a universal joint: programs that read URDF require mass on every moving link.
constexpr double kMiddleMass = 1e-12, kMiddleInertia = 1e-14;

/// Roll, pitch and yaw: R = Rz(yaw) Ry(pitch) Rx(roll).
Vec3 roll_pitch_yaw(const Quat& q) {
  const Mat3 R = q.toRotationMatrix();
  const double pitch = std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0)));
  if (std::hypot(R(0, 0), R(1, 0)) < 1e-9) return {0, pitch, std::atan2(-R(0, 1), R(1, 1))};
  return {std::atan2(R(2, 1), R(2, 2)), pitch, std::atan2(R(1, 0), R(0, 0))};
}

std::string origin(const Pose& pose) {
  return fmt::format("<origin xyz=\"{}\" rpy=\"{}\"/>", numbers(pose.p), numbers(roll_pitch_yaw(pose.q)));
}

class UrdfWriter {
 public:
  UrdfWriter(const model::Model& model, const engine::Settings& settings, const control::Plan* plan)
      : model_(model), settings_(settings), plan_(plan), start_(model::initial_state(model)) {}

  std::string run() {
    check();
    line("<?xml version=\"1.0\"?>\n<robot name=\"handsim\">");
    for (std::size_t i = 0; i < model_.bodies.size(); ++i) link(static_cast<int>(i));
    for (std::size_t i = 1; i < model_.bodies.size(); ++i)
      if (!has_parent(model_, i))
        joint(model_.bodies[i].name + ".world", model_.bodies[i].kinematic ? "fixed" : "floating", "world",
              model_.bodies[i].name, start_.bodies[i].pose(), "");
    for (const model::Joint& each : model_.joints) add_joints(each);
    line("</robot>");
    return std::move(out_);
  }

 private:
  void line(const std::string& text) { out_ += text + "\n"; }

  void check() const {
    std::vector<Problem> problems;
    for (const model::Joint& each : model_.joints)
      if (each.closes_loop || each.spherical())
        problems.push_back({std::nullopt, each.name, each.closes_loop ? "a loop" : "a ball joint",
                            "a tree of hinges, universal joints and sliders, for URDF"});
    for (const model::Shape& shape : model_.shapes)
      if (shape.kind == model::ShapeKind::convex_mesh)
        problems.push_back({std::nullopt, shape.name, "a mesh, which URDF requires in a separate file",
                            "a box, sphere, cylinder or capsule, for URDF"});
    if (!problems.empty()) throw Error(std::move(problems));
  }

  void inertial(const Pose& pose, double mass, const Mat3& I) {
    line(
        fmt::format("    <inertial>{}<mass value=\"{:.17g}\"/><inertia ixx=\"{:.17g}\" ixy=\"{:.17g}\" "
                    "ixz=\"{:.17g}\" iyy=\"{:.17g}\" iyz=\"{:.17g}\" izz=\"{:.17g}\"/></inertial>",
                    origin(pose), mass, I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2)));
  }

  /// X_LB: a body's pose in its link frame, which is the frame of its joint.
  Pose in_link(int body) const {
    for (const model::Joint& each : model_.joints)
      if (each.child == body) return each.child_frame.inverse();
    return {};
  }

  void link(int index) {
    const model::Body& body = model_.bodies[as_index(index)];
    line(fmt::format("  <link name=\"{}\">", attribute(body.name)));
    if (index != model::kWorld) inertial(in_link(index), body.mass, body.inertia);
    for (const model::Shape& shape : model_.shapes)
      if (shape.body == index) collision(shape, in_link(index));
    line("  </link>");
  }

  void geometry(const Pose& pose, const std::string& text) {
    for (const char* use : {"visual", "collision"})
      line(fmt::format("    <{0}>{1}<geometry>{2}</geometry></{0}>", use, origin(pose), text));
  }

  void collision(const model::Shape& shape, const Pose& x_LB) {
    const Pose pose = x_LB * shape.pose;
    const std::string sphere = fmt::format("<sphere radius=\"{:.17g}\"/>", shape.radius);
    switch (shape.kind) {
      case model::ShapeKind::box:
        return geometry(pose, fmt::format("<box size=\"{}\"/>", numbers(shape.edges)));
      case model::ShapeKind::sphere:
        return geometry(pose, sphere);
      case model::ShapeKind::capsule:
        for (const double end : {-0.5, 0.5})
          geometry(pose * Pose{Vec3(0, 0, end * shape.length), Quat::Identity()}, sphere);
        [[fallthrough]];
      case model::ShapeKind::cylinder:
        return geometry(pose, fmt::format("<cylinder radius=\"{:.17g}\" length=\"{:.17g}\"/>", shape.radius,
                                          shape.length));
      case model::ShapeKind::convex_mesh:
        return;  // refused
      case model::ShapeKind::plane:
        // URDF has no plane: a wide block whose top lies in it.
        return geometry(pose * Pose{Vec3(0, 0, -0.5), Quat::Identity()}, "<box size=\"10 10 1\"/>");
    }
  }

  void joint(const std::string& name, const char* type, const std::string& parent, const std::string& child,
             const Pose& pose, const std::string& more) {
    line(fmt::format(
        "  <joint name=\"{}\" type=\"{}\">\n    {}<parent link=\"{}\"/><child link=\"{}\"/>{}\n  </joint>",
        attribute(name), type, origin(pose), attribute(parent), attribute(child), more));
  }

  double torque_limit(std::size_t dof) const {
    if (plan_)
      for (const control::DrivenAxis& axis : plan_->axes)
        if (axis.dof == dof) return axis.torque_limit;
    return kUnlimited;
  }

  void add_joints(const model::Joint& each) {
    const std::string& child = model_.bodies[as_index(each.child)].name;
    // The joint frame F in the parent's link frame.
    Pose at_parent = in_link(each.parent) * each.parent_frame;
    std::string parent = model_.bodies[as_index(each.parent)].name;
    if (model_.bodies[as_index(each.child)].kinematic)
      return joint(each.name, "fixed", parent, child, at_parent, "");
    for (std::size_t i = 0; i < each.axes.size(); ++i) {
      const model::JointAxis& axis = each.axes[i];
      const bool last = i + 1 == each.axes.size();
      const std::string name = each.name + "." + axis.name, to = last ? child : name + ".middle";
      if (!last) {
        line(fmt::format("  <link name=\"{}\">", attribute(to)));
        inertial({}, kMiddleMass, kMiddleInertia * Mat3::Identity());
        line("  </link>");
      }
      const bool stopped = has_stop(axis, settings_);
      const double effort = torque_limit(as_index(each.first_dof) + i);
      const bool slider = each.slides(i);
      std::string more = fmt::format("<axis xyz=\"{}\"/>", numbers(axis.axis));
      const double far = slider ? 1e3 : 2 * M_PI;
      if (stopped || slider)
        more +=
            fmt::format("<limit lower=\"{:.17g}\" upper=\"{:.17g}\" effort=\"{:.17g}\" velocity=\"{:g}\"/>",
                        stopped ? axis.stop->low : -far, stopped ? axis.stop->high : far, effort, kVelocity);
      else
        more += fmt::format("<limit effort=\"{:.17g}\" velocity=\"{:g}\"/>", effort, kVelocity);
      if (axis.tissue && settings_.effects.has(Effect::passive_tissue))
        more += fmt::format("<dynamics damping=\"{:.17g}\" friction=\"0\"/>", axis.tissue->damping);
      joint(name, slider ? "prismatic" : (stopped ? "revolute" : "continuous"), parent, to, at_parent, more);
      parent = to;
      at_parent = {};
    }
  }

  const model::Model& model_;
  const engine::Settings& settings_;
  const control::Plan* plan_;
  model::State start_;
  std::string out_;
};

}  // namespace

std::string to_urdf(const model::Model& model, const engine::Settings& settings, const control::Plan* plan) {
  return UrdfWriter(model, settings, plan).run();
}

}  // namespace handsim::output
