#include "handsim/output/render/draw_list.h"

#include <gtest/gtest.h>

#include "handsim/core/error.h"
#include "scenes.h"

namespace handsim::output {
namespace {

using model::Side;

constexpr std::array<View, 4> kViews = {View::dorsal, View::palmar, View::radial, View::three_quarter};
const Pose kTilted = {{0.3, -0.2, 0.4}, Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()))};

TEST(DrawList, FingersHaveColoursThatDifferClearly) {
  const model::Model model = hand_model(Side::right, {});
  const DrawList list = draw_list(model, at_zero(model), {});
  ASSERT_EQ(list.shapes.size(), 6U);
  for (const DrawShape& a : list.shapes)
    for (const DrawShape& b : list.shapes)
      if (&a != &b) {
        EXPECT_GT(std::abs(a.colour.r - b.colour.r) + std::abs(a.colour.g - b.colour.g) +
                      std::abs(a.colour.b - b.colour.b),
                  0.3F);
      }
}

TEST(DrawList, PlaneBecomesTheGround) {
  model::Model model = model::make_model();
  model::Shape plane;
  plane.kind = model::ShapeKind::plane;
  plane.pose.p = {0, 0, -0.25};
  model.shapes.push_back(plane);
  const DrawList list = draw_list(model, at_zero(model), {});
  EXPECT_TRUE(list.shapes.empty());
  ASSERT_TRUE(list.ground_height.has_value());
  EXPECT_DOUBLE_EQ(*list.ground_height, -0.25);
}

// Oracle: the capsule's caps are spheres, so its box is that of the two spheres.
TEST(DrawList, BoundsOfASlantedCapsuleAreExact) {
  DrawList list;
  list.shapes.push_back(capsule({0.1, 0.2, 0.3}, {-0.2, 0.5, 0.35}, 0.02, {}));
  const Bounds box = bounds(list);
  EXPECT_TRUE(box.low.isApprox(Vec3(-0.22, 0.18, 0.28), 1e-12));
  EXPECT_TRUE(box.high.isApprox(Vec3(0.12, 0.52, 0.37), 1e-12));
}

// Oracle: the second axis of a universal joint rotates with the first coordinate, here by 90 degrees.
TEST(DrawList, JointAxesMoveWithTheBodies) {
  model::Model model = hand_model(Side::right, {});
  model::Joint joint;
  joint.kind = model::JointKind::universal;
  joint.parent = 1;
  joint.child = 2;
  joint.axes = {{"flexion", Vec3::UnitX(), {}, {}, 0}, {"abduction", Vec3::UnitZ(), {}, {}, 0}};
  model.joints.push_back(joint);
  model::State state = at_zero(model);
  state.bodies[2].q = Quat(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitX()));
  const DrawList list = draw_list(model, state, {.joint_axes = true});
  ASSERT_EQ(list.arrows.size(), 2U);
  const auto towards = [](const DrawArrow& arrow) { return Vec3((arrow.to - arrow.from).normalized()); };
  EXPECT_TRUE(towards(list.arrows[0]).isApprox(Vec3::UnitX(), 1e-12));
  EXPECT_TRUE(towards(list.arrows[1]).isApprox(-Vec3::UnitY(), 1e-12));
}

/// Points that enclose the surface of a shape of the test hand closely enough: spheres' six extremes
/// along picture axes at both cap centres, or corners.
std::vector<Vec3> extremes(const Solid& shape, const Projection& project) {
  std::vector<Vec3> points;
  for (int i = 0; i < 8; ++i) {
    const Vec3 sign((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1);
    if (!is_capsule(shape)) {
      points.push_back(shape.pose * Vec3(sign.cwiseProduct(shape.half)));
    } else {
      const Vec3 centre = shape.pose * Vec3(0, 0, sign.x() * shape.half.z());
      points.push_back(centre + shape.round * sign.y() * (sign.z() > 0 ? project.x : project.y));
    }
  }
  return points;
}

// Oracle: projection of extreme points. All are inside; and the frame is tight: on at least one axis, the
// outermost point is within 15% of the half picture from the border (7% is the margin).
// Oracle: the moment of a pull towards the palm, along the path, about the joint's axis has the sign of the
// arm.
TEST(DrawList, TendonsRunOnTheSideOfTheirMomentArms) {
  model::Model model = hand_model(Side::right, {});
  model::Joint& joint = model.joints.emplace_back();
  joint.parent = 1;
  joint.child = 3;
  joint.parent_frame.p = {-0.031, 0.053, 0};
  joint.axes.resize(1);
  joint.axes[0].axis = Vec3::UnitX();
  model.muscles.resize(2);
  for (std::size_t m = 0; m < 2; ++m) {
    model::MomentArm& arm = model.muscles[m].path.arms.emplace_back();
    arm.dof = 0;
    arm.c[0] = m == 0 ? 0.01 : -0.01;
  }
  model::State state = at_zero(model);
  state.q = {0};
  state.activation = {1, 0};
  DrawList list;
  add_tendons(model, state, list);
  ASSERT_EQ(list.shapes.size(), 2U);
  const Vec3 o = (state.bodies[1].pose() * joint.parent_frame).p;
  for (std::size_t m = 0; m < 2; ++m) {
    const Vec3 moment = (list.shapes[m].solid.pose.p - o).cross(o - state.bodies[3].p);
    EXPECT_GT((m == 0 ? 1 : -1) * moment.normalized().x(), 0.9) << m;
  }
  EXPECT_GT(list.shapes[0].solid.round, list.shapes[1].solid.round);
  EXPECT_GT(list.shapes[0].colour.r - list.shapes[0].colour.g,
            list.shapes[1].colour.r - list.shapes[1].colour.g);
}

TEST(FramedCamera, SeesAllOfTheHandsTightlyForEveryViewSideAndAspect) {
  for (const View view : kViews)
    for (const Side side : {Side::right, Side::left})
      for (const double aspect : {0.5, 1.0, 16.0 / 9.0, 3.0}) {
        const model::Model model = hand_model(side, kTilted);
        const DrawList list = draw_list(model, at_zero(model), {});
        const Camera camera = framed_camera(view, kTilted, side, list, aspect);
        const int height = 400;
        const int width = static_cast<int>(height * aspect);
        const Projection project(camera, width, height);
        double outermost = 0;
        for (const DrawShape& shape : list.shapes)
          for (const Vec3& point : extremes(shape.solid, project)) {
            const Eigen::Vector2d at = project(point);
            outermost =
                std::max({outermost, std::abs(at.x() / width * 2 - 1), std::abs(at.y() / height * 2 - 1)});
          }
        EXPECT_LT(outermost, 0.94) << static_cast<int>(view) << " " << aspect;
        EXPECT_GT(outermost, 0.85) << static_cast<int>(view) << " " << aspect;
      }
}

TEST(FramedCamera, StandsOnTheNamedSideOfTheHand) {
  for (const Side side : {Side::right, Side::left}) {
    const model::Model model = hand_model(side, kTilted);
    const DrawList list = draw_list(model, at_zero(model), {});
    const auto seen_from = [&](View view) {
      const Camera camera = framed_camera(view, kTilted, side, list, 1.5);
      return Vec3(kTilted.q.conjugate() * (camera.position - camera.target).normalized());
    };
    EXPECT_TRUE(seen_from(View::dorsal).isApprox(Vec3::UnitZ(), 1e-9));
    EXPECT_TRUE(seen_from(View::palmar).isApprox(-Vec3::UnitZ(), 1e-9));
    EXPECT_NEAR(seen_from(View::radial).x(), side == Side::right ? -1 : 1, 1e-9);
  }
}

TEST(FramedCamera, FingersPointUpInDorsalAndPalmarViews) {
  const model::Model model = hand_model(Side::right, kTilted);
  const DrawList list = draw_list(model, at_zero(model), {});
  for (const View view : {View::dorsal, View::palmar})
    EXPECT_GT(framed_camera(view, kTilted, Side::right, list, 1).up.dot(kTilted.q * Vec3::UnitY()), 0.999);
}

TEST(FramedCamera, EmptyListsStillGiveACamera) {
  const Camera camera = Framing(View::three_quarter, {}, Side::left, 1.5).camera();
  EXPECT_GT((camera.position - camera.target).norm(), 0.1);
}

TEST(FramedCamera, RefusesAnAspectOfZero) { EXPECT_THROW(Framing(View::dorsal, {}, Side::right, 0), Error); }

}  // namespace
}  // namespace handsim::output
