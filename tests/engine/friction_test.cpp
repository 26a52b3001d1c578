// Friction of pads with closed forms by Coulomb's law, under various loads, on each engine with contact.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/contact_scenes.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::JointKind;
using model::ShapeKind;
using test::sized;

constexpr double kMu = 0.5, kMass = 0.2;

class Friction : public testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(, Friction,
                         testing::Values(Method(OdeMethod::world_step),
                                         Method(ArticulatedMethod::semi_implicit_euler)),
                         [](const auto& method) { return std::string(name(method.param)); });

Settings how(Method method) {
  Settings out = test::settings(
      {Effect::gravity, Effect::object_contact, Effect::ground_contact, Effect::friction}, 1e-3, method);
  out.contact_forces = true;
  // The CFM of the shipped grasps: the four points of a pad have redundant friction rows, at which a solver
  // without compliance fails.
  if (out.engine() == EngineKind::ode) out.ode().cfm = 1e-8;
  return out;
}

/// A block with a ball below it on three sliders: it cannot rotate, and forces act on it along x, y and z.
model::Model pulled_block() {
  model::Model model = model::make_model();
  test::add_ground(model, kMu);
  model.materials[0].compliance = model::Compliance{1e5, 100};
  int parent = 0;
  for (int i = 0; i < 3; ++i) {
    const int child = test::add_body(model, test::body(i < 2 ? "rail" + std::to_string(i) : "block",
                                                       i < 2 ? 1e-3 : kMass, Vec3::Constant(1e-4)));
    test::add_joint(model, "slider" + std::to_string(i), JointKind::slider, parent, child,
                    {Vec3(0, 0, i == 0 ? 0.02 : 0), Quat::Identity()}, {}, {Vec3::Unit(i)});
    parent = child;
  }
  model::Shape ball = sized("ball", ShapeKind::sphere, 0.02, 0);
  ball.body = parent;
  model.shapes.push_back(ball);
  return model;
}

// Oracle: Coulomb's circular cone: in any direction, a load of 0.98 mu N does not move the block, and at 1.1
// mu N the friction is mu N to 1e-3.
TEST_P(Friction, IsMuTimesTheNormalForceInEveryDirection) {
  const model::Model model = pulled_block();
  const double limit = kMu * kMass * test::kG;
  for (int k = 0; k < 16; ++k)
    for (const double share : {0.98, 1.1}) {
      const auto engine = make_engine(model, how(GetParam()));
      test::run(*engine, 200);
      const Vec3 start = engine->state().bodies[3].p;
      const double heading = 0.1 + k * M_PI / 8;
      const std::vector<double> pull = {share * limit * std::cos(heading), share * limit * std::sin(heading),
                                        0};
      for (int i = 0; i < 300; ++i) engine->step({pull});
      ASSERT_EQ(engine->contacts().size(), 1U);
      const double friction = engine->contacts()[0].friction_force().norm();
      const double moved = (engine->state().bodies[3].p - start).norm();
      EXPECT_NEAR(friction, std::min(share, 1.0) * limit, 1e-3 * limit) << "heading " << heading;
      if (share < 1)
        EXPECT_LT(moved, 1e-6) << "heading " << heading;
      else
        EXPECT_GT(moved, 1e-3) << "heading " << heading;
    }
}

/// Velocity [m/s] of pulled_block() as it slides under a pull [N], after a time [s], by the midpoint rule: M
/// v' = pull - mu m g v / |v|. Along x both rails move with it, along y one.
Vec3 coulomb_slide(Vec3 v, const Vec3& pull, double time) {
  constexpr int kSteps = 20000;
  const double h = time / kSteps;
  const Vec3 mobility = Vec3(1 / (kMass + 2e-3), 1 / (kMass + 1e-3), 0);
  const auto acceleration = [&](const Vec3& at) -> Vec3 {
    return mobility.cwiseProduct(pull - kMu * kMass * test::kG * at.normalized());
  };
  for (int i = 0; i < kSteps; ++i) v += h * acceleration(v + h / 2 * acceleration(v));
  return v;
}

// Oracle: Coulomb's law: friction turns with the slip of a block that is pulled across its way. The error of
// a step's friction, which is that of its end, is of first order.
TEST_P(Friction, TurnsWithTheSlip) {
  const model::Model model = pulled_block();
  const double limit = kMu * kMass * test::kG, time = 0.1;
  double coarse = 0;
  for (const double step : {1e-3, 5e-4}) {
    Settings settings = how(GetParam());
    settings.step = step;
    const auto engine = make_engine(model, settings);
    const auto steps = [&](double seconds) { return static_cast<int>(std::lround(seconds / step)); };
    test::run(*engine, steps(0.2));
    for (int i = 0; i < steps(0.05); ++i) engine->step({std::vector<double>{3 * limit, 0, 0}});
    const Vec3 start = engine->state().bodies[3].v, pull(0, 1.2 * limit, 0);
    ASSERT_GT(start.norm(), 0.4);
    for (int i = 0; i < steps(time); ++i) engine->step({std::vector<double>{0, pull.y(), 0}});
    const Vec3 expected = coulomb_slide({start.x(), start.y(), 0}, pull, time);
    ASSERT_GT(expected.y(), 0.2);  // it has turned
    const double error = (engine->state().bodies[3].v - expected).norm();
    EXPECT_LT(error, 5 * step * expected.norm());
    if (coarse > 0) {
      EXPECT_LT(error, 0.6 * coarse);
    }
    coarse = error;
  }
}

/// A brake shoe: a lever hinged to the world at a height over a sled, its ball on the sled at a distance.
model::Model shoe_brake(double reach, double height) {
  model::Model model = model::make_model();
  model.groups = {{"all"}};
  model.contact_rules = {{0, 0}};
  model.materials = {test::material("lining", kMu)};
  model.materials[0].compliance = model::Compliance{1e5, 100};
  const int sled = test::add_body(model, test::body("sled", 5, Vec3::Constant(1e-2)));
  test::add_joint(model, "rail", JointKind::slider, 0, sled, {}, {}, {Vec3::UnitX()});
  model::Shape top = sized("top", ShapeKind::box, 0, 0, Vec3(4, 0.2, 0.02));
  top.pose.p = Vec3(0, 0, -0.01);
  top.body = sled;
  model.shapes.push_back(top);
  const int lever = test::add_body(model, test::body("lever", 0.02, Vec3::Constant(1e-5)));
  constexpr double kRadius = 0.005;
  test::add_joint(model, "pivot", JointKind::hinge, 0, lever, {Vec3(0, 0, height), Quat::Identity()},
                  {Vec3(-reach, 0, height - kRadius), Quat::Identity()}, {Vec3::UnitY()});
  model::Shape ball = sized("ball", ShapeKind::sphere, kRadius, 0);
  ball.body = lever;
  model.shapes.push_back(ball);
  return model;
}

// Oracle: moments about the pivot: N = tau / (reach -+ mu height), where friction increases or decreases the
// normal force. Without friction it would be tau / reach, a difference of 33 % here.
TEST_P(Friction, OfAShoeBrakeHasTheLimitOfItsOwnNormalForce) {
  constexpr double kReach = 0.05, kHeight = 0.025, kTorque = 0.2;
  const model::Model model = shoe_brake(kReach, kHeight);
  Settings settings = how(GetParam());
  settings.effects = {};
  for (const Effect effect : {Effect::object_contact, Effect::friction}) settings.effects.add(effect);
  for (const double speed : {1.0, -1.0}) {
    const auto engine = make_engine(model, settings);
    model::State start = engine->state();
    start.u[0] = speed;
    start.bodies[1].v = Vec3(speed, 0, 0);
    engine->set_state(start);
    for (int i = 0; i < 100; ++i) engine->step({std::vector<double>{0, kTorque}});
    ASSERT_EQ(engine->contacts().size(), 1U);
    const Contact& contact = engine->contacts()[0];
    // Friction of a sled that moves away from the pivot lifts the lever; towards the pivot, it presses the
    // lever down.
    const double normal = kTorque / (kReach + (speed > 0 ? 1 : -1) * kMu * kHeight);
    EXPECT_NEAR(contact.normal_force(), normal, 0.01 * normal) << speed;
    EXPECT_NEAR(contact.friction_force().norm(), kMu * normal, 0.01 * kMu * normal) << speed;
  }
}

// Oracle: Coulomb's law in the step in which a lining that stuck is torn loose: what would hold it changes
// its normal force, and its friction is of the normal force that is left.
TEST_P(Friction, OfAShoeBrakeThatIsTornLooseIsWithinItsCone) {
  constexpr double kReach = 0.05, kHeight = 0.025, kTorque = 0.2, kHeld = kMu * kTorque / kReach;
  const model::Model model = shoe_brake(kReach, kHeight);
  Settings settings = how(GetParam());
  settings.effects = {};
  for (const Effect effect : {Effect::object_contact, Effect::friction}) settings.effects.add(effect);
  for (const double pull : {1.0, -1.0}) {
    const auto engine = make_engine(model, settings);
    for (int i = 0; i < 100; ++i) engine->step({std::vector<double>{0.5 * pull * kHeld, kTorque}});
    EXPECT_LT(std::abs(engine->state().u[0]), 1e-3) << pull;
    for (int i = 0; i < 5; ++i) {
      engine->step({std::vector<double>{20 * pull * kHeld, kTorque}});
      ASSERT_EQ(engine->contacts().size(), 1U);
      const Contact& contact = engine->contacts()[0];
      EXPECT_GT(contact.normal_force(), 1) << pull << ", step " << i;
      EXPECT_LT(contact.friction_force().norm(), 1.01 * kMu * contact.normal_force())
          << pull << ", step " << i;
    }
  }
}

/// A box that stands on a post narrower than itself, with eight points on the post's rim.
model::Model box_on_post() {
  model::Model model = model::make_model();
  model.groups = {{"all"}};
  model.contact_rules = {{0, 0}};
  model.materials = {test::material("rigid", kMu)};
  model::Shape post = sized("post", ShapeKind::cylinder, 0.015, 0.2);
  post.pose.p = Vec3(0, 0, -0.1);
  model.shapes.push_back(post);
  test::add_solid(model, sized("box", ShapeKind::box, 0, 0, Vec3(0.045, 0.045, 0.15)), 0.28,
                  {Vec3(0, 0, 0.075), Quat::Identity()});
  return model;
}

// Oracle: Coulomb's law: what presses with nothing has no friction, to 1 % of the largest limit. A box that
// is pushed over the edge of its post stands on one or two points of the rim. With limits of the normal
// forces without friction, points that carried nothing had as much friction as these.
TEST_P(Friction, OfABoxThatTipsIsOnlyWhereItStands) {
  const model::Model model = box_on_post();
  const auto engine = make_engine(model, how(GetParam()));
  test::run(*engine, 50);
  const Vec3 push(0.7, 0.5, 0), at(0.01, -0.015, 0.05);  // N; from the centre, m
  for (int i = 0; i < 90; ++i) {
    const double share = std::min(i / 40.0, 1.0);
    const std::vector<BodyForce> forces = {{1, share * push, share * at.cross(push)}};
    engine->step({.forces = forces});
    double most = 0, unpressed = 0;
    for (const Contact& contact : engine->contacts()) {
      most = std::max(most, kMu * contact.normal_force());
      if (contact.normal_force() <= 0) unpressed = std::max(unpressed, contact.friction_force().norm());
    }
    EXPECT_LE(unpressed, 0.01 * most) << "step " << i;
  }
  EXPECT_GT(2 * std::acos(std::abs(engine->state().bodies[1].q.w())), 0.02) << "it has to tip";
}

/// Two pads on sliders that press a block between them; only friction carries the block.
model::Model squeezed_block() {
  model::Model model = model::make_model();
  model.groups = {{"all"}};
  model.contact_rules = {{0, 0}};
  model.materials = {test::material("pad", kMu)};
  model.materials[0].compliance = model::Compliance{3000, 10};
  test::add_solid(model, sized("block", ShapeKind::box, 0, 0, Vec3(0.04, 0.04, 0.04)), kMass, {});
  for (const double side : {-1.0, 1.0}) {
    const int pad =
        test::add_body(model, test::body(side < 0 ? "left" : "right", 0.02, Vec3::Constant(1e-5)));
    test::add_joint(model, side < 0 ? "rail_left" : "rail_right", JointKind::slider, 0, pad,
                    {Vec3(side * 0.03, 0, 0), Quat::Identity()}, {}, {Vec3(-side, 0, 0)});
    model::Shape shape =
        sized(side < 0 ? "left_pad" : "right_pad", ShapeKind::box, 0, 0, Vec3::Constant(0.02));
    shape.body = pad;
    model.shapes.push_back(shape);
  }
  return model;
}

// Oracle: 2 mu N = m g: while N decreases, the block stays at rest until N = m g / (2 mu), to 1 %.
TEST_P(Friction, HoldsASqueezedBlockUntilTheForceFallsBelowItsWeight) {
  const model::Model model = squeezed_block();
  const auto engine = make_engine(model, how(GetParam()));
  const double least = kMass * test::kG / (2 * kMu);
  double start = 0, force = 0;
  for (int i = 0; i < 4000; ++i) {
    // N decreases by 0.1 % of m g / (2 mu) in 10 ms: 23 ms after that value the block has fallen by 2 um.
    force = i < 500 ? 1.2 * least : (1.2 - 1e-4 * (i - 500)) * least;
    engine->step({std::vector<double>{force, force}});
    if (i == 1500) start = engine->state().bodies[1].p.z();
    if (i > 1500 && start - engine->state().bodies[1].p.z() > 2e-6) break;
  }
  EXPECT_NEAR(force, least, 0.01 * least);
}

}  // namespace
}  // namespace handsim::engine
