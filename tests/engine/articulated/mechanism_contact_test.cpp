// Mechanisms in contact on the articulated engine: hands, loops, stops and torque limits along with contacts;
// against statics, and against the ODE engine as the step shrinks.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/contact_scenes.h"
#include "support/slider_crank.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::ShapeKind;
using test::add_solid;
using test::articulated_settings;
using test::kG;
using test::sized;

/// Five fingers of capsules that close on a ball, palm down above the ground.
model::Model hand_on_ball() {
  model::Model model = test::five_fingers(true, true, true);
  model::Shape ball = sized("ball", ShapeKind::sphere, 0.025, 0);
  add_solid(model, ball, 0.05, {Vec3(0.01, 0.09, 0.035), Quat::Identity()});
  return model;
}

// Oracle: ODE world_step. Both are of first order: a step four times smaller brings them together at least
// twice as near. Without friction, and with so much that nothing slides (at a friction of 0.8,
// where ODE's pyramid is wider than the cone off its edges, the two stay 15 um apart at any step). On
// pads; rigid surfaces without restoring speed, which is as large as the depth that the last step before an
// impact happens to leave, whatever the step.
TEST(ArticulatedContact, HandClosingOnABallAgreesWithOdeAsTheStepShrinks) {
  struct Case {
    bool pads;
    double friction;
  };
  for (const Case& c : {Case{true, 0}, Case{false, 0}, Case{true, 20}}) {
    model::Model model = hand_on_ball();
    model.materials[0].friction = c.friction;
    if (c.pads) model.materials[0].compliance = model::Compliance{2000, 5};
    const auto run = [&](Method method, double h) {
      Settings how = test::settings(
          {Effect::gravity, Effect::object_contact, Effect::friction, Effect::passive_tissue}, h, method);
      if (!c.pads) test::set_erp(how, 0);
      const auto engine = make_engine(model, how);
      std::vector<double> torques(static_cast<std::size_t>(model.dof_count()), 0.0);
      for (std::size_t i = 0; i < torques.size(); i += 4) torques[i] = torques[i + 2] = 0.01;
      int touching = 0;
      for (long i = 0; i < std::lround(0.06 / h); ++i)
        touching = std::max(touching, engine->step({torques}).contacts);
      EXPECT_GT(touching, 1);
      return engine->state();
    };
    const auto distance = [&](double h) {
      const model::State a = run(ArticulatedMethod::semi_implicit_euler, h),
                         b = run(OdeMethod::world_step, h);
      double out = 0;
      for (std::size_t i = 0; i < a.bodies.size(); ++i)
        out = std::max(out, (a.bodies[i].p - b.bodies[i].p).norm());
      return out;
    };
    const double coarse = distance(2.5e-4), fine = distance(6.25e-5), finest = distance(1.5625e-5);
    EXPECT_LT(coarse, 5e-5);
    EXPECT_LT(fine, 0.5 * coarse) << c.pads << ' ' << c.friction;
    EXPECT_LT(finest, 0.5 * fine) << c.pads << ' ' << c.friction;
  }
}

// Oracle: ODE world_step; of first order both: steps four times smaller bring the two within a third. A
// closed loop, the slider-crank, pushes a block over a floor with friction; the loop stays whole. ODE's
// spring, at the step's end, damps by h k beside its damper, which has so much less.
TEST(ArticulatedContact, SliderCrankPushingABlockAgreesWithOdeAsTheStepShrinks) {
  using handsim::test::kSlider;
  model::Model model = handsim::test::slider_crank(study::SliderCrankSpec::iftomm());
  model.groups = {{"slider"}, {"block"}, {"floor"}};
  model.materials = {test::material("smooth", 0), test::material("rough", 0.3)};
  model.materials[0].compliance = model::Compliance{2e4, 50};
  model.contact_rules = {{0, 1, 0}, {1, 2, 1}};
  model.shapes = {sized("slider", ShapeKind::box, 0, 0, Vec3(0.04, 0.02, 0.02)),
                  test::shape("floor", ShapeKind::plane, 0)};
  model.shapes[0].body = kSlider;
  model.shapes[1].group = 2;
  model.shapes[1].pose.p = Vec3(0, 0, -0.02);
  const auto block =
      static_cast<std::size_t>(add_solid(model, sized("block", ShapeKind::box, 0, 0, Vec3(0.06, 0.04, 0.04)),
                                         0.3, {Vec3(0.26, 0, 0), Quat::Identity()}));
  model.shapes[2].group = 1;
  const auto run = [&](Method method, double h) {
    Settings how = test::settings(
        {Effect::gravity, Effect::object_contact, Effect::ground_contact, Effect::friction}, h, method);
    const bool is_ode = method == OdeMethod::world_step;
    if (is_ode) test::set_erp(how, 0.8);
    model.materials[0].compliance = model::Compliance{2e4, is_ode ? 50 - h * 2e4 : 50};
    const auto engine = make_engine(model, how);
    for (long i = 0; i < std::lround(0.2 / h); ++i) {
      EXPECT_EQ(engine->step({}).lcp_failures, 0);
      if (is_ode) continue;
      for (const model::Joint& joint : model.joints)
        EXPECT_LT(model::joint_gap(joint, engine->state()), 1e-12);
    }
    return engine->state();
  };
  std::vector<double> distances;
  for (const double h : {1e-3, 2.5e-4, 6.25e-5}) {
    const model::State a = run(ArticulatedMethod::semi_implicit_euler, h), b = run(OdeMethod::world_step, h);
    EXPECT_GT(a.bodies[block].p.x(), 0.29);
    distances.push_back(std::max((a.bodies[block].p - b.bodies[block].p).norm(),
                                 (a.bodies[kSlider].p - b.bodies[kSlider].p).norm()));
  }
  EXPECT_LT(distances[0], 1e-5);
  EXPECT_LT(distances[1], distances[0] / 3);
  EXPECT_LT(distances[2], distances[1] / 3);
}

// Oracle: bit equality of two runs, and of a run after others in the same process.
TEST(ArticulatedContact, RepeatsItselfToTheBit) {
  const model::Model model = hand_on_ball();
  const auto run = [&] {
    const auto engine =
        make_engine(model, articulated_settings({Effect::gravity, Effect::object_contact, Effect::friction,
                                                 Effect::passive_tissue, Effect::joint_stops}));
    test::run(*engine, 300);
    return test::bits(engine->state());
  };
  EXPECT_EQ(run(), run());
}

// Oracle: bases move as they are driven, whatever presses on them: two that lie in each other, as driven
// palms may, have no force. Its friction was not a number while the first finger touched, too, and the line
// search of steps for which Newton's method does not converge was lost.
TEST(ArticulatedContact, TwoBasesInEachOtherHaveNoForce) {
  model::Model model = hand_on_ball();
  model.bodies.back().zero_pose.p.x() = -0.03;
  for (const double x : {1.0, 1.03}) {
    const Pose at{Vec3(x, 0, 0), Quat::Identity()};
    const int base = add_solid(model, sized(x > 1 ? "right" : "left", ShapeKind::sphere, 0.02, 0), 0.1, at);
    model.bodies[static_cast<std::size_t>(base)].kinematic = true;
    model.drives.push_back({base, {}, {{{0, at}}, model::Interpolation::linear, {}}});
  }
  const auto left = static_cast<int>(model.shapes.size()) - 2;
  Settings how = articulated_settings({Effect::gravity, Effect::object_contact, Effect::friction,
                                       Effect::passive_tissue, Effect::wrist_motion});
  how.contact_forces = true;
  const auto engine = make_engine(model, how);
  std::vector<double> torques(static_cast<std::size_t>(model.dof_count()), 0.0);
  for (std::size_t i = 0; i < torques.size(); i += 4) torques[i] = torques[i + 2] = 0.01;
  int of_bases = 0, of_first_finger = 0;
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(engine->step({torques}).lcp_failures, 0) << i;
    for (const Contact& contact : engine->contacts()) {
      const int first = std::min(contact.shape_a, contact.shape_b);
      EXPECT_TRUE(contact.force.allFinite());
      of_first_finger += first < 3;
      if (first != left) continue;
      ++of_bases;
      EXPECT_EQ(contact.force, Vec3::Zero());
    }
  }
  EXPECT_GT(of_first_finger, 0);
  EXPECT_EQ(of_bases, 100);
}

// Oracle: bit equality with a run that was not interrupted. The solver's factor of the last step is saved,
// too.
TEST(ArticulatedContact, GoesOnFromWhatWasSavedToTheBit) {
  const model::Model model = hand_on_ball();
  const Settings of = articulated_settings(
      {Effect::gravity, Effect::object_contact, Effect::friction, Effect::passive_tissue});
  const auto whole = make_engine(model, of), later = make_engine(model, of);
  std::vector<double> torques(static_cast<std::size_t>(model.dof_count()), 0.0);
  for (std::size_t i = 0; i < torques.size(); i += 4) torques[i] = torques[i + 2] = 0.01;
  for (int save = 0; save < 3; ++save) {
    for (int i = 0; i < 100; ++i) whole->step({torques});
    ArchiveWriter out;
    whole->save(out);
    ArchiveReader in(out.bytes(), "saved");
    later->restore(whole->state(), in);
    int touching = 0;
    for (int i = 0; i < 40; ++i) {
      touching = std::max(touching, whole->step({torques}).contacts);
      later->step({torques});
    }
    EXPECT_GT(touching, 0) << save;
    EXPECT_EQ(test::bits(later->state()), test::bits(whole->state())) << save;
  }
}

// Oracle: the effects' definition.
TEST(ArticulatedContact, NoCollisionCodeRunsWithoutAContactEffectAndRule) {
  model::Model model = hand_on_ball();
  const auto without = make_engine(model, articulated_settings({Effect::gravity, Effect::friction}));
  EXPECT_FALSE(without->tests_contacts());
  const StepReport report = without->step({});
  EXPECT_EQ(report.collide_calls + report.contacts, 0);
  EXPECT_EQ(report.collide_ns, 0);
  EXPECT_TRUE(make_engine(model, articulated_settings({Effect::object_contact}))->tests_contacts());
  model.contact_rules.clear();
  EXPECT_FALSE(make_engine(model, articulated_settings({Effect::object_contact}))->tests_contacts());
}

/// A bar along x, hinged at its end, that gravity turns down onto the ground.
model::Model bar(std::optional<model::Stop> stop) {
  model::Model model = model::make_model();
  test::add_ground(model, 0);
  test::add_body(model, test::body("bar", 0.1, {1e-5, 1e-4, 1e-4}));
  // The ground is not the world's own: jointed bodies are not tested against each other.
  model::Body table = test::body("table", 1, {1, 1, 1});
  table.kinematic = true;
  model.shapes[0].body = test::add_body(model, table);
  test::add_joint(model, "pin", model::JointKind::hinge, 0, 1, {Vec3(0, 0, 0.05), Quat::Identity()},
                  {Vec3(-0.05, 0, 0), Quat::Identity()}, {Vec3::UnitY()});
  model.joints[0].axes[0].stop = stop;
  model::Shape ball = test::shape("tip", ShapeKind::sphere, 1);
  ball.radius = 0.01;
  ball.pose.p = Vec3(0.05, 0, 0);
  model.shapes.push_back(ball);
  return model;
}

// Oracles: geometry and statics: the tip stops the bar where it touches the ground, at sin q = (0.05 - 0.01)
// / 0.1, with m g/2 on it; a stop above the ground leaves nothing for the contact; and a stop and a contact
// at once let neither be passed.
TEST(ArticulatedContact, SharesTheLoadWithStops) {
  const double touch = std::asin(0.4);
  for (const double stop_at : {1.0, touch + 1e-7, 0.3}) {
    const model::Model model = bar(model::Stop{-0.5, stop_at, 0});
    Settings how = articulated_settings({Effect::gravity, Effect::ground_contact, Effect::joint_stops});
    how.contact_forces = true;
    const auto engine = make_engine(model, how);
    StepReport report;
    for (int i = 0; i < 1500; ++i) report = engine->step({});
    const double q = engine->state().q[0];
    EXPECT_LE(q, stop_at + 1e-12);
    EXPECT_NEAR(q, std::min(touch, stop_at), 3e-4);
    double force = 0;
    for (const Contact& contact : engine->contacts()) force += contact.force.norm();
    if (stop_at == 1.0) {
      EXPECT_NEAR(force, 0.05 * kG, 1e-3 * 0.05 * kG);
    }
    if (stop_at == 0.3) {
      EXPECT_EQ(force, 0);
      EXPECT_EQ(report.stop_rows, 1);
    }
  }
}

// Oracle: statics: a servo at its torque limit presses the tip down with limit / (0.1 cos q), and one far
// below it with its spring's torque; the weight's part is known.
TEST(ArticulatedContact, KeepsTorqueLimitsWhilePressing) {
  const model::Model model = bar(std::nullopt);
  const double q = std::asin(0.4), arm = 0.1 * std::cos(q);
  for (const double limit : {0.02, 1.0}) {
    Settings how = articulated_settings({Effect::gravity, Effect::ground_contact, Effect::actuation});
    how.contact_forces = true;
    const auto engine = make_engine(model, how);
    for (int i = 0; i < 1500; ++i) {
      const double now = engine->state().q[0];
      const model::Servo servo{1, 0.02, 0.5 - now, 0, limit};
      engine->step({.servos = std::span(&servo, 1)});
    }
    const double at_rest = engine->state().q[0];
    const double torque = std::min(limit, 0.5 - at_rest);
    ASSERT_EQ(engine->contacts().size(), 1U);
    EXPECT_NEAR(engine->contacts()[0].normal_force(), torque / arm + 0.05 * kG, 2e-3 * (torque / arm));
  }
}

// Oracle: Coulomb: two fingers of a kinematic palm squeeze a ball between them and hold it up against gravity
// by friction alone; without friction it falls.
TEST(ArticulatedContact, PinchHoldsABallByFriction) {
  for (const bool friction : {true, false}) {
    model::Model model = model::make_model();
    model.groups = {{"all"}};
    model.contact_rules = {{0, 0}};
    model.materials = {test::material("rubber", 0.8)};
    model.materials[0].spinning_friction = 0.002;
    model::Body palm = test::body("palm", 0.3, {3e-4, 3e-4, 5e-4});
    palm.kinematic = true;
    test::add_body(model, palm);
    for (const double side : {-1.0, 1.0}) {
      const std::string name = side < 0 ? "left" : "right";
      const int finger = test::add_body(model, test::body(name, 0.02, {4e-6, 4e-6, 1e-6}));
      test::add_joint(model, name + "_slide", model::JointKind::slider, 1, finger,
                      {Vec3(side * 0.04, 0, 0), Quat::Identity()}, {}, {Vec3::UnitX()});
      model::Shape box = sized(name + "_box", ShapeKind::box, 0, 0, Vec3(0.02, 0.04, 0.04));
      box.body = finger;
      model.shapes.push_back(box);
    }
    add_solid(model, sized("ball", ShapeKind::sphere, 0.0299, 0), 0.1, {Vec3::Zero(), Quat::Identity()});
    model.gravity = Vec3(0, 0, -kG);
    Settings how = articulated_settings({Effect::gravity, Effect::object_contact});
    if (friction) how.effects.add(Effect::friction);
    const auto engine = make_engine(model, how);
    const std::vector<double> torques = {2, -2};
    for (int i = 0; i < 100; ++i) engine->step({torques});
    const double z = engine->state().bodies[4].p.z();
    for (int i = 0; i < 500; ++i) engine->step({torques});
    if (friction)
      EXPECT_NEAR(engine->state().bodies[4].p.z(), z, 1e-6);
    else
      EXPECT_LT(engine->state().bodies[4].p.z(), z - 0.02);
  }
}

}  // namespace
}  // namespace handsim::engine
