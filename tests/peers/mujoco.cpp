// MuJoCo: the tree in joint coordinates, each loop closed by a `connect` equality. Methods `euler`
// (semi-implicit), `rk4` and `implicit`, and of newer versions `implicitfast` and `discrete`. The constraint
// is as stiff as MuJoCo lets it be: impedance 0.9999, time constant 2 steps (1 with rk4, where the guard
// against shorter ones has to be off).
#include <cstddef>
#include <cstdio>
#include <map>
#include <stdexcept>

#include "mujoco_model.h"
#include "peer.h"

namespace {

using mujoco::compile;
using mujoco::Free;
using peer::Joint;
using peer::Request;
using peer::Vec3;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g ", value);
  return text;
}

std::string numbers(const Vec3& v) { return number(v.x()) + number(v.y()) + number(v.z()); }

std::string joint_elements(const Request& request, const Joint& joint) {
  const Eigen::Isometry3d world_to_child = request.child(joint).pose().inverse();
  std::string xml;
  for (const Vec3& axis : joint.axes)
    xml += std::string("<joint type='") + (joint.kind == peer::JointKind::slider ? "slide" : "hinge") +
           "' pos='" + numbers(world_to_child * joint.anchor) + "' axis='" +
           numbers(world_to_child.linear() * axis) + "'/>";
  return xml;
}

/// The body of a joint's child and all that hangs on it. Body frames stand at centres of mass.
std::string body_element(const Request& request, const Joint& joint) {
  const peer::Body& body = request.child(joint);
  const Eigen::Isometry3d pose = request.parent_pose(joint).inverse() * body.pose();
  const Eigen::Quaterniond q(pose.linear());
  const Eigen::Matrix3d& i = body.inertia;
  std::string xml = "<body name='" + std::to_string(joint.child) + "' pos='" + numbers(pose.translation()) +
                    "' quat='" + number(q.w()) + numbers(q.vec()) + "'><inertial pos='0 0 0' mass='" +
                    number(body.mass) + "' fullinertia='" + numbers(i.diagonal()) +
                    numbers({i(0, 1), i(0, 2), i(1, 2)}) + "'/>" + joint_elements(request, joint);
  for (const Joint& next : request.joints)
    if (!next.closes_loop && next.parent == joint.child) xml += body_element(request, next);
  return xml + "</body>";
}

std::string model_text(const Request& request) {
  const bool rk4 = request.method == "rk4";
  const std::map<std::string, std::string> methods = {
    {"euler", "Euler"},
    {"rk4", "RK4"},
    {"implicit", "implicit"},
#if mjVERSION_HEADER >= 4000000
    {"implicitfast", "implicitfast"},
    {"discrete", "discrete"},
#endif
  };
  const auto method = methods.find(request.method);
  if (method == methods.end())
    throw std::runtime_error(std::string("MuJoCo ") + mj_versionString() + " has no method " +
                             request.method);
  std::string xml = std::string("<mujoco><compiler angle='radian'/><option timestep='") +
                    number(request.step) + "' gravity='" + numbers(request.gravity) + "' integrator='" +
                    method->second + "'><flag contact='disable' refsafe='" + (rk4 ? "disable" : "enable") +
                    "'/></option><worldbody>";
  for (const Joint& joint : request.joints)
    if (!joint.closes_loop && joint.parent == peer::kGround) xml += body_element(request, joint);
  xml += "</worldbody><equality>";
  for (const Joint& joint : request.joints)
    if (joint.closes_loop)
      xml += "<connect body1='" + std::to_string(joint.parent) + "' body2='" + std::to_string(joint.child) +
             "' anchor='" + numbers(request.parent_pose(joint).inverse() * joint.anchor) +
             "' solimp='0.9999 0.9999 0.001 0.5 2' solref='" + number((rk4 ? 1 : 2) * request.step) + "1'/>";
  return xml + "</equality></mujoco>";
}

class Mechanism final : public peer::Mechanism {
 public:
  explicit Mechanism(const Request& request)
      : model_(compile(model_text(request))),
        data_(mj_makeData(model_.get())),
        view_(mj_makeData(model_.get())) {
    for (std::size_t i = 0; i < request.bodies.size(); ++i)
      ids_.push_back(mj_name2id(model_.get(), mjOBJ_BODY, std::to_string(i).c_str()));
    for (const Joint& joint : request.joints) {
      const std::vector<double> rates = request.rates(joint);
      const int first = model_->body_dofadr[ids_[static_cast<std::size_t>(joint.child)]];
      for (std::size_t a = 0; a < rates.size(); ++a) {
        data_->qvel[first + static_cast<int>(a)] = rates[a];
        data_->qfrc_applied[first + static_cast<int>(a)] = joint.forces[a];
      }
    }
  }

  void step() override {
    mj_step(model_.get(), data_.get());
    // MuJoCo starts anew from the initial state where a state is bad.
    if (data_->warning[mjWARN_BADQPOS].number + data_->warning[mjWARN_BADQVEL].number +
            data_->warning[mjWARN_BADQACC].number >
        0)
      throw std::runtime_error("MuJoCo: the state left its bounds");
  }

  double time() const override { return data_->time; }

  std::vector<peer::BodyState> state() override {
    look();
    std::vector<peer::BodyState> out;
    for (const int id : ids_) {
      peer::BodyState& body = out.emplace_back();
      const mjtNum* q = view_->xquat + std::ptrdiff_t{4} * id;
      mjtNum twist[6];
      mj_objectVelocity(model_.get(), view_.get(), mjOBJ_BODY, id, twist, 0);
      body.position = Eigen::Map<const Vec3>(view_->xpos + std::ptrdiff_t{3} * id);
      body.orientation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
      body.angular_velocity = Eigen::Map<const Vec3>(twist);
      body.velocity = Eigen::Map<const Vec3>(twist + 3);
    }
    return out;
  }

  double kinetic_energy() override {
    look();
    std::vector<mjtNum> momentum(static_cast<std::size_t>(model_->nv));
    mj_mulM(model_.get(), view_.get(), momentum.data(), view_->qvel);
    return mju_dot(momentum.data(), view_->qvel, static_cast<int>(model_->nv)) / 2;
  }

 private:
  /// Body poses and velocities of the state after the step: those in data_ belong to the state before it.
  void look() {
    mju_copy(view_->qpos, data_->qpos, static_cast<int>(model_->nq));
    mju_copy(view_->qvel, data_->qvel, static_cast<int>(model_->nv));
    mj_fwdPosition(model_.get(), view_.get());
    mj_fwdVelocity(model_.get(), view_.get());
  }

  std::unique_ptr<mjModel, Free> model_;
  std::unique_ptr<mjData, Free> data_, view_;
  std::vector<int> ids_;  ///< MuJoCo's of each body of the request
};

std::unique_ptr<peer::Mechanism> make(const Request& request) { return std::make_unique<Mechanism>(request); }

}  // namespace

int main() {
  mujoco::report_on_standard_error();
  return peer::serve({"MuJoCo", mj_versionString(), {}, make});
}
