// Jacobians, mass matrix, inverse dynamics, energy and momentum of a tree that has every kind of joint, and
// of hands.
#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include <cmath>
#include <numeric>
#include <random>

#include "engine/models.h"
#include "engine/shared_motions.h"
#include "handsim/model/energy.h"
#include "handsim/model/newton_euler.h"

namespace handsim::model {
namespace {

using engine::test::add_body;
using engine::test::add_joint;

/// A base with two chains: hinge, universal, ball; and slider, hinge. Frames and axes are oblique.
Model tree(bool free) {
  Model model = make_model();
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&](double size) {
    const double x = uniform(random), y = uniform(random), z = uniform(random);
    return Vec3(size * Vec3(x, y, z));
  };
  const auto frame = [&] { return Pose{vector(0.1), rotation_quaternion(vector(1))}; };
  const auto next = [&](int parent, JointKind kind) {
    const int body =
        add_body(model, engine::test::body("b" + std::to_string(model.bodies.size()),
                                           0.2 + 0.1 * uniform(random), Vec3(1e-3, 1.2e-3, 0.9e-3)));
    const Vec3 a = vector(1).normalized(), b = a.cross(vector(1)).normalized();
    std::vector<Vec3> axes;
    if (kind != JointKind::ball) axes.push_back(a);
    if (kind == JointKind::universal) axes.push_back(b);
    add_joint(model, "j" + std::to_string(body), kind, parent, body, frame(), frame(), axes);
    return body;
  };
  Body base = engine::test::body("base", 0.5, {2e-3, 3e-3, 2.5e-3}, frame());
  base.kinematic = !free;
  const int root = add_body(model, base);
  next(next(next(root, JointKind::hinge), JointKind::universal), JointKind::ball);
  next(next(root, JointKind::slider), JointKind::hinge);
  return model;
}

std::vector<double> drawn(const Model& model, unsigned seed, double size) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-size, size);
  std::vector<double> out(static_cast<std::size_t>(model.dof_count()));
  for (double& each : out) each = uniform(random);
  return out;
}

std::vector<int> all_bodies(const Model& model) {
  std::vector<int> out(model.bodies.size());
  std::iota(out.begin(), out.end(), 0);
  return out;
}

/// A moving state of a tree, and its velocities as Jacobians take them.
struct Moving {
  State state;
  Eigen::VectorXd x;

  explicit Moving(const Model& model) : state(initial_state(model)) {
    const std::vector<double> q = drawn(model, 1, 0.8), u = drawn(model, 2, 2);
    const std::vector<int> free = free_bodies(model);
    for (const int body : free) {
      state.bodies[static_cast<std::size_t>(body)].v = {0.3, -0.2, 0.5};
      state.bodies[static_cast<std::size_t>(body)].w = {1, 2, -1.5};
    }
    place_joints(model, q, u, state);
    x.resize(static_cast<Eigen::Index>(u.size() + 6 * free.size()));
    x.head(static_cast<Eigen::Index>(u.size())) =
        Eigen::Map<const Eigen::VectorXd>(u.data(), static_cast<Eigen::Index>(u.size()));
    if (!free.empty()) x.tail<6>() << 0.3, -0.2, 0.5, 1, 2, -1.5;
  }
};

// Oracle: central differences of the forward kinematics, at every body and coordinate but those of the ball,
// whose rates are an angular velocity and no derivatives. Bound: the differences' error of second order.
TEST(Jacobian, IsTheDerivativeOfForwardKinematics) {
  const Model model = tree(false);
  const std::vector<double> q = drawn(model, 1, 0.8);
  const State state = state_at(model, q);
  constexpr double kStep = 1e-5;
  const Vec3 offset(0.03, -0.02, 0.05);
  for (std::size_t body = 2; body < model.bodies.size(); ++body) {
    const Jacobian J = jacobian(model, state, static_cast<int>(body), state.bodies[body].pose() * offset);
    for (const Joint& joint : model.joints)
      for (std::size_t k = 0; k < joint.axes.size(); ++k) {
        const std::size_t column = static_cast<std::size_t>(joint.first_dof) + k;
        std::vector<double> up = q, down = q;
        up[column] += kStep;
        down[column] -= kStep;
        const Pose a = state_at(model, up).bodies[body].pose(), b = state_at(model, down).bodies[body].pose();
        Eigen::Vector<double, 6> moved;
        moved << a * offset - b * offset, rotation_vector(a.q * b.q.conjugate());
        EXPECT_LT((J.col(static_cast<Eigen::Index>(column)) - moved / (2 * kStep)).norm(), 1e-9)
            << body << " " << joint.name;
      }
  }
}

// Oracle: velocities of bodies that place_joints() sums up outward from the base, which moves freely.
// Bound: rounding.
TEST(Jacobian, TimesTheRatesIsTheVelocityOfEveryBody) {
  const Model model = tree(true);
  const Moving now(model);
  const std::vector<int> free = free_bodies(model);
  ASSERT_EQ(free, std::vector<int>{1});
  const Vec3 offset(0.03, -0.02, 0.05);
  for (std::size_t body = 1; body < model.bodies.size(); ++body) {
    const BodyState& of = now.state.bodies[body];
    const Vec3 point = of.pose() * offset;
    Eigen::Vector<double, 6> moved;
    moved << of.v + of.w.cross(point - of.p), of.w;
    EXPECT_LT((jacobian(model, now.state, static_cast<int>(body), point, free) * now.x - moved).norm(), 1e-14)
        << body;
  }
}

// Oracle: kinetic energy, summed over bodies. Bound: rounding.
TEST(MassMatrix, GivesTheKineticEnergy) {
  for (const bool free : {false, true}) {
    const Model model = tree(free);
    const Moving now(model);
    const Eigen::MatrixXd M = mass_matrix(model, now.state, all_bodies(model), free_bodies(model));
    const double energy = kinetic_energy(model, now.state);
    EXPECT_NEAR(0.5 * now.x.dot(M * now.x), energy, 1e-14 * energy);
  }
}

/// A tree with every joint, and a hand.
std::vector<Model> trees() {
  return {tree(false), engine::test::shipped_hand("anatomical.yaml", hand::Mount::universal)};
}

// Oracle: inverse dynamics at rest without gravity: column k is the torques of a unit acceleration of
// coordinate k. Bound: rounding.
TEST(MassMatrix, IsSymmetricPositiveAndMadeOfColumnsOfInverseDynamics) {
  for (const Model& model : trees()) {
    const std::vector<double> q = drawn(model, 1, 0.8);
    const State state = state_at(model, q);
    const Eigen::MatrixXd M = mass_matrix(model, state, all_bodies(model));
    const double largest = M.cwiseAbs().maxCoeff();
    EXPECT_LT((M - M.transpose()).cwiseAbs().maxCoeff(), 1e-15 * largest);
    EXPECT_GT(M.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0);
    for (std::size_t k = 0; k < q.size(); ++k) {
      std::vector<double> unit(q.size());
      unit[k] = 1;
      const std::vector<double> column = inverse_dynamics(model, state, unit, Vec3::Zero());
      for (std::size_t i = 0; i < q.size(); ++i)
        EXPECT_NEAR(M(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)), column[i],
                    1e-14 * largest);
    }
  }
}

// Oracle: conservation: the power of the torques is the rate of change of kinetic and potential energy, by a
// central difference. A ball's rates are no derivatives of its coordinates: its coordinates stay at zero,
// where they are so to second order. Bound: the difference's error of second order.
TEST(InverseDynamics, DoesTheWorkThatEnergyGains) {
  Effects effects;
  effects.add(Effect::gravity);
  for (const Model& model : trees()) {
    std::vector<double> q = drawn(model, 1, 0.5), u = drawn(model, 2, 2), a = drawn(model, 4, 10);
    for (const Joint& joint : model.joints)
      if (joint.kind == JointKind::ball)
        for (int k = 0; k < 3; ++k) q[static_cast<std::size_t>(joint.first_dof + k)] = 0;
    const auto state_after = [&](double t) {
      std::vector<double> angles = q, rates = u;
      for (std::size_t i = 0; i < q.size(); ++i)
        angles[i] += t * u[i] + 0.5 * t * t * a[i], rates[i] += t * a[i];
      State out = initial_state(model);
      place_joints(model, angles, rates, out);
      return out;
    };
    const auto energy = [&](double t) {
      const State state = state_after(t);
      return kinetic_energy(model, state) + potential_energy(model, state, effects);
    };
    constexpr double kStep = 1e-5;
    const std::vector<double> tau = inverse_dynamics(model, state_after(0), a, model.gravity);
    const double power = std::inner_product(tau.begin(), tau.end(), u.begin(), 0.0);
    EXPECT_NEAR(power, (energy(kStep) - energy(-kStep)) / (2 * kStep), 1e-7 * std::abs(power));
  }
}

// Oracle: sums over bodies, here of Jacobians: m Jv x, and about the centre of mass m r x v + I w in body
// axes.
TEST(Momentum, IsTheSumOverBodies) {
  const Model model = tree(true);
  const Moving now(model);
  const std::vector<int> bodies = {1, 2, 3, 4, 5, 6}, free = free_bodies(model);
  const Momentum found = momentum(model, now.state, bodies);
  double mass = 0;
  Vec3 first = Vec3::Zero(), linear = Vec3::Zero(), angular = Vec3::Zero();
  for (const int body : bodies) {
    const Body& of = model.bodies[static_cast<std::size_t>(body)];
    const BodyState& at = now.state.bodies[static_cast<std::size_t>(body)];
    const Eigen::Vector<double, 6> moved = jacobian(model, now.state, body, at.p, free) * now.x;
    const Mat3 R = at.q.toRotationMatrix();
    mass += of.mass;
    first += of.mass * at.p;
    linear += of.mass * moved.head<3>();
    angular += of.mass * at.p.cross(moved.head<3>()) + R * of.inertia * R.transpose() * moved.tail<3>();
  }
  EXPECT_NEAR(found.mass, mass, 1e-15);
  EXPECT_LT((found.centre - first / mass).norm(), 1e-15);
  EXPECT_LT((found.linear - linear).norm(), 1e-14 * linear.norm());
  EXPECT_LT((found.angular - (angular - (first / mass).cross(linear))).norm(), 1e-13 * angular.norm());
}

}  // namespace
}  // namespace handsim::model
