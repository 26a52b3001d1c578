// Contact of solids on the articulated engine: rest, forces, impact, friction, pads; against closed forms.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/contact_scenes.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::ShapeKind;
using test::add_solid;
using test::articulated_settings;
using test::kContact;
using test::kG;
using test::sized;

// Oracle: statics: the forces carry the weights within 0.1 %, and push only.
TEST(ArticulatedContact, CarriesTheWeightAtRest) {
  for (const double step : {1e-3, 5e-3}) {
    model::Model model = model::make_model();
    test::add_ground(model, 0.8);
    add_solid(model, sized("block", ShapeKind::box, 0, 0, Vec3(0.04, 0.03, 0.02)), 0.2,
              {Vec3(0, 0, 0.01), Quat::Identity()});
    add_solid(model, sized("finger", ShapeKind::capsule, 0.008, 0.02), 0.05,
              {Vec3(0, 0, 0.028), rotation_quaternion({0, M_PI / 2, 0})});
    add_solid(model, sized("ball", ShapeKind::sphere, 0.02, 0), 0.1, {Vec3(0.2, 0, 0.02), Quat::Identity()});
    Settings how = articulated_settings(kContact, step);
    how.contact_forces = true;
    const auto engine = make_engine(model, how);
    int sweeps = 0;
    for (int i = 0; i < static_cast<int>(2 / step); ++i) {
      const StepReport report = engine->step({});
      sweeps += report.contact_sweeps;
      EXPECT_EQ(report.lcp_failures, 0);
      EXPECT_LE(report.contact_residual, 1e-4 * step);
    }
    // Warm starts: hardly any work at rest.
    EXPECT_LT(sweeps * step / 2, 10);
    std::array<Vec3, 3> on = {Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
    for (const Contact& contact : engine->contacts()) {
      EXPECT_GE(contact.normal_force(), 0);
      // Shape 0 is the ground; the force on b is the opposite of that on a.
      on[static_cast<std::size_t>(contact.shape_b - 1)] -= contact.force;
    }
    EXPECT_NEAR(on[0].z(), 0.25 * kG, 1e-3 * 0.25 * kG);
    EXPECT_NEAR(on[1].z(), 0.05 * kG, 1e-3 * 0.05 * kG);
    EXPECT_NEAR(on[2].z(), 0.1 * kG, 1e-3 * 0.1 * kG);
    EXPECT_LT(on[0].head<2>().norm(), 1e-3 * kG);
  }
}

// Oracle: statics; rms speed at most 10 um/s, depth at most 50 um.
TEST(ArticulatedContact, CapsuleRestsStillOnABox) {
  for (const double yaw : {0.0, 0.2, M_PI / 4})
    for (const double step : {1e-3, 5e-3}) {
      model::Model model = model::make_model();
      test::add_ground(model, 0.8);
      model.shapes[0] = sized("box", ShapeKind::box, 0, 0, Vec3(0.06, 0.06, 0.02));
      const Quat turned = rotation_quaternion({0, 0, yaw}) * rotation_quaternion({0, M_PI / 2, 0});
      add_solid(model, sized("capsule", ShapeKind::capsule, 0.008, 0.04), 0.01,
                {Vec3(0.01, 0, 0.018), turned});
      const auto engine = make_engine(model, articulated_settings(kContact, step));
      EXPECT_LT(test::rms_speed_at_rest(*engine, step), 1e-5) << "yaw " << yaw << ", step " << step;
      for (const Contact& contact : engine->contacts()) EXPECT_LT(contact.depth, 5e-5);
    }
}

// Oracle: Coulomb in closed form, friction angle 26.57 deg for 0.5: at 26 deg the box creeps by at most 1
// um in 1 s, at 27.5 deg its speed after 1 s is g (sin a - mu cos a) within 0.5 %, in any direction; and it
// slides straight down.
TEST(ArticulatedContact, InclineSticksAndSlidesAlikeInEveryDirection) {
  for (int k = 0; k < 8; ++k) {
    const double heading = k * M_PI / 8;
    for (const double degrees : {26.0, 27.5}) {
      const double angle = degrees * M_PI / 180;
      const model::Model model = test::box_on_incline(test::tilted(angle, heading));
      const auto engine = make_engine(model, articulated_settings(kContact));
      test::run(*engine, 100);
      const model::BodyState start = engine->state().bodies[1];
      test::run(*engine, 1000);
      const model::BodyState& end = engine->state().bodies[1];
      const double want = test::gain_on_incline(angle);
      if (want > 0) {
        EXPECT_NEAR(end.v.norm() - start.v.norm(), want, 5e-3 * want) << degrees << ", " << heading;
        const Vec3 across(std::cos(heading), std::sin(heading), 0);
        EXPECT_LT(std::abs((end.p - start.p).dot(across)), 1e-4 * (end.p - start.p).norm()) << heading;
      } else {
        EXPECT_LT((end.p - start.p).norm(), 1e-6) << degrees << " deg, heading " << heading;
      }
    }
  }
}

// Oracle: Newton's law of restitution.
TEST(ArticulatedContact, BouncesByItsRestitution) {
  for (const double erp : {0.2, 0.8})
    for (const double restitution : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9}) {
      Settings how = articulated_settings(kContact);
      test::set_erp(how, erp);
      const model::Model model = test::ball_above_ground(1.02, restitution);
      const auto engine = make_engine(model, how);
      const test::Bounce found = test::bounce(*engine);
      EXPECT_NEAR(found.impact, std::sqrt(2 * kG), 0.01);
      EXPECT_NEAR(found.rebound / found.impact, restitution, 0.05) << "erp " << erp;
    }
}

// Oracle: closed forms.
TEST(ArticulatedContact, BallsRollAndSpinAsInClosedForm) {
  using test::BallMotion;
  for (const BallMotion motion : {BallMotion::sliding, BallMotion::rolling, BallMotion::spinning}) {
    const model::Model model = test::moving_ball(motion);
    const auto engine = make_engine(model, articulated_settings(kContact));
    test::expect_ball_as_in_closed_form(motion, *engine);
  }
}

// Oracle: Hooke; a block on a pad of stiffness k sinks by m g / k beyond the layer, however many points carry
// it.
TEST(ArticulatedContact, PadSinksByWeightOverStiffness) {
  model::Model model = model::make_model();
  test::add_ground(model, 0.8);
  model.materials[0].compliance = model::Compliance{4000, 40};
  add_solid(model, sized("block", ShapeKind::box, 0, 0, Vec3::Constant(0.04)), 0.5,
            {Vec3(0, 0, 0.02), Quat::Identity()});
  const auto engine = make_engine(model, articulated_settings(kContact));
  test::run(*engine, 3000);
  EXPECT_NEAR(0.02 - engine->state().bodies[1].p.z(), 1e-5 + 0.5 * kG / 2000, 1e-6);
  EXPECT_LT(engine->state().bodies[1].v.norm(), 1e-7);
}

// A light ball carries a heavy box. Oracle: the box stands where it stood, but for the surface layer and 0.2
// mm that ODE's own contacts leave at a CFM of 1e-7.
TEST(ArticulatedContact, ALightBallCarriesABoxOfTenBillionTimesItsMass) {
  for (const double mass : {1e-2, 1e-4, 1e-6}) {
    model::Model model = model::make_model();
    test::add_ground(model, 0.5);
    add_solid(model, sized("light", ShapeKind::sphere, 0.05, 0), mass, {Vec3(0, 0, 0.05), Quat::Identity()});
    add_solid(model, sized("heavy", ShapeKind::box, 0, 0, Vec3(0.1, 0.1, 0.1)), 1e4,
              {Vec3(0, 0, 0.15), Quat::Identity()});
    const auto engine = make_engine(model, articulated_settings(kContact));
    for (int i = 0; i < 1000; ++i) EXPECT_EQ(engine->step({}).lcp_failures, 0);
    EXPECT_NEAR(engine->state().bodies[2].p.z(), 0.15, 2e-4) << mass;
  }
}

// Oracle: a wall of a hundred bricks weighs what they weigh, and none is deeper in another than a hundredth
// of its edge.
TEST(ArticulatedContact, AWallOfBricksRestsOnItsWeight) {
  model::Model model = model::make_model();
  test::add_ground(model, 0.5);
  for (int i = 0; i < 100; ++i) {
    const int k = i / 25, x = i % 5, y = i / 5 % 5;
    add_solid(model, sized("brick", ShapeKind::box, 0, 0, Vec3(0.04, 0.04, 0.04)), 0.1,
              {Vec3(0.0405 * x + 0.02 * (k % 2), 0.0405 * y, 0.02 + 0.0401 * k), Quat::Identity()});
    model.bodies.back().name = "brick" + std::to_string(i);
    model.shapes.back().name = model.bodies.back().name;
  }
  Settings how = articulated_settings(kContact);
  how.contact_forces = true;
  const auto engine = make_engine(model, how);
  bool iterative = false;
  double weight = 0;
  for (int i = 0; i < 400; ++i) {
    const StepReport report = engine->step({});
    iterative = iterative || report.iterative;
    EXPECT_EQ(report.lcp_failures, 0);
    if (i < 300) continue;
    for (const Contact& contact : engine->contacts()) {
      EXPECT_LT(contact.depth, 4e-4);
      if (contact.shape_a == 0) weight -= contact.force.z() / 100;
    }
  }
  EXPECT_TRUE(iterative);
  EXPECT_NEAR(weight, 100 * 0.1 * kG, 0.02 * 100 * 0.1 * kG);
}

}  // namespace
}  // namespace handsim::engine
