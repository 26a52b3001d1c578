// Contact: built only when asked for, rest, friction, restitution; and overlaps at the start.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/contact_scenes.h"
#include "handsim/engine/collision/overlap.h"

namespace handsim::engine {
namespace {

using model::Effect;
using test::ball_above_ground;
using test::kG;
using test::settings;
using test::tilted;

// Oracle: the effects' definition.
TEST(ContactSpace, ExistsOnlyForAContactEffectWithARule) {
  model::Model model = ball_above_ground(0.01, 0);
  const auto without = make_engine(model, settings({Effect::gravity, Effect::friction}));
  EXPECT_FALSE(without->tests_contacts());
  const StepReport report = without->step({});
  EXPECT_EQ(report.collide_calls, 0);
  EXPECT_EQ(report.contacts, 0);
  EXPECT_EQ(report.collide_ns, 0);
  const auto with = make_engine(model, settings({Effect::gravity, Effect::ground_contact}));
  EXPECT_TRUE(with->tests_contacts());
  EXPECT_EQ(with->step({}).collide_calls, 1);
  model.contact_rules.clear();
  EXPECT_FALSE(make_engine(model, settings({Effect::ground_contact}))->tests_contacts());
}

// Oracle: the rules' definition; groups that no rule joins, jointed bodies and still bodies are not tested.
TEST(ContactSpace, TestsOnlyThePairsThatRulesName) {
  model::Model model = ball_above_ground(0.01, 0);
  model.groups.push_back({"other"});
  model.shapes[1].group = 1;
  EXPECT_EQ(make_engine(model, settings({Effect::ground_contact}))->step({}).collide_calls, 0);
  model.contact_rules.push_back({1, 0});
  EXPECT_EQ(make_engine(model, settings({Effect::ground_contact}))->step({}).collide_calls, 1);
  model.bodies[1].kinematic = true;
  EXPECT_EQ(make_engine(model, settings({Effect::ground_contact}))->step({}).collide_calls, 0);
  model.bodies[1].kinematic = false;
  test::add_joint(model, "pin", model::JointKind::hinge, 0, 1, {}, {}, {Vec3::UnitX()});
  EXPECT_EQ(make_engine(model, settings({Effect::ground_contact}))->step({}).collide_calls, 0);
}

// Oracle: statics; the ball rests in the ground by the surface layer and the compliance cfm m g / h, < 20 um.
TEST(Ball, RestsOnTheGroundWithSmallDepth) {
  const model::Model model = ball_above_ground(0.021, 0);
  const auto engine = make_engine(model, settings({Effect::gravity, Effect::ground_contact}));
  test::run(*engine, 2000);
  EXPECT_NEAR(engine->state().bodies[1].p.z(), 0.02, 2e-5);
  EXPECT_LT(engine->state().bodies[1].v.norm(), 1e-6);
  ASSERT_EQ(engine->contacts().size(), 1U);
  // The ground is shape 0, so the normal points into the ground.
  EXPECT_EQ(engine->contacts()[0].shape_a, 0);
  EXPECT_LT((engine->contacts()[0].normal + Vec3::UnitZ()).norm(), 1e-12);
  EXPECT_GT(engine->contacts()[0].depth, 0);
}

// Oracle: Newton's law of restitution, v' = e v, from a fall of 0.1 m.
TEST(Ball, BouncesByItsRestitutionAndNotBelowTheThresholdSpeed) {
  const model::Model model = ball_above_ground(0.12, 0.6);
  const auto engine = make_engine(model, settings({Effect::gravity, Effect::ground_contact}, 1e-4));
  double impact = 0;
  while (engine->state().bodies[1].v.z() <= 0 && engine->state().time < 1) {
    impact = -engine->state().bodies[1].v.z();
    engine->step({});
  }
  EXPECT_NEAR(impact, std::sqrt(2 * kG * 0.1), 5e-3);
  EXPECT_NEAR(engine->state().bodies[1].v.z(), 0.6 * impact, 5e-3);
  model::Model slow = model;
  slow.materials[0].restitution_speed = 2;
  const auto dull = make_engine(slow, settings({Effect::gravity, Effect::ground_contact}, 1e-4));
  test::run(*dull, 2500);
  EXPECT_LT(dull->state().bodies[1].p.z(), 0.0201);
}

// Oracle: Coulomb; below atan(mu) the box stays, above it gains g (sin a - mu cos a) t, in any direction;
// within 0.1 %.
TEST(Box, SticksBelowTheFrictionAngleAndSlidesAboveIt) {
  for (const double heading : {0.0, M_PI / 4, 1.0})
    for (const double degrees : {20.0, 26.0, 27.0, 35.0}) {
      const double angle = degrees * M_PI / 180;
      const model::Model model = test::box_on_incline(tilted(angle, heading));
      const auto engine =
          make_engine(model, settings({Effect::gravity, Effect::ground_contact, Effect::friction}));
      // The first steps settle into the ground.
      test::run(*engine, 500);
      const double start = engine->state().bodies[1].v.norm();
      test::run(*engine, 1000);
      const double gain = engine->state().bodies[1].v.norm() - start;
      const double want = test::gain_on_incline(angle);
      EXPECT_NEAR(gain, want, 1e-3 * want + 1e-5) << degrees << " deg, heading " << heading;
    }
}

// Oracle: closed form without friction, v = g sin(a) t.
TEST(Box, SlidesFreelyWithoutTheFrictionEffect) {
  const model::Model model = test::box_on_incline(tilted(0.2, 0.7));
  const auto engine = make_engine(model, settings({Effect::gravity, Effect::ground_contact}));
  test::run(*engine, 1000);
  EXPECT_NEAR(engine->state().bodies[1].v.norm(), kG * std::sin(0.2), 1e-3);
}

// Oracle: geometry; spheres of 20 mm whose centres are 30 mm apart overlap by 10 mm, a plane by 5 mm.
TEST(Overlaps, AreReportedWithTheirDepthWhateverTheRules) {
  model::Model model = ball_above_ground(0.015, 0);
  test::add_body(model,
                 test::body("second", 0.1, {1e-5, 1e-5, 1e-5}, {Vec3(0.03, 0, 0.5), Quat::Identity()}));
  test::add_body(model, test::body("third", 0.1, {1e-5, 1e-5, 1e-5}, {Vec3(0, 0, 0.5), Quat::Identity()}));
  for (int i = 2; i <= 3; ++i) {
    model::Shape round = model.shapes[1];
    round.name = "round" + std::to_string(i);
    round.body = i;
    model.shapes.push_back(round);
  }
  model.contact_rules.clear();
  const model::State start = model::initial_state(model);
  const std::vector<Overlap> found = initial_overlaps(model, start);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].shape_a, 0);
  EXPECT_EQ(found[0].shape_b, 1);
  EXPECT_NEAR(found[0].depth, 0.005, 1e-12);
  EXPECT_EQ(found[1].shape_a, 2);
  EXPECT_EQ(found[1].shape_b, 3);
  EXPECT_NEAR(found[1].depth, 0.01, 1e-12);
  // A joint between the two, or both immovable, and the pair no longer counts.
  model::Model jointed = model;
  test::add_joint(jointed, "pin", model::JointKind::ball, 2, 3, {}, {}, {});
  EXPECT_EQ(initial_overlaps(jointed, start).size(), 1U);
  model.bodies[1].kinematic = true;
  EXPECT_EQ(initial_overlaps(model, start).size(), 1U);
}

}  // namespace
}  // namespace handsim::engine
