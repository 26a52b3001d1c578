// Steps that engines refuse, and steps that fail: neither leaves a trace.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "engine/models.h"

namespace handsim::engine::unmade {
namespace {

using model::Effect;
using model::Servo;

constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

/// Five fingers on a driven palm, whose shapes touch, with three muscles. @param strain of elastic tendons
model::Model fingers_with_muscles(std::optional<double> strain) {
  model::Model model = test::five_fingers(true, true, true);
  model.drives.push_back({1,
                          {},
                          {{{0, model.bodies[1].zero_pose}, {1, {Vec3(0.1, 0, 0), Quat::Identity()}}},
                           model::Interpolation::linear,
                           {}}});
  for (model::Joint& joint : model.joints)
    if (joint.kind == model::JointKind::universal)
      joint.axes[1].initial = 0.15 * (joint.child % 2 == 0 ? 1 : -1);
  for (int i = 0; i < 3; ++i) {
    model::Muscle muscle;
    muscle.name = "m" + std::to_string(i);
    muscle.path.arms = {{4 * i, {0.008}, -4, 4}, {4 * i + 2, {0.006}, -4, 4}};
    muscle.force = 20;
    muscle.fibre_length = 0.06;
    muscle.slack_length = 0.2;
    muscle.length = 0.265;
    muscle.tendon_strain = strain;
    if (i > 0) muscle.short_range = 23.4;
    model.muscles.push_back(muscle);
  }
  return model;
}

Settings everything(Method method) {
  return test::settings({Effect::gravity, Effect::joint_stops, Effect::passive_tissue, Effect::actuation,
                         Effect::muscles, Effect::self_contact, Effect::friction, Effect::wrist_motion},
                        1e-3, method);
}

/// The state, with all that belongs to joints and muscles.
std::vector<std::uint64_t> all_bits(const model::State& state) {
  std::vector<std::uint64_t> out = test::bits(state);
  for (const std::vector<double>* numbers :
       {&state.q, &state.u, &state.tau, &state.tau_servo, &state.activation, &state.fibre_length,
        &state.fibre_speed, &state.bridge_stretch, &state.tendon_force})
    for (const double x : *numbers) out.push_back(std::bit_cast<std::uint64_t>(x));
  return out;
}

std::string saved(const Engine& engine) {
  ArchiveWriter out;
  engine.save(out);
  return out.take();
}

/// A step's input with its numbers.
struct Action {
  std::vector<double> torques, excitations;
  std::vector<Servo> servos;
  std::vector<BodyForce> forces;
  std::vector<Pose> targets;

  StepInput input() const { return {torques, servos, forces, targets, excitations}; }
};

/// A sound action, each part of which may be absent.
Action sound_action(const model::Model& model, const Engine& engine, std::mt19937& random) {
  std::uniform_real_distribution<double> share(0, 1);
  const auto dofs = static_cast<std::size_t>(model.dof_count());
  Action out;
  if (share(random) < 0.7)
    for (std::size_t i = 0; i < dofs; ++i) out.torques.push_back(2e-3 * (share(random) - 0.5));
  if (share(random) < 0.7)
    for (std::size_t i = 0; i < model.muscles.size(); ++i) out.excitations.push_back(share(random));
  if (share(random) < 0.7)
    for (std::size_t i = 0; i < dofs; ++i) out.servos.push_back({0.05, 1e-3, share(random) - 0.3, 0, 0.1});
  if (share(random) < 0.3) out.forces.push_back({3, 0.01 * test::random_vector(random), Vec3::Zero()});
  if (share(random) < 0.3)
    out.targets.push_back(
        {engine.state().bodies[1].p + 1e-5 * test::random_vector(random), Quat::Identity()});
  return out;
}

/// One of the things that an engine refuses, put into an action.
void spoil(Action& action, const model::Model& model, std::mt19937& random) {
  const auto dofs = static_cast<std::size_t>(model.dof_count());
  const std::size_t victim = random() % dofs;
  if (action.servos.empty()) action.servos.assign(dofs, {0.05, 1e-3, 0, 0, 0.1});
  if (action.excitations.empty()) action.excitations.assign(model.muscles.size(), 0.9);
  switch (random() % 9) {
    case 0:
      return action.torques.resize(dofs + 1);
    case 1:
      action.servos[victim].stiffness = -1;
      return;
    case 2:
      action.servos[victim].limit = -1;
      return;
    case 3:
      return action.servos.resize(dofs - 1);
    case 4:
      action.excitations.back() = 1.5;
      return;
    case 5:
      action.excitations.back() = kNotANumber;
      return;
    case 6:
      return action.excitations.push_back(0);
    case 7:
      return action.forces.push_back({0, Vec3::Ones(), Vec3::Zero()});
    default:
      return action.targets.push_back({Vec3::Zero(), Quat(2, 0, 0, 0)});
  }
}

struct Case {
  std::string name;
  Method method;
  std::optional<double> strain = {};
};

class UnmadeStep : public testing::TestWithParam<Case> {
 protected:
  UnmadeStep() : model_(fingers_with_muscles(GetParam().strain)), with_(everything(GetParam().method)) {}
  model::Model model_;
  Settings with_;
};

// Oracle: bit equality with an engine that never got the refused steps, in states and in what `save` writes.
TEST_P(UnmadeStep, TakesNothingFromAStepThatItRefuses) {
  std::mt19937 random(7);
  const auto engine = make_engine(model_, with_), fresh = make_engine(model_, with_);
  int contacts = 0;
  for (int i = 0; i < 400; ++i) {
    Action action = sound_action(model_, *fresh, random);
    contacts += fresh->step(action.input()).contacts;
    for (auto bad = random() % 3; bad > 0; --bad) {
      Action refused = sound_action(model_, *fresh, random);
      spoil(refused, model_, random);
      try {
        engine->step(refused.input());
        FAIL() << "step " << i << " was made";
      } catch (const Error& error) {
        ASSERT_EQ(error.kind(), ErrorKind::input) << error.what();
      }
    }
    engine->step(action.input());
    // A state that nobody asks for is made later: every third one.
    if (i % 3 != 0) continue;
    ASSERT_EQ(all_bits(engine->state()), all_bits(fresh->state())) << "step " << i;
    ASSERT_EQ(saved(*engine), saved(*fresh)) << "step " << i;
  }
  EXPECT_GT(contacts, 100);
}

// Oracle: bit equality with the state of an engine that stopped before the step that fails, whether anybody
// had asked for it or not. A torque that is no number fails before anything moves, one of 1e9 N m after that.
TEST_P(UnmadeStep, KeepsTheLastStateWhenAStepFails) {
  for (const bool contact : {true, false})
    for (const double bad : {kNotANumber, 1e9})
      for (const int steps : {0, 1, 30}) {
        Settings with = with_;
        // Stops would hold any torque.
        with.effects.remove(Effect::joint_stops);
        if (!contact) with.effects.remove(Effect::self_contact);
        if (!contact) with.effects.remove(Effect::friction);
        const auto engine = make_engine(model_, with), fresh = make_engine(model_, with);
        std::mt19937 random(11);
        for (int i = 0; i < steps; ++i) {
          const Action action = sound_action(model_, *fresh, random);
          engine->step(action.input());
          fresh->step(action.input());
        }
        Action action = sound_action(model_, *fresh, random);
        action.torques.assign(static_cast<std::size_t>(model_.dof_count()), bad);
        action.excitations.assign(model_.muscles.size(), 1);
        try {
          engine->step(action.input());
          FAIL() << "a step with " << bad << " N m was made";
        } catch (const Error& error) {
          ASSERT_EQ(error.kind(), ErrorKind::physics) << error.what();
        }
        EXPECT_EQ(all_bits(engine->state()), all_bits(fresh->state()))
            << bad << " N m after " << steps << " steps, " << (contact ? "with" : "without") << " contact";
      }
}

INSTANTIATE_TEST_SUITE_P(
    , UnmadeStep,
    testing::Values(Case{"WorldStep", OdeMethod::world_step}, Case{"QuickStep", OdeMethod::quick_step},
                    Case{"ElasticOnOde", OdeMethod::world_step, 0.033},
                    Case{"Articulated", ArticulatedMethod::semi_implicit_euler},
                    Case{"ElasticOnArticulated", ArticulatedMethod::semi_implicit_euler, 0.033}),
    [](const auto& each) { return each.param.name; });

}  // namespace
}  // namespace handsim::engine::unmade
