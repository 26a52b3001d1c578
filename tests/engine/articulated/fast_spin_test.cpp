// Passive hands that turn fast on the articulated engine: energy, momentum, order, bits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "engine/shared_motions.h"
#include "handsim/engine/articulated/articulated_engine.h"
#include "handsim/model/energy.h"
#include "support/sanitized.h"

namespace handsim::engine {
namespace {

using articulated::ArticulatedEngine;
using articulated::Kernel;
using articulated::kernels;
using engine::test::settings;
using engine::test::shipped_hand;
using model::Effect;
using model::State;

constexpr const char* kAnatomical = "anatomical.yaml";
constexpr const char* kPrototype = "prototype.yaml";

/// Largest spin [rad/s] that is held at a step [s].
struct Bound {
  double step = 0, spin = 0;
};
constexpr Bound kBounds[] = {{1e-3, 100}, {5e-3, 35}, {20e-3, 20}};

const std::vector<std::vector<Effect>> kPassive = {
    {}, {Effect::joint_stops}, {Effect::joint_stops, Effect::passive_tissue}};

const std::vector<Vec3>& axes() {
  static const std::vector<Vec3> out = {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ(), Vec3(0.6, 0.48, 0.64),
                                        Vec3(-0.36, 0.48, 0.8)};
  return out;
}

Settings with(const std::vector<Effect>& effects, double step) {
  Settings out = settings({}, step, ArticulatedMethod::semi_implicit_euler);
  for (const Effect effect : effects) out.effects.add(effect);
  return out;
}

double energy(const model::Model& model, const Engine& engine) {
  return model::kinetic_energy(model, engine.state()) +
         model::potential_energy(model, engine.state(), engine.settings().effects);
}

Vec3 angular_momentum(const model::Model& model, const State& state) {
  Vec3 out = Vec3::Zero();
  for (std::size_t i = 1; i < model.bodies.size(); ++i) {
    const model::Body& body = model.bodies[i];
    const model::BodyState& at = state.bodies[i];
    out += at.q * (body.inertia * (at.q.conjugate() * at.w)) + body.mass * at.p.cross(at.v);
  }
  return out;
}

/// A free hand that spins as one body.
model::Model spinning_hand(const char* name, const Vec3& spin) {
  model::Model model = shipped_hand(name, hand::Mount::free);
  for (model::Body& body : model.bodies) {
    if (&body == &model.bodies[0]) continue;
    body.initial_angular_velocity = spin;
    body.initial_velocity = spin.cross(body.zero_pose.p);
  }
  return model;
}

/// Largest gain over the start's energy in a time [s], as a share of the start's kinetic energy.
double largest_gain(const model::Model& model, Engine& engine, double time) {
  const double start = energy(model, engine), scale = model::kinetic_energy(model, engine.state());
  double out = -1;
  for (long i = 0; i < std::lround(time / engine.settings().step); ++i) {
    engine.step({});
    out = std::max(out, (energy(model, engine) - start) / scale);
  }
  return out;
}

// Oracle: conservation of energy. Bound: a thousandth of the start's.
TEST(FastSpin, FreeHandsGainNoEnergyWhateverTheirAxisStepAndEffects) {
  for (const char* name : {kAnatomical, kPrototype})
    for (const Bound& bound : kBounds)
      for (const double share : {0.03, 0.2, 0.7, 1.0})
        for (const Vec3& axis : axes())
          for (const auto& effects : kPassive) {
            const model::Model model = spinning_hand(name, share * bound.spin * axis);
            const auto engine = make_engine(model, with(effects, bound.step));
            EXPECT_LT(largest_gain(model, *engine, 1.5), 1e-3)
                << name << ", " << share * bound.spin << " rad/s about " << axis.transpose() << " at "
                << bound.step << " s with " << effects.size() << " effects";
          }
}

// Oracle: conservation of angular momentum. Without the correction it grows a hundredfold at 1 ms.
TEST(FastSpin, FreeHandsKeepTheirAngularMomentum) {
  for (const char* name : {kAnatomical, kPrototype})
    for (const Bound& bound : kBounds)
      for (const Vec3& axis : axes()) {
        const model::Model model = spinning_hand(name, bound.spin * axis);
        const auto engine = make_engine(
            model, settings({Effect::joint_stops}, bound.step, ArticulatedMethod::semi_implicit_euler));
        const Vec3 start = angular_momentum(model, engine->state());
        double error = 0;
        for (long i = 0; i < std::lround(2 / bound.step); ++i) {
          engine->step({});
          error = std::max(error, (angular_momentum(model, engine->state()) - start).norm() / start.norm());
        }
        EXPECT_LT(error, 1e-10) << name << " about " << axis.transpose() << " at " << bound.step << " s";
      }
}

/// Gives a hand that hangs on its wrist the rates [rad/s] or [m/s] of the wrist's axes, its fingers as one
/// with the palm.
void turn_wrist(const model::Model& model, Engine& engine, const Vec3& rates) {
  State state = engine.state();
  const model::Joint& wrist = *std::find_if(model.joints.begin(), model.joints.end(),
                                            [](const model::Joint& joint) { return joint.parent == 0; });
  Vec3 w = Vec3::Zero(), v = Vec3::Zero();
  for (std::size_t k = 0; k < wrist.axes.size(); ++k) {
    Vec3& part = wrist.kind == model::JointKind::slider ? v : w;
    part += rates[static_cast<Eigen::Index>(k)] * (wrist.parent_frame.q * wrist.axes[k].axis);
  }
  for (std::size_t i = 1; i < state.bodies.size(); ++i) {
    state.bodies[i].w = w;
    state.bodies[i].v = v + w.cross(state.bodies[i].p - wrist.parent_frame.p);
  }
  engine.set_state(state);
}

// Oracle: conservation of energy.
TEST(FastSpin, HandsThatSwingOnTheirWristGainNoEnergy) {
  HANDSIM_SKIP_WITH_SANITIZER("free hands spin by the same code");
  using hand::Mount;
  const std::vector<std::pair<const char*, Mount>> hands = {{kAnatomical, Mount::hinge},
                                                            {kAnatomical, Mount::universal},
                                                            {kAnatomical, Mount::rail},
                                                            {kPrototype, Mount::hinge},
                                                            {kPrototype, Mount::rail}};
  for (const auto& [name, mount] : hands)
    for (const Bound& bound : kBounds)
      for (const double share : {0.03, 0.3, 1.0})
        for (const double second : {0.0, -0.7})
          for (const auto& effects : kPassive) {
            const model::Model model = shipped_hand(name, mount);
            const auto engine = make_engine(model, with(effects, bound.step));
            turn_wrist(model, *engine, share * bound.spin * Vec3(std::sqrt(1 - second * second), second, 0));
            EXPECT_LT(largest_gain(model, *engine, 1.5), 1e-3)
                << name << ", mount " << static_cast<int>(mount) << ", " << share * bound.spin << " rad/s at "
                << bound.step << " s with " << effects.size() << " effects";
          }
}

// Oracle: conservation of energy. Torques at random throw the joints about, and are then taken away.
TEST(FastSpin, HandsThatWereThrownAboutAtRandomGainNoEnergy) {
  HANDSIM_SKIP_WITH_SANITIZER("free hands spin by the same code");
  using hand::Mount;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> torque(-1, 1);
  for (const char* name : {kAnatomical, kPrototype})
    for (const Mount mount : {Mount::fixed, Mount::hinge, Mount::universal, Mount::rail, Mount::free})
      for (const Bound& bound : kBounds)
        for (const auto& effects : kPassive) {
          if (name == kPrototype && mount == Mount::universal) continue;  // its wrist has one axis
          const model::Model model = shipped_hand(name, mount);
          const auto engine = make_engine(model, with(effects, bound.step));
          const auto fastest = [&] {
            double out = 0;
            for (const model::BodyState& body : engine->state().bodies) out = std::max(out, body.w.norm());
            return out;
          };
          std::vector<double> torques(static_cast<std::size_t>(model.dof_count()));
          for (double& each : torques) each = 2e-4 * torque(random);
          for (int i = 0; i < 2000 && fastest() < 0.8 * bound.spin; ++i) engine->step({torques});
          EXPECT_LT(largest_gain(model, *engine, 1.5), 1e-3)
              << name << ", mount " << static_cast<int>(mount) << " at " << bound.step << " s with "
              << effects.size() << " effects, " << fastest() << " rad/s";
        }
}

// Oracle: conservation of energy, gravity's counted, in kinetic energies that a fall of 5 cm gives.
TEST(FastSpin, HandsThatFallFromRestGainNoEnergy) {
  HANDSIM_SKIP_WITH_SANITIZER("the same code as in the test before, over more steps");
  using hand::Mount;
  for (const char* name : {kAnatomical, kPrototype})
    for (const Mount mount : {Mount::fixed, Mount::hinge, Mount::universal, Mount::rail, Mount::free})
      for (const auto& effects : kPassive) {
        if (name == kPrototype && mount == Mount::universal) continue;
        const model::Model model = shipped_hand(name, mount);
        Settings falling = with(effects, 1e-3);
        falling.effects.add(Effect::gravity);
        const auto engine = make_engine(model, falling);
        double mass = 0, gain = 0;
        for (const model::Body& body : model.bodies)
          if (!body.kinematic) mass += body.mass;
        const double start = energy(model, *engine);
        for (int i = 0; i < 1500; ++i) {
          engine->step({});
          gain = std::max(gain, energy(model, *engine) - start);
        }
        EXPECT_LT(gain, 1e-3 * mass * 9.81 * 0.05)
            << name << ", mount " << static_cast<int>(mount) << " with " << effects.size() << " effects";
      }
}

// Oracle: the method of order 8(5,3), and the order of the step.
TEST(FastSpin, ConvergesWithOrderOne) {
  HANDSIM_SKIP_WITH_SANITIZER("the same code as in the test before, over more steps");
  const model::Model model = spinning_hand(kAnatomical, 50 * Vec3(0.6, 0.48, 0.64));
  const auto after = [&](Method method, double step) {
    Settings of = settings({Effect::passive_tissue}, step, method);
    test::set_tolerance(of, 1e-11);
    const auto engine = make_engine(model, of);
    engine::test::run(*engine, static_cast<int>(std::lround(0.08 / step)));
    return engine->state().q;
  };
  const auto want = after(ArticulatedMethod::dormand_prince, 1e-2);
  const auto error = [&](double step) {
    const auto found = after(ArticulatedMethod::semi_implicit_euler, step);
    double out = 0;
    for (std::size_t i = 0; i < want.size(); ++i) out = std::max(out, std::abs(found[i] - want[i]));
    return out;
  };
  // 50 rad/s turn 0.005 rad in the coarser step, and 0.0025 in the finer: both are corrected.
  const double coarse = error(1e-4), fine = error(5e-5);
  EXPECT_NEAR(std::log2(coarse / fine), 1, 0.15) << coarse << " " << fine;
}

// Oracle: bit equality.
TEST(FastSpin, EveryVectorUnitGivesTheSameBits) {
  ASSERT_GE(kernels().size(), 2U);
  const model::Model model = spinning_hand(kAnatomical, {30, -50, 40});
  const Settings of = with({Effect::joint_stops, Effect::passive_tissue, Effect::gravity}, 1e-3);
  const auto bits_after = [&](const Kernel* kernel) {
    ArticulatedEngine engine(model, of, kernel);
    engine::test::run(engine, 500);
    return engine::test::bits(engine.state());
  };
  const auto want = bits_after(kernels().front());
  for (const Kernel* kernel : kernels()) EXPECT_EQ(bits_after(kernel), want) << kernel->name;
}

// Oracle: bit equality with a run that was not interrupted.
TEST(FastSpin, GoesOnFromWhatWasSavedToTheBit) {
  const model::Model model = spinning_hand(kPrototype, {0, 0, 100});
  const Settings of = with({Effect::joint_stops}, 1e-3);
  ArticulatedEngine whole(model, of), later(model, of);
  engine::test::run(whole, 400);
  ArchiveWriter out;
  whole.save(out);
  ArchiveReader in(out.bytes(), "saved");
  later.restore(whole.state(), in);
  engine::test::run(whole, 600);
  engine::test::run(later, 600);
  EXPECT_EQ(engine::test::bits(later.state()), engine::test::bits(whole.state()));
}

// Oracle: bit equality with the finger alone. A tree that turns fast changes none that it has no joint with.
TEST(FastSpin, LeavesSlowNeighboursAsTheyAre) {
  const model::Model slow = engine::test::five_fingers(true, true);
  const auto bits_of_fingers = [&](bool with_neighbour) {
    model::Model model = slow;
    if (with_neighbour) {
      const int first = engine::test::add_body(
          model, engine::test::body("block", 0.2, {2e-4, 3e-4, 1e-4}, {Vec3(1, 0, 0), Quat::Identity()}));
      const int second = engine::test::add_body(model, engine::test::body("flail", 0.1, {1e-4, 2e-4, 1e-4}));
      engine::test::add_joint(model, "flail_joint", model::JointKind::hinge, first, second,
                              {Vec3(0.05, 0, 0), Quat::Identity()}, {Vec3(-0.05, 0, 0), Quat::Identity()},
                              {Vec3::UnitZ()});
      model.bodies[static_cast<std::size_t>(first)].initial_angular_velocity = Vec3(0, 0, 50);
      model.bodies[static_cast<std::size_t>(second)].initial_angular_velocity = Vec3(0, 0, 50);
      model.bodies[static_cast<std::size_t>(second)].initial_velocity = Vec3(0, 5, 0);
    }
    const auto engine =
        make_engine(model, settings({Effect::joint_stops, Effect::passive_tissue, Effect::gravity}, 1e-3,
                                    ArticulatedMethod::semi_implicit_euler));
    engine::test::run(*engine, 300);
    State state = engine->state();
    state.bodies.resize(slow.bodies.size());
    return engine::test::bits(state);
  };
  EXPECT_EQ(bits_of_fingers(true), bits_of_fingers(false));
}

}  // namespace
}  // namespace handsim::engine
