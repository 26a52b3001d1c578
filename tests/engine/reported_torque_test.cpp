// The torques that engines report, compared with inverse dynamics of the recorded motion.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/shared_motions.h"
#include "support/momentum_torques.h"
#include "support/sanitized.h"

namespace handsim::engine {
namespace {

using model::Effect;

struct Drive {
  Method method = OdeMethod::world_step;
  double step = 1e-3;
  int iterations = 20;
};

struct Outcome {
  double error = 0;  ///< largest difference of reported and required torque, relative to the largest torque
  double inferred = 0;  ///< the same for torques of the servo law and tissue at the step's end
  int at_limit = 0;     ///< servo torques at their limit
};

/// A hand on a fixed palm, moved by servos (dae: by torques), gravity and tissue. Compares the reported
/// torques with the change of momentum of the bodies distal to each joint.
Outcome drive(const Drive& how) {
  const model::Model model = test::shipped_hand("anatomical.yaml", hand::Mount::fixed);
  Settings with =
      test::settings({Effect::gravity, Effect::passive_tissue, Effect::actuation}, how.step, how.method);
  if (with.engine() == EngineKind::ode) with.ode().iterations = how.iterations;
  const bool servos_act = !std::holds_alternative<DaeMethod>(how.method);
  const auto engine = make_engine(model, with);
  const auto dofs = static_cast<std::size_t>(model.dof_count());
  const double stiffness = 0.1, damping = 1e-3, limit = 0.02;
  const std::vector<double> start = engine->state().q;
  std::vector<model::Servo> servos(dofs);
  std::vector<double> torques(servos_act ? 0 : dofs);
  double worst = 0, worst_inferred = 0, largest = 0;
  Outcome out;
  // A step of the reference engine takes 70 ms, with a sanitizer a third of a second.
  const double duration = servos_act ? 0.05 : handsim::test::kSanitized ? 0.01 : 0.02;
  for (long i = 0; i < std::lround(duration / how.step); ++i) {
    const model::State before = engine->state();
    const double swing = 0.2 * (1 - std::cos(40 * (before.time + how.step)));
    for (std::size_t k = 0; k < dofs; ++k) {
      const double error = start[k] + (k % 2 == 0 ? swing : -swing) - before.q[k];
      servos[k] = {stiffness, damping, error, 0.001, limit};
      if (!servos_act) torques[k] = k % 2 == 0 ? 0.005 * swing : -0.005 * swing;
    }
    engine->step(servos_act ? StepInput{.servos = servos} : StepInput{torques});
    const model::State& after = engine->state();
    const std::vector<double> needed = handsim::test::momentum_torques(model, before, after, model.gravity);
    for (const model::Joint& joint : model.joints)
      for (std::size_t a = 0; a < joint.axes.size(); ++a) {
        const std::size_t k = static_cast<std::size_t>(joint.first_dof) + a;
        const auto& tissue = joint.axes[a].tissue;
        const double pull = servos[k].stiffness * (servos[k].error - how.step * after.u[k]) -
                            servos[k].damping * after.u[k] + servos[k].feed;
        const double held =
            tissue ? tissue->stiffness * (after.q[k] - tissue->rest) + tissue->damping * after.u[k] : 0;
        const double inferred = std::clamp(pull, -servos[k].limit, servos[k].limit) - held;
        largest = std::max(largest, std::abs(needed[k]));
        worst = std::max(worst, std::abs(after.tau[k] - needed[k]));
        worst_inferred = std::max(worst_inferred, std::abs(inferred - needed[k]));
        out.at_limit += servos_act && std::abs(std::abs(after.tau_servo[k]) - limit) < 1e-9 ? 1 : 0;
      }
  }
  out.error = worst / largest;
  out.inferred = worst_inferred / largest;
  return out;
}

class ReportedTorque : public testing::TestWithParam<Method> {};

// Oracle: Newton-Euler equations of the recorded motion. The axes move during a step, so the difference is of
// first order in the step: it decreases with the step, and is small at the finer one.
TEST_P(ReportedTorque, IsTheTorqueOfInverseDynamics) {
  if (GetParam() == DaeMethod::stabilised_gear)
    HANDSIM_SKIP_WITH_SANITIZER("other tests of this method take fewer steps");
  const Outcome coarse = drive({.method = GetParam(), .step = 4e-4}),
                fine = drive({.method = GetParam(), .step = 1e-4});
  EXPECT_LT(fine.error, 0.02);
  EXPECT_LT(fine.error, 0.4 * coarse.error);
  const bool servos = !std::holds_alternative<DaeMethod>(GetParam());
  EXPECT_EQ(fine.at_limit > 0, servos);
}

INSTANTIATE_TEST_SUITE_P(Methods, ReportedTorque,
                         testing::Values(Method(OdeMethod::world_step),
                                         Method(ArticulatedMethod::semi_implicit_euler),
                                         Method(ArticulatedMethod::rk4), Method(DaeMethod::stabilised_gear),
                                         Method(DaeMethod::euler_projected)),
                         [](const auto& each) { return std::string(name(each.param)); });

// Oracle: the same. With few iterations the applied torques are not those of the servo law.
TEST(TorqueOfOde, IsTheAppliedOneWhereQuickStepHasNotConverged) {
  const Outcome out = drive({.method = OdeMethod::quick_step, .step = 1e-4, .iterations = 3});
  EXPECT_LT(out.error, 0.02);
  EXPECT_GT(out.inferred, 10 * out.error);
}

}  // namespace
}  // namespace handsim::engine
