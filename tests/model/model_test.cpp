#include "handsim/model/model.h"

#include <gtest/gtest.h>

#include "engine/models.h"

namespace handsim::model {
namespace {

/// Surfaces that differ in all that contact takes of them.
Material surface_of(double friction, double restitution, double speed, double rolling, double spinning) {
  Material out;
  out.friction = friction;
  out.restitution = restitution;
  out.restitution_speed = speed;
  out.rolling_friction = rolling;
  out.spinning_friction = spinning;
  return out;
}

// Oracle: definition: the geometric mean, and the greater of two, in both orders.
TEST(Combined, SurfacesHaveTheMeanFrictionAndTheGreaterOfTheRest) {
  const Material a = surface_of(0.2, 0.1, 0.3, 1e-3, 5e-4), b = surface_of(0.8, 0.6, 0.05, 2e-4, 3e-3);
  for (const Material& both : {combined(a, b), combined(b, a)}) {
    EXPECT_NEAR(both.friction, 0.4, 1e-16);
    EXPECT_EQ(both.restitution, 0.6);
    EXPECT_EQ(both.restitution_speed, 0.3);
    EXPECT_EQ(both.rolling_friction, 1e-3);
    EXPECT_EQ(both.spinning_friction, 3e-3);
    EXPECT_FALSE(both.compliance);
  }
}

// Oracle: springs in series carry one force, and their depths add up: 1 / k = 1 / k1 + 1 / k2; a rigid
// surface has no depth, and an undamped one leaves the other's damper alone.
TEST(Combined, SpringsAndDampersActInSeries) {
  Material a, b, rigid;
  a.compliance = Compliance{2000, 30};
  b.compliance = Compliance{6000, 10};
  const Material both = combined(a, b);
  ASSERT_TRUE(both.compliance);
  const double force = 3;
  EXPECT_NEAR(force / both.compliance->stiffness, force / 2000 + force / 6000, 1e-18);
  EXPECT_NEAR(force / both.compliance->damping, force / 30 + force / 10, 1e-15);
  b.compliance->damping = 0;
  EXPECT_EQ(combined(a, b).compliance->damping, 30);
  for (const Material& one : {combined(a, rigid), combined(rigid, a)}) {
    ASSERT_TRUE(one.compliance);
    EXPECT_EQ(one.compliance->stiffness, 2000);
    EXPECT_EQ(one.compliance->damping, 30);
  }
}

// Oracle: freedoms of a mechanism counted by hand, and shapes of two objects beside one of none.
TEST(Model, CountsCoordinatesAndFindsTheObjectsOfShapes) {
  Model model = make_model();
  EXPECT_EQ(model.dof_count(), 0);
  ASSERT_EQ(model.bodies.size(), 1U);
  EXPECT_TRUE(model.bodies[0].kinematic);
  int expected = 0;
  const std::pair<JointKind, int> kinds[] = {
      {JointKind::ball, 3}, {JointKind::hinge, 1}, {JointKind::universal, 2}, {JointKind::slider, 1}};
  for (const auto& [kind, freedoms] : kinds) {
    const int body = engine::test::add_body(model, engine::test::body("b", 1, {1, 1, 1}));
    const Joint& joint = engine::test::add_joint(model, "j", kind, 0, body, {}, {}, {});
    EXPECT_EQ(joint.first_dof, expected);
    expected += freedoms;
    EXPECT_EQ(model.dof_count(), expected);
  }
  model.shapes.resize(4);
  model.objects = {{"a", {}, {3}}, {"b", {}, {0, 2}}};
  const std::vector<std::optional<std::size_t>> want = {1, std::nullopt, 1, 0};
  EXPECT_EQ(model.objects_of_shapes(), want);
  EXPECT_EQ(model.add_group("first"), 0);
  EXPECT_EQ(model.add_group("second"), 1);
  EXPECT_EQ(model.groups[1].name, "second");
}

}  // namespace
}  // namespace handsim::model
