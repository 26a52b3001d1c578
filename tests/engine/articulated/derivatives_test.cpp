// Derivatives of a step against Richardson differences of steps solved to rounding, and of inverse dynamics
// against those of JointSpace.
#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "engine/articulated/step_differences.h"
#include "engine/contact_scenes.h"
#include "engine/models.h"
#include "handsim/engine/articulated/articulated_engine.h"

namespace handsim::engine::articulated {
namespace {

using engine::test::random_pose;
using engine::test::random_vector;
using model::Effect;
using model::JointKind;
using test::Coordinates;
using test::error;
using test::ridders;

/// Steps of a model from states beside a given one.
class Beside {
 public:
  Beside(const model::Model& model, const Settings& settings)
      : engine_(model, settings), base_(engine_.state()), coordinates_(model) {
    torques.resize(at(model.dof_count()));
  }

  int size() const { return coordinates_.size(); }
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
    engine_.set_state(coordinates_.moved(base_, change));
    StepDerivatives only;
    only.step_only = true;
    engine_.derive(&only);
    engine_.step(input());
    engine_.derive(nullptr);
    return coordinates_.apart(engine_.state(), reference_);
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
  ArticulatedEngine engine_;
  model::State base_, reference_;
  Coordinates coordinates_;
};

double state_error(Beside& beside, double h = 1e-3) {
  const StepDerivatives found = beside.derivatives();
  for (const std::string& note : found.notes) ADD_FAILURE() << note;
  double most = 0;
  for (int j = 0; j < 2 * beside.size(); ++j) {
    const Eigen::VectorXd oracle = ridders(h, [&](double by) {
                                     Eigen::VectorXd change = Eigen::VectorXd::Zero(2 * beside.size());
                                     change[j] = by;
                                     return beside.next(change);
                                   }).value;
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
    most = std::max(most, error(found.by_torque.col(static_cast<Eigen::Index>(j)), ridders(h, [&](double by) {
                                                                                     beside.torques[j] =
                                                                                         kept + by;
                                                                                     return beside.next();
                                                                                   }).value));
    beside.torques[j] = kept;
  }
  return most;
}

Settings smooth_settings() {
  Settings out = engine::test::settings(
      {Effect::gravity, Effect::joint_stops, Effect::passive_tissue, Effect::actuation}, 1e-3,
      ArticulatedMethod::semi_implicit_euler);
  return out;
}

/// Trees of every kind of joint on the world and on a body that is fixed, and a free body.
model::Model every_joint(std::mt19937& random, bool free_body) {
  model::Model model = model::make_model();
  model::Body palm = engine::test::body("palm", 0.3, {3e-4, 3e-4, 5e-4}, random_pose(random));
  palm.kinematic = true;
  engine::test::add_body(model, palm);
  constexpr JointKind kKinds[] = {JointKind::hinge, JointKind::universal, JointKind::ball, JointKind::slider};
  std::uniform_real_distribution<double> u(0.5, 1.5);
  for (int i = 0; i < 12; ++i) {
    model::Body body = engine::test::body("b" + std::to_string(i), 0.1 * u(random), Vec3::Zero());
    const Mat3 turn = rotation_quaternion(random_vector(random)).toRotationMatrix();
    body.inertia = turn * Mat3((1e-4 * Vec3(1 + u(random), 1 + u(random), 1 + u(random))).asDiagonal()) *
                   turn.transpose();
    body.inertia = 0.5 * (body.inertia + body.inertia.transpose()).eval();
    const int child = engine::test::add_body(model, body);
    const int parent = i < 2 ? i : child - 1 - static_cast<int>(random() % 2);
    const JointKind kind = kKinds[i % 4];
    const Vec3 a = random_vector(random).normalized();
    std::vector<Vec3> axes;
    if (kind != JointKind::ball) axes.push_back(a);
    if (kind == JointKind::universal) axes.push_back(a.unitOrthogonal());
    model::Joint& joint = engine::test::add_joint(model, "j" + std::to_string(i), kind, parent, child,
                                                  random_pose(random, 0.1), random_pose(random, 0.1), axes);
    for (model::JointAxis& axis : joint.axes)
      if (i % 3 == 0) axis.tissue = model::Tissue{0.5, 1e-2, 0.1};
  }
  if (free_body)
    engine::test::add_body(model, engine::test::body("stone", 0.4, {2e-4, 3e-4, 4e-4}, random_pose(random)));
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
