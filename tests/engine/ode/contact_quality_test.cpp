// How good contacts are: rest, forces, impact, friction in any direction, pads.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/contact_scenes.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::ShapeKind;
using test::add_solid;
using test::kContact;
using test::kG;
using test::settings;
using test::sized;

model::Model empty_world(double friction) {
  model::Model model = model::make_model();
  model.groups = {{"all"}};
  model.contact_rules = {{}};
  model.materials = {test::material("rubber", friction)};
  return model;
}

/// A finger-sized capsule (10 g, 8 mm, 40 mm) lying on a still box or cylinder, turned by `yaw`, its middle
/// `off` the solid's along its axis.
model::Model resting_capsule(ShapeKind on, double yaw, double off) {
  model::Model model = empty_world(0.8);
  model::Shape solid = sized("solid", on, 0.02, 0.05, Vec3(0.06, 0.06, 0.02));
  double top = 0.01;
  if (on == ShapeKind::cylinder) {
    solid.pose.q = rotation_quaternion({0, M_PI / 2, 0});
    top = 0.02;
  }
  model.shapes.push_back(solid);
  const Quat turned = rotation_quaternion({0, 0, yaw}) * rotation_quaternion({0, M_PI / 2, 0});
  add_solid(model, sized("capsule", ShapeKind::capsule, 0.008, 0.04), 0.01,
            {Vec3(off, 0, top + 0.008), turned});
  return model;
}

// Oracle: statics; rms speed at most 10 um/s (stock ODE has 2642), depth at most 50 um.
TEST(RestingCapsule, StaysStillOnABoxAndOnACylinder) {
  struct Case {
    ShapeKind on;
    double yaw, off;
  };
  for (const Case& c : {Case{ShapeKind::box, 0, 0}, Case{ShapeKind::box, 0.4, 0},
                        Case{ShapeKind::box, 0.2, 0.02}, Case{ShapeKind::box, M_PI / 4, 0.01},
                        Case{ShapeKind::cylinder, 0, 0}, Case{ShapeKind::cylinder, 0, 0.015}})
    for (const double step : {1e-3, 5e-3}) {
      const model::Model model = resting_capsule(c.on, c.yaw, c.off);
      const auto engine = make_engine(model, settings(kContact, step));
      EXPECT_LT(test::rms_speed_at_rest(*engine, step), 1e-5)
          << "yaw " << c.yaw << ", off " << c.off << ", step " << step;
      for (const Contact& contact : engine->contacts()) EXPECT_LT(contact.depth, 5e-5);
      EXPECT_EQ(engine->contacts().size(), 2U) << "yaw " << c.yaw;
    }
}

// Oracle: equilibrium; the contacts carry the weight, and their moment about the centre of mass is none.
TEST(ContactForces, CarryTheWeightAtRest) {
  for (const Method method : {OdeMethod::world_step, OdeMethod::quick_step}) {
    model::Model model = empty_world(0.8);
    model.shapes.push_back(sized("table", ShapeKind::box, 0, 0, Vec3(0.2, 0.2, 0.02)));
    add_solid(model, sized("block", ShapeKind::box, 0, 0, Vec3(0.04, 0.03, 0.02)), 0.2,
              {Vec3(0, 0, 0.02), Quat::Identity()});
    add_solid(model, sized("finger", ShapeKind::capsule, 0.008, 0.02), 0.05,
              {Vec3(0, 0, 0.038), rotation_quaternion({0, M_PI / 2, 0})});
    Settings how = settings(kContact, 1e-3, method);
    how.contact_forces = true;
    how.ode().iterations = 100;
    const auto engine = make_engine(model, how);
    test::run(*engine, 2000);
    Vec3 on_block = Vec3::Zero(), on_table = Vec3::Zero();
    for (const Contact& contact : engine->contacts()) {
      EXPECT_GE(contact.normal_force(), 0);
      const bool table = contact.shape_a == 0;
      (table ? on_table : on_block) += contact.force;
    }
    const double share = method == OdeMethod::world_step ? 1e-3 : 2e-2;
    EXPECT_NEAR(on_table.z(), -0.25 * kG, share * 0.25 * kG);
    EXPECT_NEAR(on_block.z(), -0.05 * kG, share * 0.05 * kG);
    EXPECT_LT(on_table.head<2>().norm(), share * kG);
  }
}

// Oracle: Newton's law of restitution; whatever the ERP.
TEST(Restitution, IsTheMaterialsWhateverTheErp) {
  for (const double erp : {0.1, 0.2, 0.5, 0.8, 1.0})
    for (const double restitution : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9}) {
      Settings how = settings(kContact);
      test::set_erp(how, erp);
      const model::Model model = test::ball_above_ground(1.02, restitution);
      const auto engine = make_engine(model, how);
      const test::Bounce found = test::bounce(*engine);
      EXPECT_NEAR(found.impact, std::sqrt(2 * kG), 0.01);
      EXPECT_NEAR(found.rebound / found.impact, restitution, 0.05) << "erp " << erp;
    }
}

// Oracle: Coulomb in closed form, friction angle 26.57 deg for 0.5: at 26 deg the box creeps by at most 1
// um/s, at 27.5 deg its speed after 1 s is g (sin a - mu cos a) within 0.5 %, in any direction.
TEST(Incline, SticksAndSlidesAlikeInEveryDirection) {
  for (int k = 0; k < 8; ++k) {
    const double heading = k * M_PI / 8;
    for (const double degrees : {26.0, 27.5}) {
      const double angle = degrees * M_PI / 180;
      const model::Model model = test::box_on_incline(test::tilted(angle, heading));
      const auto engine =
          make_engine(model, settings({Effect::gravity, Effect::ground_contact, Effect::friction}));
      test::run(*engine, 100);
      const model::BodyState start = engine->state().bodies[1];
      test::run(*engine, 1000);
      const model::BodyState& end = engine->state().bodies[1];
      const double want = test::gain_on_incline(angle);
      if (want > 0)
        EXPECT_NEAR(end.v.norm() - start.v.norm(), want, 5e-3 * want)
            << degrees << " deg, heading " << heading;
      else
        EXPECT_LT((end.p - start.p).norm(), 1e-6) << degrees << " deg, heading " << heading;
    }
  }
}

// Oracle: closed forms.
TEST(Ball, IsSlowedByRollingAndSpinningFriction) {
  for (const test::BallMotion motion : {test::BallMotion::rolling, test::BallMotion::spinning}) {
    const model::Model model = test::moving_ball(motion);
    const auto engine =
        make_engine(model, settings({Effect::gravity, Effect::ground_contact, Effect::friction}));
    test::expect_ball_as_in_closed_form(motion, *engine);
  }
}

// Oracle: Hooke; a block on a pad of stiffness k sinks by m g / k beyond the layer, however many points carry
// it, and two pads sink as springs in series.
TEST(Pad, SinksByWeightOverStiffness) {
  for (const bool both : {false, true}) {
    model::Model model = empty_world(0.8);
    model.materials.push_back(test::material("pad", 0.8));
    model.materials[1].compliance = model::Compliance{2000, 20};
    if (both) model.materials[0].compliance = model::Compliance{6000, 20};
    model.shapes.push_back(sized("ground", ShapeKind::plane, 0, 0));
    add_solid(model, sized("block", ShapeKind::box, 0, 0, Vec3::Constant(0.04)), 0.5,
              {Vec3(0, 0, 0.02), Quat::Identity()});
    model.shapes[1].material = 1;
    const auto engine = make_engine(model, settings(kContact));
    test::run(*engine, 3000);
    const double stiffness = both ? 1500.0 : 2000.0;
    EXPECT_NEAR(0.02 - engine->state().bodies[1].p.z(), 1e-5 + 0.5 * kG / stiffness, 1e-6);
    EXPECT_LT(engine->state().bodies[1].v.norm(), 1e-7);
  }
}

// Oracle: the rule's definition: its material overrides the shapes' own.
TEST(ContactRule, MaterialOverridesTheShapesOwn) {
  for (const bool slippery : {false, true}) {
    model::Model model = test::box_on_incline(test::tilted(0.3, 0), 0.8);
    model.materials.push_back(test::material("ice", 0));
    if (slippery) model.contact_rules[0].material = 1;
    const auto engine =
        make_engine(model, settings({Effect::gravity, Effect::ground_contact, Effect::friction}));
    test::run(*engine, 1000);
    EXPECT_NEAR(engine->state().bodies[1].v.norm(), slippery ? kG * std::sin(0.3) : 0.0, 5e-3);
  }
}

}  // namespace
}  // namespace handsim::engine
