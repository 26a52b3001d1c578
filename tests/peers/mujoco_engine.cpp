#include "peers/mujoco_engine.h"

#include <algorithm>
#include <map>
#include <mutex>

#include "handsim/model/kinematics.h"
#include "peers/mujoco_model.h"
#include "support/written.h"

namespace handsim::peers {

namespace {

using mujoco::Free;

int integrator_of(const std::string& name) {
  static const std::map<std::string, int> kNames = {
    {"Euler", mjINT_EULER},
    {"RK4", mjINT_RK4},
    {"implicit", mjINT_IMPLICIT},
#if mjVERSION_HEADER >= 320
    {"implicitfast", mjINT_IMPLICITFAST},
#endif
#if mjVERSION_HEADER >= 4000000
    {"discrete", mjINT_DISCRETE},
#endif
  };
  const auto found = kNames.find(name);
  if (found == kNames.end())
    throw input_error("integrator", name, std::string("one of MuJoCo ") + mj_versionString());
  return found->second;
}

class MujocoEngine final : public OtherEngine {
 public:
  MujocoEngine(const model::Model& model, const engine::Settings& settings, const MujocoOptions& options)
      : OtherEngine(model, settings) {
    {
      static std::mutex one_at_a_time;
      const std::lock_guard lock(one_at_a_time);
      model_there_ = mujoco::compile(test::written("mjcf", model, settings));
    }
    choose(options);
    if (options.stiff) stiffen();
    surfaces();
    data_.reset(mj_makeData(model_there_.get()));
    find_names();
    put(model::initial_state(model));
  }

  std::string version() const override { return std::string("MuJoCo ") + mj_versionString(); }

 protected:
  void put(const model::State& state) override {
    mjModel* m = model_there_.get();
    mj_resetData(m, data_.get());
    data_->time = state.time;
    for (std::size_t i = 1; i < model_.bodies.size(); ++i) {
      const int joint = m->body_jntadr[bodies_[i]];
      if (joint < 0 || m->jnt_type[joint] != mjJNT_FREE) continue;
      const model::BodyState& body = state.bodies[i];
      const Vec3 w = body.q.conjugate() * body.w;
      mjtNum* q = data_->qpos + m->jnt_qposadr[joint];
      mjtNum* u = data_->qvel + m->jnt_dofadr[joint];
      const double pose[] = {body.p.x(), body.p.y(), body.p.z(), body.q.w(),
                             body.q.x(), body.q.y(), body.q.z()};
      std::copy(std::begin(pose), std::end(pose), q);
      std::copy(body.v.data(), body.v.data() + 3, u);
      std::copy(w.data(), w.data() + 3, u + 3);
    }
    for (std::size_t k = 0; k < coordinates_.size(); ++k) {
      if (coordinates_[k] < 0) continue;
      data_->qpos[m->jnt_qposadr[coordinates_[k]]] = state.q[k];
      data_->qvel[m->jnt_dofadr[coordinates_[k]]] = state.u[k];
    }
    for (const model::Joint& joint : model_.joints) put_ball(joint, state);
  }

  void advance(const engine::StepInput& input) override {
    mjModel* m = model_there_.get();
    for (std::size_t k = 0; k < coordinates_.size(); ++k) {
      if (coordinates_[k] < 0) continue;
      if (!input.torques.empty()) data_->qfrc_applied[m->jnt_dofadr[coordinates_[k]]] = input.torques[k];
      if (!input.servos.empty()) serve(static_cast<int>(k), input.servos[k]);
    }
    mj_step(m, data_.get());
    // MuJoCo starts anew from the initial state where a state is bad.
    if (data_->warning[mjWARN_BADQPOS].number + data_->warning[mjWARN_BADQVEL].number +
            data_->warning[mjWARN_BADQACC].number >
        0)
      fail("a state out of bounds");
  }

  void read(model::State& state, std::vector<engine::Contact>& contacts) override {
    mjModel* m = model_there_.get();
    mj_kinematics(m, data_.get());
    mj_comPos(m, data_.get());
    mj_comVel(m, data_.get());
    for (std::size_t i = 1; i < model_.bodies.size(); ++i) {
      if (model_.bodies[i].kinematic) continue;
      model::BodyState& body = state.bodies[i];
      const mjtNum* q = data_->xquat + std::ptrdiff_t{4} * bodies_[i];
      mjtNum twist[6];
      mj_objectVelocity(m, data_.get(), mjOBJ_BODY, bodies_[i], twist, 0);
      body.p = Eigen::Map<const Vec3>(data_->xpos + std::ptrdiff_t{3} * bodies_[i]);
      body.q = Quat(q[0], q[1], q[2], q[3]);
      body.w = Eigen::Map<const Vec3>(twist);
      body.v = Eigen::Map<const Vec3>(twist + 3);
    }
    for (int i = 0; i < data_->ncon; ++i) {
      const mjContact& contact = data_->contact[i];
      contacts.push_back({shapes_[static_cast<std::size_t>(contact.geom2)],
                          shapes_[static_cast<std::size_t>(contact.geom1)],
                          Eigen::Map<const Vec3>(contact.pos), Eigen::Map<const Vec3>(contact.frame),
                          -contact.dist, Vec3::Zero()});
    }
  }

 private:
  void choose(const MujocoOptions& options) {
    mjOption& own = model_there_->opt;
    own.integrator = integrator_of(options.integrator);
    own.cone = options.elliptic ? mjCONE_ELLIPTIC : mjCONE_PYRAMIDAL;
    own.impratio = options.impratio;
    own.noslip_iterations = options.noslip;
    if (!tests_contacts()) own.disableflags |= mjDSBL_CONTACT;
#if mjVERSION_HEADER >= 4000000
    if (options.speculative) own.enableflags |= mjENBL_SPECULATIVE;
#else
    if (options.speculative) throw input_error("speculative", "asked for", "MuJoCo 4");
#endif
  }

  void stiffen() {
    mjModel* m = model_there_.get();
    const auto set = [&](mjtNum* reference, mjtNum* impedance, int count) {
      for (int i = 0; i < count; ++i) {
        reference[mjNREF * i] = 2 * settings_.step;
        impedance[mjNIMP * i] = impedance[mjNIMP * i + 1] = 0.99;
      }
    };
    set(m->geom_solref, m->geom_solimp, static_cast<int>(m->ngeom));
    set(m->pair_solref, m->pair_solimp, static_cast<int>(m->npair));
    set(m->jnt_solref, m->jnt_solimp, static_cast<int>(m->njnt));
    set(m->eq_solref, m->eq_solimp, static_cast<int>(m->neq));
  }

  /// MuJoCo takes the greater of two friction coefficients, handsim their geometric mean.
  void surfaces() {
    mjModel* m = model_there_.get();
    const std::optional<double> friction = common_friction();
    if (!friction && tests_contacts()) throw input_error("materials", "several friction coefficients", "one");
    for (int i = 0; i < m->ngeom; ++i)
      if (friction == 0.0) m->geom_condim[i] = 1;
  }

  void find_names() {
    mjModel* m = model_there_.get();
    bodies_.assign(model_.bodies.size(), 0);
    for (std::size_t i = 1; i < bodies_.size(); ++i)
      bodies_[i] = mj_name2id(m, mjOBJ_BODY, model_.bodies[i].name.c_str());
    shapes_.assign(static_cast<std::size_t>(m->ngeom), 0);
    for (std::size_t i = 0; i < model_.shapes.size(); ++i)
      shapes_[static_cast<std::size_t>(mj_name2id(m, mjOBJ_GEOM, model_.shapes[i].name.c_str()))] =
          static_cast<int>(i);
    coordinates_.assign(static_cast<std::size_t>(model_.dof_count()), -1);
    motors_ = coordinates_;
    for (const model::Joint& joint : model_.joints)
      for (std::size_t a = 0; a < joint.axes.size() && !joint.closes_loop; ++a) {
        const std::string name = joint.name + "." + joint.axes[a].name;
        const std::size_t k = static_cast<std::size_t>(joint.first_dof) + a;
        coordinates_[k] = mj_name2id(m, mjOBJ_JOINT, name.c_str());
        motors_[k] = mj_name2id(m, mjOBJ_ACTUATOR, name.c_str());
      }
    for (int i = 0; i < m->nu; ++i) {
      m->actuator_biastype[i] = mjBIAS_AFFINE;
      m->actuator_gainprm[mjNGAIN * i] = 0;
      m->actuator_forcelimited[i] = 1;
    }
  }

  /// The spring at the step's end in first order, as a position actuator.
  void serve(int k, const model::Servo& servo) {
    mjModel* m = model_there_.get();
    const int i = motors_[static_cast<std::size_t>(k)];
    const int joint = coordinates_[static_cast<std::size_t>(k)];
    const bool on = servo.limit > 0;
    mjtNum* bias = m->actuator_biasprm + std::ptrdiff_t{mjNBIAS} * i;
    m->actuator_gainprm[mjNGAIN * i] = on ? servo.stiffness : 0;
    bias[0] = on ? servo.feed : 0;
    bias[1] = on ? -servo.stiffness : 0;
    bias[2] = on ? -std::max(servo.damping, settings_.step * servo.stiffness) : 0;
    m->actuator_forcerange[2 * i] = -servo.limit;
    m->actuator_forcerange[2 * i + 1] = servo.limit;
    data_->ctrl[i] = data_->qpos[m->jnt_qposadr[joint]] + servo.error;
  }

  void put_ball(const model::Joint& joint, const model::State& state) {
    if (joint.kind != model::JointKind::ball || joint.closes_loop) return;
    mjModel* m = model_there_.get();
    const int id = mj_name2id(m, mjOBJ_JOINT, joint.name.c_str());
    const double* q = state.q.data() + joint.first_dof;
    const double* u = state.u.data() + joint.first_dof;
    const Quat q_FM = rotation_quaternion({q[0], q[1], q[2]});
    const Quat& q_CM = joint.child_frame.q;
    const Quat turn = q_CM * q_FM * q_CM.conjugate();
    const Vec3 rate = q_CM * (q_FM.conjugate() * Vec3(u[0], u[1], u[2]));
    const double parts[] = {turn.w(), turn.x(), turn.y(), turn.z()};
    std::copy(std::begin(parts), std::end(parts), data_->qpos + m->jnt_qposadr[id]);
    std::copy(rate.data(), rate.data() + 3, data_->qvel + m->jnt_dofadr[id]);
  }

  std::unique_ptr<mjModel, Free> model_there_;
  std::unique_ptr<mjData, Free> data_;
  std::vector<int> bodies_;                ///< MuJoCo's, by body
  std::vector<int> shapes_;                ///< of MuJoCo's geoms
  std::vector<int> coordinates_, motors_;  ///< MuJoCo's joint and actuator, by coordinate; -1: none
};

}  // namespace

std::unique_ptr<engine::Engine> make_mujoco(const model::Model& model, const engine::Settings& settings,
                                            const MujocoOptions& options) {
  return std::make_unique<MujocoEngine>(model, settings, options);
}

}  // namespace handsim::peers
