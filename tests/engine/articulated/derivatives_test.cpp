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
using test::Difference;
using test::error;
using test::ridders;

/// Steps of a model from states beside a given one.
class Beside {
 public:
  Beside(const model::Model& model, const Settings& settings)
      : engine_(model, settings), base_(engine_.state()), coordinates_(model) {
    torques.resize(as_index(model.dof_count()));
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

/// Largest error of all columns by state where differences know better than 3e-8.
double state_error(Beside& beside, double h = 1e-3) {
  const StepDerivatives found = beside.derivatives();
  // Differences are of the same state, with what is left in pads.
  for (const std::string& note : found.notes)
    if (!note.starts_with("pads that relax")) ADD_FAILURE() << note;
  double most = 0;
  int known = 0;
  for (int j = 0; j < 2 * beside.size(); ++j) {
    const Difference oracle = ridders(j < beside.size() ? h : 10 * h, [&](double by) {
      Eigen::VectorXd change = Eigen::VectorXd::Zero(2 * beside.size());
      change[j] = by;
      return beside.next(change);
    });
    const double e = error(found.by_state.col(j), oracle.value);
    if (oracle.error > 3e-8) continue;
    ++known;
    if (e > 1e-7)
      ADD_FAILURE() << "column " << j << ", error " << e << "\n"
                    << (found.by_state.col(j) - oracle.value).transpose();
    most = std::max(most, e);
  }
  EXPECT_GE(known, 2 * beside.size() * 9 / 10);
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
  std::vector<double> q(as_index(model.dof_count())), u(q.size());
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

TEST(Derivatives, OfForcesOnBodiesAreThoseOfDifferences) {
  std::mt19937 random(5);
  const model::Model model = every_joint(random, true);
  Beside beside(model, smooth_settings());
  beside.set(scattered(model, random, 0.7, 0.3));
  for (const int body : {4, 9, 13, 14})
    beside.forces.push_back({body, random_vector(random), 0.1 * random_vector(random)});
  EXPECT_LT(state_error(beside), 1e-7);
  StepDerivatives asked;
  asked.forced = {4, 9, 13, 14};
  const Eigen::MatrixXd found = beside.derivatives(asked).by_force;
  for (std::size_t k = 0; k < asked.forced.size(); ++k)
    for (int j = 0; j < 6; ++j) {
      double& number = j < 3 ? beside.forces[k].force[j] : beside.forces[k].moment[j - 3];
      const double kept = number;
      const Difference oracle = ridders(1e-3, [&](double by) {
        number = kept + by;
        return beside.next();
      });
      number = kept;
      EXPECT_LT(error(found.col(6 * static_cast<Eigen::Index>(k) + j), oracle.value), 1e-7);
    }
}

Settings contact_settings() {
  return engine::test::settings({Effect::gravity, Effect::object_contact, Effect::friction}, 1e-3,
                                ArticulatedMethod::semi_implicit_euler);
}

/// A solid that touches the ground, its lowest point `depth` below it, and moves.
double error_on_ground(const model::Shape& shape, const model::Material& material, double height,
                       const Quat& turn, const Vec3& v, const Vec3& w) {
  model::Model model = model::make_model();
  engine::test::add_ground(model);
  model.materials[0] = material;
  engine::test::add_solid(model, shape, 0.1, {Vec3(0, 0, height), turn});
  Beside beside(model, contact_settings());
  model::State state = beside.base();
  state.bodies[1].v = v;
  state.bodies[1].w = w;
  beside.set(state);
  return state_error(beside, 1e-5);
}

TEST(Derivatives, OfSlidingBoxesAndRollingCapsulesAreThoseOfDifferences) {
  model::Material rubber = engine::test::material("rubber", 0.5);
  const model::Shape box = engine::test::sized("box", model::ShapeKind::box, 0, 0, Vec3(0.04, 0.05, 0.06));
  const Vec3 slow(0.3, -0.1, 0), spin(0.1, 0.2, 1.5);
  EXPECT_LT(error_on_ground(box, rubber, 0.02997, rotation_quaternion({0, 0, 0.4}), slow, {0, 0, 1}), 1e-7);
  EXPECT_LT(error_on_ground(box, rubber, 0.02997, rotation_quaternion({0, 0, 0.4}), {0, 0, 0}, {0, 0, 0}),
            1e-7);
  const model::Shape ball = engine::test::sized("ball", model::ShapeKind::sphere, 0.02, 0);
  rubber.spinning_friction = 0.002;
  rubber.rolling_friction = 0.001;
  EXPECT_LT(error_on_ground(ball, rubber, 0.01995, Quat::Identity(), slow, spin), 1e-7);
  rubber.compliance = model::Compliance{3000, 5};
  EXPECT_LT(error_on_ground(ball, rubber, 0.0199, Quat::Identity(), slow, spin), 1e-7);
  EXPECT_LT(error_on_ground(box, rubber, 0.0299, rotation_quaternion({0.001, 0.0007, 0.4}), slow, spin),
            1e-7);
  const model::Shape capsule = engine::test::sized("capsule", model::ShapeKind::capsule, 0.01, 0.05);
  EXPECT_LT(error_on_ground(capsule, rubber, 0.0099, rotation_quaternion({M_PI / 2, 0, 0.4}), slow, spin),
            1e-7);
}

// A pad that stiffens, with and without parts that relax, on one point, on points that share it and at its
// spin.
TEST(Derivatives, OfPadsThatStiffenAreThoseOfDifferences) {
  model::Material skin = engine::test::material("skin", 0.5);
  const Vec3 slow(0.3, -0.1, -0.05), spin(0.1, 0.2, 1.5);
  const model::Shape ball = engine::test::sized("ball", model::ShapeKind::sphere, 0.02, 0),
                     box = engine::test::sized("box", model::ShapeKind::box, 0, 0, Vec3(0.04, 0.05, 0.06)),
                     capsule = engine::test::sized("capsule", model::ShapeKind::capsule, 0.01, 0.05);
  const model::ForceCurve exponential = model::ForceCurve::exponential(3.67e-3, 0.27e-3),
                          table = model::ForceCurve::table({{1e-3, 0.5}, {2e-3, 3}, {3e-3, 20}});
  for (const model::ForceCurve& curve : {exponential, table}) {
    skin.compliance = model::Compliance{0, 3};
    skin.compliance->law = std::make_shared<const model::PadLaw>(
        model::PadLaw{curve, {{4e-3, 0.65}, {0.07, 0.15}, {1.4, 0.05}}, 0.01});
    for (const bool by_area : {false, true}) {
      skin.spins_by_area = by_area;
      EXPECT_LT(error_on_ground(ball, skin, 0.0182, Quat::Identity(), slow, spin), 1e-7);
      EXPECT_LT(error_on_ground(box, skin, 0.0285, rotation_quaternion({0.001, 0.0007, 0.4}), slow, spin),
                1e-7);
      EXPECT_LT(error_on_ground(capsule, skin, 0.0088, rotation_quaternion({M_PI / 2, 0, 0.4}), slow, spin),
                1e-7);
      EXPECT_LT(
          error_on_ground(capsule, skin, 0.0088, rotation_quaternion({M_PI / 2 + 0.004, 0, 0.4}), slow, spin),
          1e-7);
    }
  }
}

TEST(Derivatives, OfABallThatBouncesAreThoseOfDifferences) {
  model::Material rubber = engine::test::material("rubber", 0.5);
  rubber.restitution = 0.7;
  const model::Shape ball = engine::test::sized("ball", model::ShapeKind::sphere, 0.02, 0);
  EXPECT_LT(error_on_ground(ball, rubber, 0.01995, Quat::Identity(), {0.4, 0.1, -1}, {3, 2, 1}), 1e-7);
}

TEST(Derivatives, OfServosAndStopsThatBounceAreThoseOfDifferences) {
  model::Model model = engine::test::five_fingers(true, true);
  for (model::Joint& joint : model.joints)
    for (model::JointAxis& axis : joint.axes) axis.stop->restitution = 0.3;
  Beside beside(model, smooth_settings());
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  model::State state = beside.base();
  std::vector<double> q(as_index(model.dof_count())), u(q.size());
  for (std::size_t i = 0; i < q.size(); ++i) {
    q[i] = i % 4 == 0 ? 1.199 : unit(random);
    u[i] = i % 4 == 0 ? 4 : 0.5 * unit(random);
    beside.servos.push_back({i % 2 ? 0.5 : 0, i % 2 ? 0.01 : 0, 0.1, 0.02, i % 3 ? 1.0 : 0.01});
    if (i % 2 == 0) beside.servos.back().limit = 0;
  }
  model::place_joints(model, q, u, state);
  beside.set(state);
  EXPECT_LT(state_error(beside, 1e-5), 1e-7);
}

TEST(Derivatives, OfAJointAtRestOnItsStopAreSaidToHoldToOneSide) {
  model::Model model = engine::test::hinged_body();
  for (const double place : {0.0, 0.5}) {
    model.joints[0].axes[0].stop = model::Stop{place - 0.5, 0.5, 0};
    model.joints[0].axes[0].initial = place - 0.5;
    const std::vector<std::string> on_stop = Beside(model, smooth_settings()).derivatives().notes;
    model.joints[0].axes[0].initial = place - 0.4;
    const std::vector<std::string> off_stop = Beside(model, smooth_settings()).derivatives().notes;
    EXPECT_EQ(on_stop,
              std::vector<std::string>{"pin.axis0: on its stop: one-sided, for positions within the range"});
    EXPECT_TRUE(off_stop.empty());
  }
}

}  // namespace
}  // namespace handsim::engine::articulated
