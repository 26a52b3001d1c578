// Constraint rows of joints, projections and accelerations.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "engine/models.h"
#include "handsim/engine/multibody/projection.h"
#include "handsim/engine/multibody/rows.h"

namespace handsim::engine {
namespace {

using model::JointKind;

const std::vector<JointKind> kKinds = {JointKind::hinge, JointKind::universal, JointKind::ball,
                                       JointKind::slider};

/// Two free bodies and a joint of one kind between them, at random poses.
model::Model two_bodies(std::mt19937& random, JointKind kind) {
  model::Model model = model::make_model();
  test::add_body(model, test::body("a", 0.2, {1e-4, 2e-4, 2.5e-4}, test::random_pose(random)));
  test::add_body(model, test::body("b", 0.3, {3e-4, 2e-4, 4e-4}));
  std::vector<Vec3> axes;
  if (kind != JointKind::ball) axes.push_back(test::random_vector(random).normalized());
  if (kind == JointKind::universal) axes.push_back(axes[0].unitOrthogonal());
  test::add_joint(model, "joint", kind, 1, 2, test::random_pose(random, 0.05),
                  test::random_pose(random, 0.05), axes);
  return model;
}

/// The state after every body moved with its velocity for a time.
model::State moved(model::State state, double time) {
  for (model::BodyState& body : state.bodies) {
    body.p += time * body.v;
    body.q = rotation_quaternion(time * body.w) * body.q;
  }
  return state;
}

model::State scattered(const model::Model& model, std::mt19937& random, double size) {
  model::State state = model::initial_state(model);
  for (std::size_t i = 1; i < state.bodies.size(); ++i) {
    state.bodies[i].p += size * test::random_vector(random);
    state.bodies[i].q = rotation_quaternion(10 * size * test::random_vector(random)) * state.bodies[i].q;
    state.bodies[i].v = test::random_vector(random);
    state.bodies[i].w = 5 * test::random_vector(random);
  }
  return state;
}

System system_of(const model::Model& model) {
  return islands(model, test::settings({}, 1e-3, DaeMethod::stabilised_gear)).front();
}

double largest_error(const System& system, const model::State& state) {
  std::vector<ConstraintRow> rows;
  system.constraints(state, rows);
  double worst = 0;
  for (const ConstraintRow& row : rows) worst = std::max(worst, std::abs(row.value));
  return worst;
}

// Oracle: a central difference of each row's value along the motion; its error is 1e-7 of speeds of some m/s.
TEST(JointRows, HaveTheRateOfTheirValue) {
  std::mt19937 random(1);
  for (const JointKind kind : kKinds)
    for (int i = 0; i < 20; ++i) {
      const model::Model model = two_bodies(random, kind);
      const model::State state = scattered(model, random, 0.01);
      std::vector<ConstraintRow> rows, before, after;
      append_constraints(model.joints[0], state, rows);
      append_constraints(model.joints[0], moved(state, -1e-6), before);
      append_constraints(model.joints[0], moved(state, 1e-6), after);
      ASSERT_EQ(static_cast<int>(rows.size()), constraint_count(kind));
      for (std::size_t k = 0; k < rows.size(); ++k)
        EXPECT_NEAR(rate(rows[k], state), (after[k].value - before[k].value) / 2e-6, 1e-7) << k;
    }
}

// Oracle: the definition: no error remains, and the displacement is orthogonal, in the metric of the masses,
// to every motion that the joint allows.
TEST(Projection, FindsTheNearestStateWithAClosedJoint) {
  std::mt19937 random(2);
  for (const JointKind kind : kKinds) {
    const model::Model model = two_bodies(random, kind);
    const System system = system_of(model);
    model::State state = scattered(model, random, 1e-4);
    ASSERT_GT(largest_error(system, state), 1e-6);
    const model::State before = state;
    project_positions(system, state);
    EXPECT_LT(largest_error(system, state), 1e-12);
    project_velocities(system, state);
    std::vector<ConstraintRow> rows;
    system.constraints(state, rows);
    for (const ConstraintRow& row : rows) EXPECT_NEAR(rate(row, state), 0, 1e-12);
    const Matrix jacobian = system.jacobian(rows, state);
    const Vector change = system.velocities(state) - system.velocities(before);
    const Matrix allowed = Eigen::FullPivLU<Matrix>(jacobian).kernel();
    // The projection rotates the body axes of w by 1e-3 rad.
    EXPECT_LT((allowed.transpose() * system.times_mass(change)).cwiseAbs().maxCoeff(), 1e-5);
  }
}

// Oracle: closed form: a horizontal pendulum at rest has alpha = m g l / (I + m l^2), and its pin carries the
// rest of its weight.
TEST(Accelerations, OfAHorizontalPendulumAreTheClosedForm) {
  model::Model model = test::hinged_body(0.1);
  model.bodies[1].zero_pose.q = rotation_quaternion({0, M_PI / 2, 0});
  model.bodies[1].zero_pose.p = model.bodies[1].zero_pose.q * Vec3(0, 0, -0.1);
  const model::State state = [&] {
    model::State out = model::initial_state(model);
    out.bodies[1].p = model.bodies[1].zero_pose.p;
    out.bodies[1].q = model.bodies[1].zero_pose.q;
    return out;
  }();
  const System system =
      islands(model, test::settings({model::Effect::gravity}, 1e-3, DaeMethod::stabilised_gear)).front();
  double weakest = 0;
  const std::vector<Index> rows = independent_rows(system, state, weakest);
  ASSERT_EQ(rows.size(), 5U);
  const Accelerations found = accelerations(system, state, {}, rows);
  const double alpha = 0.1 * 9.80665 * 0.1 / (1e-4 + 0.1 * 0.01);
  EXPECT_NEAR(found.acceleration.tail<3>().norm(), alpha, 1e-9);
  EXPECT_NEAR(found.acceleration[2], -0.1 * alpha, 1e-9);
  // M u' = f - G^T lambda.
  std::vector<ConstraintRow> all;
  system.constraints(state, all);
  Vector left = system.all_forces(state, {}) - system.times_mass(found.acceleration);
  for (std::size_t i = 0; i < rows.size(); ++i)
    system.add_transposed(all[static_cast<std::size_t>(rows[i])], -found.multipliers[static_cast<Index>(i)],
                          state, left);
  EXPECT_LT(left.cwiseAbs().maxCoeff(), 1e-12);
}

// Oracle: a body with two hinges to the world on one axis has five independent constraints, not ten.
TEST(IndependentRows, AreWithoutRedundantOnes) {
  model::Model model = test::hinged_body(0.1);
  model::Joint again = model.joints[0];
  again.name = "again";
  again.parent_frame.p += Vec3(0, 0.05, 0);
  again.child_frame.p += Vec3(0, 0.05, 0);
  again.first_dof = 1;
  again.closes_loop = true;
  model.joints.push_back(again);
  const System system = system_of(model);
  double weakest = 0;
  EXPECT_EQ(system.constraint_count(), 10);
  EXPECT_EQ(independent_rows(system, model::initial_state(model), weakest).size(), 5U);
  EXPECT_GT(weakest, 0.01);
}

}  // namespace
}  // namespace handsim::engine
