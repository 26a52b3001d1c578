#include "handsim/output/render/draw_list.h"

#include <gtest/gtest.h>

#include "scene_files.h"

namespace handsim::output {
namespace {

// Oracle: anatomy, in the frame of the hand (y distal, z dorsal). Nails of the four fingers are on the back
// of the fingertips; with straight fingers the flexed side is the palm's. The stump is behind the wrist.
TEST(HandMarks, NailsAreOnTheBackAndTheStumpIsBehindTheWrist) {
  for (const char* side : {"right", "left"}) {
    const scene::Scene scene = test::shipped_scene("grasp_power_can", {std::string("hands.0.side=") + side});
    const model::Model& model = scene.model;
    const model::HandIndex& hand = model.hands.front();
    const Pose x_HW =
        (model.bodies[static_cast<std::size_t>(hand.palm)].zero_pose * hand.wrist_frame).inverse();
    int nails = 0, stumps = 0;
    for (const HandMark& mark : hand_marks(model)) {
      const Pose x_HB = x_HW * model.bodies[static_cast<std::size_t>(mark.body)].zero_pose;
      const model::Shape& shape = model.shapes[static_cast<std::size_t>(mark.shape)];
      EXPECT_EQ(shape.body, mark.body);
      const Vec3 at = x_HB * mark.solid.pose.p, of_shape = x_HB * shape.pose.p;
      if (!mark.nail) {
        ++stumps;
        EXPECT_LT(at.y(), 0.01);
        EXPECT_LT(-support({Core::box, mark.solid.half, mark.solid.round, x_HB * mark.solid.pose, {}},
                           -Vec3::UnitY()),
                  -0.015);
        continue;
      }
      ++nails;
      if (shape.part == model::Part::thumb) continue;
      // On the back, towards the tip, and in the middle of the finger's width.
      EXPECT_GT((at - of_shape).z(), 0.1 * shape.radius) << side << " " << shape.name;
      EXPECT_GT((at - of_shape).y(), 0) << side << " " << shape.name;
      EXPECT_LT(std::abs((at - of_shape).x()), 0.3 * shape.radius) << side << " " << shape.name;
    }
    EXPECT_EQ(nails, 5) << side;
    EXPECT_EQ(stumps, 1) << side;
  }
}

// Oracle: a nail stands out of its fingertip by a tenth of the radius, and no more.
TEST(HandMarks, NailsStandOutATenth) {
  const model::Model& model = test::shipped_scene("grasp_power_can").model;
  for (const HandMark& mark : hand_marks(model)) {
    if (!mark.nail) continue;
    const model::Shape& shape = model.shapes[static_cast<std::size_t>(mark.shape)];
    const Vec3 dorsal =
        (mark.solid.pose.p - shape.pose.p) -
        shape.pose.q * Vec3(0, 0, (shape.pose.q.conjugate() * (mark.solid.pose.p - shape.pose.p)).z());
    const Vec3 n = dorsal.normalized();
    EXPECT_NEAR(support(mark.solid, n) - support(solid(shape, shape.pose), n), 0.1 * shape.radius, 1e-9);
  }
}

TEST(DrawList, AnObjectHasItsOwnColour) {
  const scene::Scene scene = test::shipped_scene("grasp_power_can");
  model::State state;
  for (const model::Body& body : scene.model.bodies)
    state.bodies.push_back({body.zero_pose.p, body.zero_pose.q, Vec3::Zero(), Vec3::Zero()});
  std::optional<Colour> can, post;
  for (const DrawShape& drawn : draw_list(scene.model, state, {}).shapes) {
    const std::string& name = scene.model.shapes[static_cast<std::size_t>(drawn.shape)].name;
    if (name == "can") can = drawn.colour;
    if (name == "can_post") post = drawn.colour;
  }
  ASSERT_TRUE(can && post);
  // The file's "#c4392f", linear by IEC 61966-2-1: 196 -> 0.5520, 57 -> 0.0409, 47 -> 0.0284.
  EXPECT_NEAR(can->r, 0.5520F, 1e-3F);
  EXPECT_NEAR(can->g, 0.0409F, 1e-3F);
  EXPECT_NEAR(can->b, 0.0284F, 1e-3F);
  EXPECT_GT(std::abs(can->g - post->g), 0.2F);
}

}  // namespace
}  // namespace handsim::output
