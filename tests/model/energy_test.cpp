#include "handsim/model/energy.h"

#include <cmath>

#include <gtest/gtest.h>

#include "engine/models.h"
#include "handsim/model/newton_euler.h"

namespace handsim::model {
namespace {

Effects effects_of(std::initializer_list<Effect> list) {
  Effects out;
  for (const Effect effect : list) out.add(effect);
  return out;
}

// Oracle: minus the force: what holds the fingers against gravity by inverse dynamics, and the law of tissue,
// each where its effect is on. Central differences over 1e-4 rad miss 2e-9 of a slope.
TEST(PotentialEnergy, HasMinusTheForceAsItsGradient) {
  Model model = engine::test::five_fingers(false, true);
  model.gravity = {1, -3, -9};
  std::vector<double> q(as_index(model.dof_count()));
  for (std::size_t i = 0; i < q.size(); ++i) q[i] = 0.3 + 0.4 * std::sin(static_cast<double>(i));
  const std::vector<double> rest(q.size(), 0.0);
  const std::vector<double> hold = inverse_dynamics(model, state_at(model, q), rest, model.gravity);
  constexpr double kStep = 1e-4;
  const auto slope = [&](std::size_t i, const Effects& effects) {
    std::vector<double> up = q, down = q;
    up[i] += kStep;
    down[i] -= kStep;
    return (potential_energy(model, state_at(model, up), effects) -
            potential_energy(model, state_at(model, down), effects)) /
           (2 * kStep);
  };
  for (const Joint& joint : model.joints)
    for (std::size_t k = 0; k < joint.axes.size(); ++k) {
      const std::size_t i = as_index(joint.first_dof) + k;
      const Tissue& tissue = *joint.axes[k].tissue;
      const double stretched = tissue.stiffness * (q[i] - tissue.rest);
      EXPECT_GT(std::abs(hold[i]), 1e-6);
      EXPECT_GT(std::abs(stretched), 1e-4);
      EXPECT_NEAR(slope(i, effects_of({Effect::gravity})), hold[i], 1e-10);
      EXPECT_NEAR(slope(i, effects_of({Effect::passive_tissue})), stretched, 1e-10);
      EXPECT_NEAR(slope(i, effects_of({Effect::gravity, Effect::passive_tissue})), hold[i] + stretched,
                  1e-10);
    }
  EXPECT_EQ(potential_energy(model, state_at(model, q), {}), 0);
}

// Oracle: closed form: m v^2 / 2 + I w^2 / 2 about a principal axis that stands obliquely in the world, and
// -m g . p; a body that is driven has neither.
TEST(Energy, IsThatOfFreeBodiesAlone) {
  Model model = make_model();
  const Pose pose{{0.1, 0.2, 0.5}, Quat(Eigen::AngleAxisd(0.8, Vec3(1, -1, 2).normalized()))};
  for (const bool driven : {false, true}) {
    Body body = engine::test::body("b", 2, {0.02, 0.05, 0.06}, pose);
    body.kinematic = driven;
    body.initial_velocity = {1, -2, 2};
    body.initial_angular_velocity = pose.q * Vec3(0, 3, 0);
    engine::test::add_body(model, body);
  }
  const State state = initial_state(model);
  EXPECT_NEAR(kinetic_energy(model, state), 9 + 0.5 * 0.05 * 9, 1e-14);
  EXPECT_NEAR(potential_energy(model, state, effects_of({Effect::gravity})), 9.80665, 1e-14);
  EXPECT_EQ(potential_energy(model, state, effects_of({Effect::passive_tissue})), 0);
}

}  // namespace
}  // namespace handsim::model
