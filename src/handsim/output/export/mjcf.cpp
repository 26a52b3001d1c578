#include "handsim/output/export/export.h"

#include <map>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "handsim/model/kinematics.h"
#include "handsim/output/export/export_tree.h"

namespace handsim::output {

namespace {

using model::Effect;

constexpr int kMostGroups = 32;
constexpr double kPlaneSpacing = 0.1;  ///< of the grid that MuJoCo draws [m]

class MjcfWriter {
 public:
  MjcfWriter(const model::Model& model, const engine::Settings& settings, const control::Plan* plan,
             const Keyframe* moment)
      : model_(model),
        settings_(settings),
        plan_(plan),
        start_(moment ? moment->state : model::initial_state(model)) {
    if (moment && !moment->drives.empty())
      collect_drives(moment->drives);
    else if (plan)
      collect_drives(*plan);
  }

  std::string run() {
    check();
    const Vec3 gravity = settings_.effects.has(Effect::gravity) ? model_.gravity : Vec3::Zero();
    line("<mujoco model=\"handsim\">");
    line("  <compiler angle=\"radian\" coordinate=\"local\" boundmass=\"0\" boundinertia=\"0\"/>");
    line(fmt::format("  <option timestep=\"{:.17g}\" gravity=\"{}\"{}/>", settings_.step, numbers(gravity),
                     solver()));
    meshes();
    line("  <worldbody>");
    shapes(model::kWorld, 4);
    for (std::size_t i = 1; i < model_.bodies.size(); ++i)
      if (!has_parent(model_, i)) root(static_cast<int>(i));
    children(model::kWorld, 4);
    line("  </worldbody>");
    contacts();
    loops();
    const MjcfTendons tendons = mjcf_tendons(model_, settings_, start_);
    if (!tendons.tendons.empty()) line("  <tendon>\n" + tendons.tendons + "  </tendon>");
    actuators_ += tendons.actuators;
    for (int i = 0; i < tendons.count; ++i) targets_ += " 0";
    if (!actuators_.empty()) line("  <actuator>\n" + actuators_ + "  </actuator>");
    if (!positions_.empty()) {
      const std::string targets = actuators_.empty() ? "" : fmt::format(" ctrl=\"{}\"", targets_.substr(1));
      line(fmt::format("  <keyframe>\n    <key name=\"initial\" qpos=\"{}\" qvel=\"{}\"{}/>\n  </keyframe>",
                       positions_.substr(1), velocities_.substr(1), targets));
    }
    line("</mujoco>");
    return std::move(out_);
  }

 private:
  void line(const std::string& text) { out_ += text + "\n"; }
  std::string name(int body) const { return attribute(model_.bodies[as_index(body)].name); }

  /// Friction as handsim has it: a round cone, no creep where surfaces stick. With servos: implicit dampers.
  std::string solver() const {
    std::string out;
    if (!model_.contact_rules.empty() && settings_.effects.has(Effect::friction))
      out += " cone=\"elliptic\" impratio=\"1000\" noslip_iterations=\"10\"";
    if (plan_ && plan_->form == control::Form::implicit_gain) out += " integrator=\"implicit\"";
    return out;
  }

  void collect_drives(const control::Plan& plan) {
    std::vector<std::vector<double>> of_hand;
    for (const control::HandPlan& hand : plan.hands) {
      of_hand.emplace_back(hand.trajectory.width());
      hand.trajectory.at(start_.time, of_hand.back());
    }
    for (const control::DrivenAxis& axis : plan.axes) {
      const double target = of_hand[axis.hand][axis.column];
      drives_[axis.dof] = {axis.proportional, axis.derivative, target - start_.q[axis.dof], 0,
                           axis.torque_limit};
    }
  }

  void collect_drives(const std::vector<model::Servo>& servos) {
    for (std::size_t dof = 0; dof < servos.size(); ++dof)
      if (servos[dof].limit > 0) drives_[dof] = servos[dof];
  }

  void check() const {
    std::vector<Problem> problems;
    if (model_.groups.size() > kMostGroups)
      problems.push_back(
          {std::nullopt, "groups", fmt::format("{}", model_.groups.size()), "at most 32 for MJCF"});
    for (const model::Joint& joint : model_.joints)
      if (joint.closes_loop && (joint.type().slides > 0 || joint.type().turns == 2))
        problems.push_back({std::nullopt, joint.name, "a loop closed by a universal or slider joint",
                            "a ball joint or hinge there, for MJCF"});
    if (!problems.empty()) throw Error(std::move(problems));
  }

  void open(int index, const Pose& pose, int indent) {
    const model::Body& body = model_.bodies[as_index(index)];
    const std::string in(as_index(indent), ' ');
    line(fmt::format("{}<body name=\"{}\" pos=\"{}\" quat=\"{}\"{}>", in, name(index), numbers(pose.p),
                     wxyz(pose.q), drive_of(model_, settings_, index) ? " mocap=\"true\"" : ""));
    // Principal axes: those that MuJoCo finds itself have an error of 1e-9.
    const Eigen::SelfAdjointEigenSolver<Mat3> principal(body.inertia);
    Mat3 axes = principal.eigenvectors();
    if (axes.determinant() < 0) axes.col(2) *= -1;
    line(fmt::format("{}  <inertial pos=\"0 0 0\" quat=\"{}\" mass=\"{:.17g}\" diaginertia=\"{}\"/>", in,
                     wxyz(Quat(axes)), body.mass, numbers(principal.eigenvalues())));
  }

  void root(int index) {
    const model::BodyState& body = start_.bodies[as_index(index)];
    open(index, body.pose(), 4);
    if (!model_.bodies[as_index(index)].kinematic) {
      line(fmt::format("      <freejoint name=\"{}\"/>", name(index)));
      positions_ += " " + numbers(body.p) + " " + wxyz(body.q);
      velocities_ += " " + numbers(body.v) + " " + numbers(body.q.conjugate() * body.w);
    }
    close(index, 4);
  }

  void children(int body, int indent) {
    for (const model::Joint& joint : model_.joints) {
      if (joint.closes_loop || joint.parent != body) continue;
      open(joint.child, joint.parent_frame * joint.child_frame.inverse(), indent);
      if (!model_.bodies[as_index(joint.child)].kinematic) add_joint(joint, indent + 2);
      close(joint.child, indent);
    }
  }

  void close(int index, int indent) {
    shapes(index, indent + 2);
    children(index, indent + 2);
    line(std::string(as_index(indent), ' ') + "</body>");
  }

  void add_joint(const model::Joint& joint, int indent) {
    const std::string in(as_index(indent), ' ');
    const double *q = start_.q.data() + joint.first_dof, *u = start_.u.data() + joint.first_dof;
    if (joint.spherical()) {
      line(fmt::format("{}<joint name=\"{}\" type=\"ball\" pos=\"{}\"/>", in, attribute(joint.name),
                       numbers(joint.child_frame.p)));
      // MuJoCo's ball joint has its rotation and rates in body axes.
      const Quat q_FM = rotation_quaternion({q[0], q[1], q[2]});
      const Quat& q_CM = joint.child_frame.q;
      positions_ += " " + wxyz(q_CM * q_FM * q_CM.conjugate());
      velocities_ += " " + numbers(q_CM * (q_FM.conjugate() * Vec3(u[0], u[1], u[2])));
      return;
    }
    for (std::size_t i = 0; i < joint.axes.size(); ++i) {
      const model::JointAxis& axis = joint.axes[i];
      const std::string name = attribute(joint.name + "." + axis.name);
      std::string text = fmt::format("{}<joint name=\"{}\" type=\"{}\" pos=\"{}\" axis=\"{}\"", in, name,
                                     joint.slides(i) ? "slide" : "hinge", numbers(joint.child_frame.p),
                                     numbers(joint.child_frame.q * axis.axis));
      if (has_stop(axis, settings_))
        text += fmt::format(" limited=\"true\" range=\"{:.17g} {:.17g}\"", axis.stop->low, axis.stop->high);
      else
        text += " limited=\"false\"";
      if (axis.tissue && settings_.effects.has(Effect::passive_tissue))
        text += fmt::format(" stiffness=\"{:.17g}\" springref=\"{:.17g}\" damping=\"{:.17g}\"",
                            axis.tissue->stiffness, axis.tissue->rest, axis.tissue->damping);
      line(text + "/>");
      add_actuator(name, as_index(joint.first_dof) + i);
      positions_ += fmt::format(" {:.17g}", q[i]);
      velocities_ += fmt::format(" {:.17g}", u[i]);
    }
  }

  /// MuJoCo's `position`, whose damping older versions do not read.
  void add_actuator(const std::string& name, std::size_t dof) {
    const auto found = drives_.find(dof);
    if (found == drives_.end()) {
      actuators_ += fmt::format("    <motor name=\"{}\" joint=\"{}\"/>\n", name, name);
      targets_ += " 0";
      return;
    }
    const model::Servo& drive = found->second;
    actuators_ += fmt::format(
        "    <general name=\"{0}\" joint=\"{0}\" gainprm=\"{1:.17g}\" biastype=\"affine\" biasprm=\"{2:.17g} "
        "-{1:.17g} -{3:.17g}\" forcelimited=\"true\" forcerange=\"-{4:.17g} {4:.17g}\"/>\n",
        name, drive.stiffness, drive.feed, drive.damping, drive.limit);
    targets_ += fmt::format(" {:.17g}", start_.q[dof] + drive.error);
  }

  /// Bits of the groups that a group has rules with: shapes touch if contype and conaffinity share one.
  unsigned affinity(int group) const {
    unsigned bits = 0;
    for (const model::ContactRule& rule : model_.contact_rules) {
      if (rule.group_a == group) bits |= 1U << as_index(rule.group_b);
      if (rule.group_b == group) bits |= 1U << as_index(rule.group_a);
    }
    return bits;
  }

  /// MuJoCo computes the convex hull of the vertices itself.
  void meshes() {
    std::string text;
    for (const model::Shape& shape : model_.shapes) {
      if (shape.kind != model::ShapeKind::convex_mesh) continue;
      text += fmt::format("    <mesh name=\"{}\" vertex=\"", attribute(shape.name));
      for (const Vec3& vertex : shape.mesh->vertices) text += numbers(vertex) + " ";
      text += "\"/>\n";
    }
    if (!text.empty()) line("  <asset>\n" + text + "  </asset>");
  }

  /// Type, and the attribute of its size.
  static std::pair<const char*, std::string> form_of(const model::Shape& shape) {
    const auto sized = [](const std::string& size) { return "size=\"" + size + "\""; };
    const std::string round = fmt::format("{:.17g} {:.17g}", shape.radius, 0.5 * shape.length);
    switch (shape.kind) {
      case model::ShapeKind::box:
        return {"box", sized(numbers(0.5 * shape.edges))};
      case model::ShapeKind::sphere:
        return {"sphere", sized(fmt::format("{:.17g}", shape.radius))};
      case model::ShapeKind::capsule:
        return {"capsule", sized(round)};
      case model::ShapeKind::cylinder:
        return {"cylinder", sized(round)};
      case model::ShapeKind::convex_mesh:
        return {"mesh", "mesh=\"" + attribute(shape.name) + "\""};
      case model::ShapeKind::plane:
        return {"plane", sized(fmt::format("0 0 {:g}", kPlaneSpacing))};
    }
    return {};
  }

  void shapes(int body, int indent) {
    for (const model::Shape& shape : model_.shapes) {
      if (shape.body != body) continue;
      const auto& [type, size] = form_of(shape);
      line(fmt::format(
          "{}<geom name=\"{}\" type=\"{}\" {} pos=\"{}\" quat=\"{}\" contype=\"{}\" "
          "conaffinity=\"{}\"{} mass=\"0\"/>",
          std::string(as_index(indent), ' '), attribute(shape.name), type, size, numbers(shape.pose.p),
          wxyz(shape.pose.q), 1U << as_index(shape.group), affinity(shape.group),
          mjcf_friction(model_.materials[as_index(shape.material)], settings_, false)));
    }
  }

  /// No contact between bodies that a joint connects; surfaces of pairs that MuJoCo would combine otherwise.
  void contacts() {
    std::string text;
    for (const model::Joint& joint : model_.joints)
      if (joint.parent != model::kWorld)
        text +=
            fmt::format("    <exclude body1=\"{}\" body2=\"{}\"/>\n", name(joint.parent), name(joint.child));
    text += mjcf_pairs(model_, settings_);
    if (!text.empty()) line("  <contact>\n" + text + "  </contact>");
  }

  void loops() {
    std::string text;
    const auto connect = [&](const model::Joint& joint, const Vec3& anchor) {
      text += fmt::format("    <connect body1=\"{}\" body2=\"{}\" anchor=\"{}\"/>\n", name(joint.child),
                          name(joint.parent), numbers(anchor));
    };
    for (const model::Joint& joint : model_.joints) {
      if (!joint.closes_loop) continue;
      connect(joint, joint.child_frame.p);
      // A hinge needs two points of its axis.
      if (joint.type().turns == 1) connect(joint, joint.child_frame * Vec3(0.01 * joint.axes[0].axis));
    }
    if (!text.empty()) line("  <equality>\n" + text + "  </equality>");
  }

  const model::Model& model_;
  const engine::Settings& settings_;
  const control::Plan* plan_;
  std::map<std::size_t, model::Servo> drives_;  ///< by dof, at the start
  model::State start_;
  std::string out_, actuators_, targets_, positions_, velocities_;
};

}  // namespace

Keyframe keyframe_after(const model::State& state, const control::Controller* controller) {
  Keyframe out{state, {}};
  if (!controller) return out;
  out.drives.assign(controller->servos().begin(), controller->servos().end());
  if (out.drives.empty()) return out;
  for (std::size_t i = 0; i < controller->axes().size(); ++i) {
    const control::AxisState& axis = controller->axes()[i];
    out.drives[controller->plan().axes[i].dof].error = axis.target - axis.angle;
  }
  return out;
}

std::string to_mjcf(const model::Model& model, const engine::Settings& settings, const control::Plan* plan,
                    const Keyframe* moment) {
  return MjcfWriter(model, settings, plan, moment).run();
}

}  // namespace handsim::output
