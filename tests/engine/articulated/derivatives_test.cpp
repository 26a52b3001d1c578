// Derivatives of a step against Richardson differences of steps solved to rounding, and of inverse dynamics
// against those of JointSpace.
#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "engine/contact_scenes.h"
#include "engine/models.h"
#include "handsim/engine/articulated/articulated_engine.h"

namespace handsim::engine::articulated {
namespace {

using model::Effect;
using model::JointKind;
using test::random_pose;
using test::random_vector;

/// Steps of a model from states beside a given one.
class Beside {
 public:
  Beside(const model::Model& model, const Settings& settings)
      : model_(model), engine_(model, settings), base_(engine_.state()) {
    for (std::size_t i = 1; i < model.bodies.size(); ++i) {
      const auto has_joint = [&](const model::Joint& joint) { return joint.child == static_cast<int>(i); };
      if (!model.bodies[i].kinematic && std::ranges::none_of(model.joints, has_joint))
        free_.push_back(static_cast<int>(i));
    }
    torques.resize(at(model.dof_count()));
  }

  int size() const { return model_.dof_count() + 6 * static_cast<int>(free_.size()); }
  void set(const model::State& state) { base_ = state; }
  const model::State& base() const { return base_; }

  StepDerivatives derivatives(StepDerivatives asked = {}) {
    engine_.set_state(base_);
    engine_.derive(&asked);
    engine_.step(input());
    engine_.derive(nullptr);
    reference_ = engine_.state();
    return asked;
  }

  /// (q', u') after a change of (q, u), positions against those of the step that `derivatives` made.
  Eigen::VectorXd next(const Eigen::VectorXd& change) {
    engine_.set_state(moved(change));
    StepDerivatives only;
    only.step_only = true;
    engine_.derive(&only);
    engine_.step(input());
    engine_.derive(nullptr);
    return apart(engine_.state());
  }
  Eigen::VectorXd next() { return next(Eigen::VectorXd::Zero(2 * size())); }

  std::vector<double> torques;
  std::vector<model::Servo> servos;
  std::vector<BodyForce> forces;
  std::vector<double> excitations;

 private:
  StepInput input() const {
    StepInput out;
    out.torques = torques;
    out.servos = servos;
    out.forces = forces;
    out.excitations = excitations;
    return out;
  }
  model::State moved(const Eigen::VectorXd& change) const {
    const int dofs = model_.dof_count(), n = size();
    model::State out = base_;
    std::vector<double> q = base_.q, u = base_.u;
    for (const model::Joint& joint : model_.joints)
      if (joint.kind == JointKind::ball) {
        const auto f = joint.first_dof;
        const Vec3 now(q[at(f)], q[at(f + 1)], q[at(f + 2)]);
        const Vec3 turned =
            rotation_vector(rotation_quaternion(change.segment<3>(f)) * rotation_quaternion(now));
        for (int k = 0; k < 3; ++k) q[at(f + k)] = turned[k];
      } else {
        for (int k = 0; k < dof_count(joint.kind); ++k)
          q[at(joint.first_dof + k)] += change[joint.first_dof + k];
      }
    for (int k = 0; k < dofs; ++k) u[at(k)] += change[n + k];
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const int c = dofs + 6 * static_cast<int>(i);
      model::BodyState& body = out.bodies[at(free_[i])];
      body.q = rotation_quaternion(change.segment<3>(c)) * body.q;
      body.p += change.segment<3>(c + 3);
      body.w += change.segment<3>(n + c);
      body.v += change.segment<3>(n + c + 3);
    }
    const std::vector<double> activation = out.activation;
    model::place_joints(model_, q, u, out);
    out.activation = activation;
    return out;
  }
  Eigen::VectorXd apart(const model::State& to) const {
    const int dofs = model_.dof_count(), n = size();
    Eigen::VectorXd out(2 * n);
    for (int k = 0; k < dofs; ++k) {
      out[k] = to.q[at(k)] - reference_.q[at(k)];
      out[n + k] = to.u[at(k)];
    }
    for (const model::Joint& joint : model_.joints) {
      if (joint.kind != JointKind::ball) continue;
      const auto f = at(joint.first_dof);
      const Quat a = rotation_quaternion(Vec3(to.q[f], to.q[f + 1], to.q[f + 2])),
                 b = rotation_quaternion(Vec3(reference_.q[f], reference_.q[f + 1], reference_.q[f + 2]));
      out.segment<3>(joint.first_dof) = rotation_vector(a * b.conjugate());
    }
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const int c = dofs + 6 * static_cast<int>(i);
      const model::BodyState &body = to.bodies[at(free_[i])], &was = reference_.bodies[at(free_[i])];
      out.segment<3>(c) = rotation_vector(body.q * was.q.conjugate());
      out.segment<3>(c + 3) = body.p - was.p;
      out.segment<3>(n + c) = body.w;
      out.segment<3>(n + c + 3) = body.v;
    }
    return out;
  }

  const model::Model& model_;
  ArticulatedEngine engine_;
  model::State base_, reference_;
  std::vector<int> free_;
};

/// A derivative by central differences at sizes h and h/2, extrapolated (an error of h^4).
Eigen::VectorXd richardson(double h, const std::function<Eigen::VectorXd(double)>& f) {
  const Eigen::VectorXd wide = (f(h) - f(-h)) / (2 * h), narrow = (f(h / 2) - f(-h / 2)) / h;
  return (4 * narrow - wide) / 3;
}

/// Largest difference of a column over the largest number of its half (q', u').
double error(const Eigen::VectorXd& found, const Eigen::VectorXd& oracle) {
  const Eigen::Index n = found.size() / 2;
  double out = 0;
  for (const Eigen::Index first : {Eigen::Index{0}, n})
    out = std::max(out, (found - oracle).segment(first, n).lpNorm<Eigen::Infinity>() /
                            std::max(1e-3, oracle.segment(first, n).lpNorm<Eigen::Infinity>()));
  return out;
}

double state_error(Beside& beside, double h = 1e-3) {
  const StepDerivatives found = beside.derivatives();
  for (const std::string& note : found.notes) ADD_FAILURE() << note;
  double most = 0;
  for (int j = 0; j < 2 * beside.size(); ++j) {
    const Eigen::VectorXd oracle = richardson(h, [&](double by) {
      Eigen::VectorXd change = Eigen::VectorXd::Zero(2 * beside.size());
      change[j] = by;
      return beside.next(change);
    });
    const double e = error(found.by_state.col(j), oracle);
    if (e > 1e-7)
      ADD_FAILURE() << "column " << j << " error " << e << "\n"
                    << found.by_state.col(j).transpose() << "\n"
                    << oracle.transpose();
    most = std::max(most, e);
  }
  return most;
}

double torque_error(Beside& beside, double h = 1e-4) {
  const StepDerivatives found = beside.derivatives();
  double most = 0;
  for (std::size_t j = 0; j < beside.torques.size(); ++j) {
    const double kept = beside.torques[j];
    most =
        std::max(most, error(found.by_torque.col(static_cast<Eigen::Index>(j)), richardson(h, [&](double by) {
                               beside.torques[j] = kept + by;
                               return beside.next();
                             })));
    beside.torques[j] = kept;
  }
  return most;
}

Settings smooth_settings() {
  Settings out =
      test::settings({Effect::gravity, Effect::joint_stops, Effect::passive_tissue, Effect::actuation}, 1e-3,
                     ArticulatedMethod::semi_implicit_euler);
  return out;
}

/// Trees of every kind of joint on the world and on a body that is fixed, and a free body.
model::Model every_joint(std::mt19937& random, bool free_body) {
  model::Model model = model::make_model();
  model::Body palm = test::body("palm", 0.3, {3e-4, 3e-4, 5e-4}, random_pose(random));
  palm.kinematic = true;
  test::add_body(model, palm);
  constexpr JointKind kKinds[] = {JointKind::hinge, JointKind::universal, JointKind::ball, JointKind::slider};
  std::uniform_real_distribution<double> u(0.5, 1.5);
  for (int i = 0; i < 12; ++i) {
    model::Body body = test::body("b" + std::to_string(i), 0.1 * u(random), Vec3::Zero());
    const Mat3 turn = rotation_quaternion(random_vector(random)).toRotationMatrix();
    body.inertia = turn * Mat3((1e-4 * Vec3(1 + u(random), 1 + u(random), 1 + u(random))).asDiagonal()) *
                   turn.transpose();
    body.inertia = 0.5 * (body.inertia + body.inertia.transpose()).eval();
    const int child = test::add_body(model, body);
    const int parent = i < 2 ? i : child - 1 - static_cast<int>(random() % 2);
    const JointKind kind = kKinds[i % 4];
    const Vec3 a = random_vector(random).normalized();
    std::vector<Vec3> axes;
    if (kind != JointKind::ball) axes.push_back(a);
    if (kind == JointKind::universal) axes.push_back(a.unitOrthogonal());
    model::Joint& joint = test::add_joint(model, "j" + std::to_string(i), kind, parent, child,
                                          random_pose(random, 0.1), random_pose(random, 0.1), axes);
    for (model::JointAxis& axis : joint.axes)
      if (i % 3 == 0) axis.tissue = model::Tissue{0.5, 1e-2, 0.1};
  }
  if (free_body) test::add_body(model, test::body("stone", 0.4, {2e-4, 3e-4, 4e-4}, random_pose(random)));
  return model;
}

/// A state with random coordinates and rates.
model::State scattered(const model::Model& model, std::mt19937& random, double q_size, double u_size) {
  std::uniform_real_distribution<double> unit(-1, 1);
  model::State state = model::initial_state(model);
  std::vector<double> q(at(model.dof_count())), u(q.size());
  for (double& each : q) each = q_size * unit(random);
  for (double& each : u) each = u_size * unit(random);
  for (std::size_t i = 1; i < state.bodies.size(); ++i) {
    if (model.bodies[i].kinematic) continue;
    state.bodies[i].w = 5 * random_vector(random);
    state.bodies[i].v = random_vector(random);
  }
  model::place_joints(model, q, u, state);
  return state;
}

TEST(Derivatives, OfTreesOfEveryJointAreThoseOfDifferences) {
  for (unsigned seed = 1; seed < 4; ++seed) {
    std::mt19937 random(seed);
    const model::Model model = every_joint(random, true);
    Beside beside(model, smooth_settings());
    beside.set(scattered(model, random, 0.7, 0.3));
    std::uniform_real_distribution<double> unit(-1, 1);
    for (double& each : beside.torques) each = 0.1 * unit(random);
    EXPECT_LT(state_error(beside), 1e-7);
    EXPECT_LT(torque_error(beside), 1e-7);
  }
}

}  // namespace
}  // namespace handsim::engine::articulated
