// The step of ODE: free motion, order of convergence, drives, tissue, restoring, reproducibility.
#include <gtest/gtest.h>

#include <cmath>
#include <future>

#include "engine/models.h"
#include "handsim/engine/ode/ode_engine.h"
#include "handsim/engine/spring.h"

namespace handsim::engine {
namespace {

using model::Effect;
using test::settings;

// Oracle: the semi-implicit Euler recurrence v += h g, p += h v.
TEST(FreeFall, FollowsSemiImplicitEuler) {
  model::Model model = model::make_model();
  test::add_body(model, test::body("ball", 0.1, {1e-4, 1e-4, 1e-4}, {Vec3(1, 2, 3), Quat::Identity()}));
  model.bodies[1].initial_velocity = Vec3(0.5, 0, 1);
  const auto engine = make_engine(model, settings({Effect::gravity}));
  Vec3 p(1, 2, 3);
  Vec3 v(0.5, 0, 1);
  for (int i = 0; i < 1000; ++i) {
    engine->step({});
    v += 1e-3 * model.gravity;
    p += 1e-3 * v;
  }
  EXPECT_LT((engine->state().bodies[1].p - p).norm(), 1e-12);
  EXPECT_LT((engine->state().bodies[1].v - v).norm(), 1e-12);
  EXPECT_EQ(engine->state().time, 1.0);
}

// Oracle: the effect's definition.
TEST(FreeFall, NeedsTheEffectGravity) {
  model::Model model = model::make_model();
  test::add_body(model, test::body("ball", 0.1, {1e-4, 1e-4, 1e-4}));
  const auto engine = make_engine(model, settings({}));
  test::run(*engine, 100);
  EXPECT_EQ(engine->state().bodies[1].p, Vec3::Zero());
}

/// Angle of a pendulum at 0.5 s from 0.05 rad at rest.
double pendulum_angle(double step) {
  model::Model model = test::hinged_body(0.1);
  model.joints[0].axes[0].initial = 0.05;
  const auto engine = make_engine(model, settings({Effect::gravity}, step));
  test::run(*engine, static_cast<int>(std::lround(0.5 / step)));
  return engine->state().q[0];
}

// Oracle: closed form, w^2 = m g l / (I + m l^2); amplitude lengthens the period by a^2/16 = 1.6e-4.
TEST(Pendulum, SwingsWithItsSmallAnglePeriod) {
  model::Model model = test::hinged_body(0.1);
  model.joints[0].axes[0].initial = 0.05;
  const auto engine = make_engine(model, settings({Effect::gravity}, 1e-4));
  const double period = 2 * M_PI / std::sqrt(0.1 * 9.80665 * 0.1 / (1e-4 + 0.1 * 0.01));
  // The second downward crossing of zero is at 5/4 of the period.
  int downward = 0;
  double last = 0.05;
  while (downward < 2 && engine->state().time < 2) {
    engine->step({});
    const double angle = engine->state().q[0];
    if (last > 0 && angle <= 0) ++downward;
    last = angle;
  }
  EXPECT_NEAR(engine->state().time / (1.25 * period), 1, 1e-3);
}

// Oracle: order of convergence 1: the error relative to a fine step halves with the step.
TEST(Pendulum, ConvergesAtFirstOrder) {
  const double fine = pendulum_angle(1.0 / 64000);
  const double coarse = std::abs(pendulum_angle(1.0 / 500) - fine);
  const double middle = std::abs(pendulum_angle(1.0 / 1000) - fine);
  EXPECT_NEAR(std::log2(coarse / middle), 1, 0.15);
}

// Oracle: the closed forms of both.
TEST(SoftRow, HasTheErpAndCfmOfASpringDamper) {
  const SoftRow row = soft_row(200, 3, 0.01);
  EXPECT_DOUBLE_EQ(row.erp, 0.4);
  EXPECT_DOUBLE_EQ(row.cfm, 0.2);
  EXPECT_EQ(soft_row(0, 3, 0.01).erp, 0);
}

/// Compares tissue on one coordinate of inertia `inertia` with its recurrence.
void compare_tissue(const model::Model& model, double inertia, double q, double stiffness, double damping,
                    double rest) {
  const double h = 2e-3;
  const auto engine = make_engine(model, settings({Effect::passive_tissue}, h));
  double v = 0;
  for (int i = 0; i < 500; ++i) {
    engine->step({});
    v = (inertia * v - h * stiffness * (q - rest)) / (inertia + h * (damping + h * stiffness));
    q += h * v;
    ASSERT_NEAR(engine->state().q[0], q, 1e-9) << "step " << i;
  }
}

// Oracle: the discrete recurrence of an implicit spring-damper, I (v+ - v) / h = -k (q + h v+ - rest) - c v+.
TEST(Tissue, OnAHingeFollowsTheImplicitSpringDamperRecurrence) {
  for (const auto& [k, c] : {std::pair(0.05, 1e-3), std::pair(0.0, 1e-3), std::pair(0.05, 0.0)}) {
    model::Model model = test::hinged_body(0, {1e-3, 1e-3, 1e-3});
    model.joints[0].axes[0].tissue = model::Tissue{k, c, 0.03};
    model.joints[0].axes[0].initial = 0.05;
    compare_tissue(model, 1e-3, 0.05, k, c, 0.03);
  }
}

// Oracle: the same recurrence with mass instead of inertia.
TEST(Tissue, OnASliderFollowsTheImplicitSpringDamperRecurrence) {
  model::Model model = model::make_model();
  test::add_body(model, test::body("slide", 0.2, {1e-3, 1e-3, 1e-3}));
  model::Joint& joint = test::add_joint(model, "rail", model::JointKind::slider, 0, 1,
                                        {Vec3(0.1, 0, 0), Quat::Identity()}, {}, {Vec3(0.6, 0, 0.8)});
  joint.axes[0].tissue = model::Tissue{40, 0.5, -0.01};
  joint.axes[0].initial = 0.02;
  compare_tissue(model, 0.2, 0.02, 40, 0.5, -0.01);
}

// Oracle: statics; a torque on either axis of a universal joint deflects that axis by tau / k.
TEST(Tissue, OnAUniversalJointHoldsEachAxisByItsOwnStiffness) {
  for (const bool on_world : {true, false}) {
    model::Model model = model::make_model();
    int parent = 0;
    if (!on_world) {
      model::Body base = test::body("base", 1, {1e-3, 1e-3, 1e-3},
                                    {Vec3(0.1, 0.2, 0.3), rotation_quaternion({0.3, 1, 0.2})});
      base.kinematic = true;
      parent = test::add_body(model, base);
      model.drives.push_back({parent, {}, {{{0, base.zero_pose}}, model::Interpolation::linear, {}}});
    }
    test::add_body(model, test::body("finger", 0.1, {1e-4, 1e-4, 1e-4}));
    model::Joint& joint = test::add_joint(model, "knuckle", model::JointKind::universal, parent, parent + 1,
                                          {Vec3(0, 0, 0.1), rotation_quaternion({0.5, 0.2, 0})}, {},
                                          {Vec3::UnitY(), Vec3::UnitX()});
    joint.axes[0].tissue = model::Tissue{0.1, 5e-3, 0};
    joint.axes[1].tissue = model::Tissue{0.2, 5e-3, 0.1};
    const auto engine = make_engine(model, settings({Effect::passive_tissue, Effect::wrist_motion}));
    const std::vector<double> tau = {0.02, -0.06};
    for (int i = 0; i < 3000; ++i) engine->step({tau});
    const std::vector<double> q = engine->state().q;
    EXPECT_NEAR(q[0], 0.2, 1e-6);
    EXPECT_NEAR(q[1], 0.1 - 0.3, 1e-6);
  }
}

// Oracle: a damper only removes energy; at 20 ms and 500 times the explicit limit, kinetic energy never
// grows.
TEST(Tissue, OfStiffDampingNeverAddsEnergyAtTwentyMilliseconds) {
  model::Model model = test::five_fingers(false, true);
  for (model::Joint& joint : model.joints)
    for (model::JointAxis& axis : joint.axes) axis.tissue = model::Tissue{0, 0.05, 0};
  std::mt19937 random(1);
  for (std::size_t i = 2; i < model.bodies.size(); i += 3) {
    model.bodies[i].initial_angular_velocity = 3 * test::random_vector(random);
  }
  const auto engine = make_engine(model, settings({Effect::passive_tissue}, 0.02));
  const auto energy = [&] {
    double sum = 0;
    for (std::size_t i = 2; i < model.bodies.size(); ++i) {
      const model::BodyState& b = engine->state().bodies[i];
      const Vec3 w_B = b.q.conjugate() * b.w;
      sum += 0.5 * model.bodies[i].mass * b.v.squaredNorm() + 0.5 * w_B.dot(model.bodies[i].inertia * w_B);
    }
    return sum;
  };
  const double start = energy();
  double last = start;
  for (int i = 0; i < 200; ++i) {
    engine->step({});
    // The position correction of the joints may add erp^2 of the gap of the first step, far below 1e-6.
    ASSERT_LE(energy(), last + 1e-6 * start) << "step " << i;
    last = energy();
  }
  EXPECT_LT(last, 1e-3 * start);
}

/// A hand whose palm follows three keyframes.
model::Model driven_hand() {
  model::Model model = test::five_fingers(true, true);
  const Pose start = model.bodies[1].zero_pose;
  model::Drive drive;
  drive.body = 1;
  drive.frame = {Vec3(0, -0.05, 0.01), rotation_quaternion({0.1, 0.2, 0.3})};
  drive.motion.keys = {{0, start * drive.frame},
                       {0.4, Pose{Vec3(0.2, 0.1, -0.1), rotation_quaternion({1.5, -1, 0.5})}},
                       {0.9, Pose{Vec3(-0.1, 0, 0.3), rotation_quaternion({-2, 0.4, 0.1})}}};
  model.drives.push_back(drive);
  return model;
}

// Oracle: the trajectory, to rounding, in every step and at the end.
TEST(Drive, FollowsItsTrajectoryToRounding) {
  const model::Model model = driven_hand();
  const auto engine =
      make_engine(model, settings({Effect::wrist_motion, Effect::gravity, Effect::joint_stops}));
  for (int i = 0; i < 1500; ++i) {
    engine->step({});
    const Pose want = model.drives[0].motion.at(engine->state().time) * model.drives[0].frame.inverse();
    const model::BodyState& palm = engine->state().bodies[1];
    ASSERT_LT((palm.p - want.p).norm(), 1e-12);
    ASSERT_LT(palm.q.angularDistance(want.q), 1e-12);
  }
  EXPECT_NEAR(engine->state().time, 1.5, 1e-12);
  EXPECT_EQ(engine->state().bodies[1].v, Vec3::Zero());
  for (const model::Joint& joint : model.joints) EXPECT_LT(model::joint_gap(joint, engine->state()), 1e-4);
}

// Oracle: the effect's definition.
TEST(Drive, DoesNotMoveWithoutWristMotion) {
  const model::Model model = driven_hand();
  const auto engine = make_engine(model, settings({Effect::gravity}));
  const Vec3 start = engine->state().bodies[1].p;
  test::run(*engine, 100);
  EXPECT_EQ(engine->state().bodies[1].p, start);
}

// Oracle: two ways that must agree. A palm that a drive holds at rest is an ODE body with copies, a palm
// without a drive is ODE's world; the mechanics is the same.
TEST(Islands, OfADrivenPalmAndOfAFixedOneMoveAlike) {
  model::Model still = test::five_fingers(true, true);
  still.bodies[1].zero_pose = {Vec3(0.1, 0.2, 0.3), rotation_quaternion({0.3, 0.2, 0.1})};
  model::Model driven = still;
  driven.drives.push_back({1, {}, {{{0, still.bodies[1].zero_pose}}, model::Interpolation::linear, {}}});
  const Settings with =
      settings({Effect::wrist_motion, Effect::gravity, Effect::joint_stops, Effect::passive_tissue});
  const auto a = make_engine(still, with);
  const auto b = make_engine(driven, with);
  test::run(*a, 1000);
  test::run(*b, 1000);
  for (std::size_t i = 0; i < still.bodies.size(); ++i)
    // Only rounding errors differ, and stops and gravity do not amplify them.
    EXPECT_LT((a->state().bodies[i].p - b->state().bodies[i].p).norm(), 1e-9);
}

// Oracle: invariance; a hand whose fixed palm is moved behaves like one that was built there.
TEST(SetState, MovesAFixedPalmWithItsFingers) {
  model::Model here = test::five_fingers(true, true);
  model::Model there = here;
  there.bodies[1].zero_pose = {Vec3(0.1, 0.2, 0.3), rotation_quaternion({0.3, 0.2, 0.1})};
  const Settings with = settings({Effect::gravity, Effect::joint_stops, Effect::passive_tissue});
  const auto a = make_engine(here, with);
  const auto b = make_engine(there, with);
  a->set_state(b->state());
  test::run(*a, 300);
  test::run(*b, 300);
  EXPECT_EQ(test::bits(a->state()), test::bits(b->state()));
}

class BothMethods : public testing::TestWithParam<Method> {
 protected:
  Settings with(double step = 1e-3) const {
    return settings({Effect::gravity, Effect::joint_stops, Effect::passive_tissue, Effect::wrist_motion,
                     Effect::self_contact, Effect::friction},
                    step, GetParam());
  }
};

/// Fingers that touch each other, and balls that roll on the ground and collide: enough shapes for
/// sweep-and-prune.
model::Model hand_with_many_contacts() {
  model::Model model = test::five_fingers(true, true, true);
  model.drives = driven_hand().drives;
  for (int i = 0; i < 10; ++i) {
    const Pose at{Vec3(0.3 + 0.041 * (i % 5), 0.041 * (i / 5), -0.28), Quat::Identity()};
    const int ball =
        test::add_body(model, test::body("ball" + std::to_string(i), 0.05, {1e-5, 1e-5, 1e-5}, at));
    model.bodies[static_cast<std::size_t>(ball)].initial_velocity =
        Vec3(0.3 - 0.12 * (i % 5), 0.1 - 0.2 * (i / 5), 0);
    model::Shape round = test::shape("round" + std::to_string(i), model::ShapeKind::sphere, ball);
    round.radius = 0.02;
    model.shapes.push_back(round);
  }
  model::Shape ground = test::shape("ground", model::ShapeKind::plane, 0);
  ground.pose.p = Vec3(0, 0, -0.3);
  model.shapes.push_back(ground);
  for (model::Joint& joint : model.joints)
    if (joint.kind == model::JointKind::universal)
      joint.axes[1].initial = 0.15 * (joint.child % 2 == 0 ? 1 : -1);
  return model;
}

// Oracle: bit equality of 3000 steps after a restore, in the same engine and in a new one.
TEST_P(BothMethods, ContinueFromASavedStateWithTheSameBits) {
  const model::Model model = hand_with_many_contacts();
  const auto engine = make_engine(model, with());
  test::run(*engine, 500);
  const model::State saved = engine->state();
  ArchiveWriter rest;
  engine->save(rest);
  int contacts = 0;
  for (int i = 0; i < 3000; ++i) contacts += engine->step({}).contacts;
  EXPECT_GT(contacts, 3000);
  const std::vector<std::uint64_t> want = test::bits(engine->state());
  test::resume(*engine, saved, rest.bytes());
  test::run(*engine, 3000);
  EXPECT_EQ(test::bits(engine->state()), want);
  const auto fresh = make_engine(model, with());
  test::resume(*fresh, saved, rest.bytes());
  test::run(*fresh, 3000);
  EXPECT_EQ(test::bits(fresh->state()), want);
}

// Oracle: bit equality with and without steps of another engine in between.
TEST_P(BothMethods, AreIndependentOfAnotherEngineInTheProcess) {
  const model::Model model = hand_with_many_contacts();
  const auto alone = make_engine(model, with());
  test::run(*alone, 1000);
  const auto a = make_engine(model, with());
  const auto b = make_engine(model, with(2e-3));
  for (int i = 0; i < 1000; ++i) {
    a->step({});
    b->step({});
  }
  EXPECT_EQ(test::bits(a->state()), test::bits(alone->state()));
}

// Oracle: bit equality of 8 threads, each with its own engine, and a single run.
TEST_P(BothMethods, GiveTheSameBitsInEightThreads) {
  const model::Model model = hand_with_many_contacts();
  const auto alone = make_engine(model, with());
  test::run(*alone, 500);
  std::vector<std::future<std::vector<std::uint64_t>>> found;
  for (int i = 0; i < 8; ++i)
    found.push_back(std::async(std::launch::async, [&] {
      const auto engine = make_engine(model, with());
      test::run(*engine, 500);
      return test::bits(engine->state());
    }));
  for (auto& each : found) EXPECT_EQ(each.get(), test::bits(alone->state()));
}

INSTANTIATE_TEST_SUITE_P(Methods, BothMethods, testing::Values(OdeMethod::world_step, OdeMethod::quick_step),
                         [](const auto& each) {
                           return each.param == OdeMethod::world_step ? "WorldStep" : "QuickStep";
                         });

// Oracle: another seed gives another order of rows, hence other bits.
TEST(QuickStep, DependsOnItsSeed) {
  const model::Model model = hand_with_many_contacts();
  Settings with = settings({Effect::gravity, Effect::joint_stops}, 1e-3, OdeMethod::quick_step);
  const auto a = make_engine(model, with);
  with.ode().seed = 2;
  const auto b = make_engine(model, with);
  test::run(*a, 200);
  test::run(*b, 200);
  EXPECT_NE(test::bits(a->state()), test::bits(b->state()));
}

}  // namespace
}  // namespace handsim::engine
