#include "handsim/output/render/renderer.h"

#include <gtest/gtest.h>

#include <set>

#include "handsim/core/error.h"
#include "scenes.h"

namespace handsim::output {
namespace {

using model::Side;

constexpr std::array<View, 4> kDrawnViews = {View::dorsal, View::palmar, View::radial, View::three_quarter};

DrawList hand_list(Side side) {
  const model::Model model = hand_model(side, {});
  return draw_list(model, at_zero(model), {});
}

/// Removes everything but the ground from a list.
DrawList without_shapes(const DrawList& list) {
  DrawList empty;
  empty.ground_height = list.ground_height;
  return empty;
}

// Oracle: light changes brightness more than hue, so the components of the painted colour keep their order.
TEST(Renderer, FingersShowTheirColourWhereTheirCentresProject) {
  Renderer renderer(640, 480);
  for (const Side side : {Side::right, Side::left}) {
    const DrawList list = hand_list(side);
    for (const View view : {View::dorsal, View::palmar}) {
      const Camera camera = framed_camera(view, {}, side, list, 640.0 / 480);
      const Image image = renderer.draw(list, camera);
      for (const DrawShape& shape : list.shapes) {
        const Eigen::Vector2d at = Projection(camera, 640, 480)(shape.solid.pose.p);
        const std::uint8_t* pixel = image.pixel(static_cast<int>(at.x()), static_cast<int>(at.y()));
        const std::array<float, 3> paint = {shape.colour.r, shape.colour.g, shape.colour.b};
        const std::size_t strongest =
            static_cast<std::size_t>(std::max_element(paint.begin(), paint.end()) - paint.begin());
        const std::size_t weakest =
            static_cast<std::size_t>(std::min_element(paint.begin(), paint.end()) - paint.begin());
        EXPECT_GT(pixel[strongest], pixel[weakest] + 20);
        EXPECT_EQ(*std::max_element(pixel, pixel + 3), pixel[strongest]);
        EXPECT_EQ(*std::min_element(pixel, pixel + 3), pixel[weakest]);
      }
    }
  }
}

TEST(Renderer, ViewsDiffer) {
  Renderer renderer(320, 240);
  const DrawList list = hand_list(Side::right);
  std::vector<Image> images;
  for (const View view : kDrawnViews)
    images.push_back(renderer.draw(list, framed_camera(view, {}, Side::right, list, 320.0 / 240)));
  for (std::size_t i = 0; i < images.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) EXPECT_GT(share_differing(images[i], images[j], 20), 0.02);
}

// Oracle: the same picture without the hand; without a ground nothing but the hand can differ.
TEST(Renderer, NothingIsClippedAtTheBorder) {
  for (const auto& [width, height] : {std::pair{320, 240}, {200, 400}, {480, 160}}) {
    Renderer renderer(width, height);
    for (const Side side : {Side::right, Side::left})
      for (const View view : kDrawnViews) {
        const DrawList list = hand_list(side);
        const Camera camera = framed_camera(view, {}, side, list, static_cast<double>(width) / height);
        const Image with = renderer.draw(list, camera);
        const Image without = renderer.draw(without_shapes(list), camera);
        int at_border = 0;
        int inside = 0;
        for (int y = 0; y < height; ++y)
          for (int x = 0; x < width; ++x) {
            const bool border = x < 2 || y < 2 || x >= width - 2 || y >= height - 2;
            (border ? at_border : inside) += difference(with, without, x, y) > 0;
          }
        EXPECT_EQ(at_border, 0);
        EXPECT_GT(inside, width * height / 40);
      }
  }
}

DrawList ball_over_ground() {
  DrawList list;
  list.ground_height = 0;
  list.shapes.push_back(ball({0, 0, 0.032}, 0.03, {}));
  return list;
}

/// Brightest pixel within two of the point's: steps over the lines of the grid.
int brightest_about(const Image& image, const Camera& camera, const Vec3& at) {
  const Eigen::Vector2d p = Projection(camera, image.width, image.height)(at);
  int most = 0;
  for (int dy = -2; dy <= 2; ++dy)
    for (int dx = -2; dx <= 2; ++dx)
      most = std::max(most, brightness(image, static_cast<int>(p.x()) + dx, static_cast<int>(p.y()) + dy));
  return most;
}

// Directly below a ball that nearly touches the ground, neither key light nor sky is visible.
TEST(Renderer, GroundIsDarkerBelowAShapeThanFarOff) {
  Renderer renderer(480, 360);
  Camera camera;
  camera.position = {0, -0.6, 0.25};
  camera.target = {0, 0, 0};
  const Image image = renderer.draw(ball_over_ground(), camera);
  const int below = brightest_about(image, camera, {0.02, 0.005, 0});
  const int far_off = brightest_about(image, camera, {-0.2, -0.1, 0});
  EXPECT_LT(below, far_off - 100);
}

// The key light comes from the left of the camera, so the shadow is on the right of the shape.
TEST(Renderer, ShadowFallsAwayFromTheLamp) {
  Renderer renderer(480, 360);
  DrawList list = ball_over_ground();
  list.shapes[0].solid.pose.p.z() = 0.1;
  Camera camera;
  camera.position = {0, -0.05, 0.8};
  camera.target = {0, 0, 0};
  const Image image = renderer.draw(list, camera);
  int right = 1000;
  int left = 1000;
  for (double x = 0.04; x < 0.12; x += 0.005) {
    right = std::min(right, brightest_about(image, camera, {x, -0.08, 0}));
    left = std::min(left, brightest_about(image, camera, {-x, 0.08, 0}));
  }
  EXPECT_LT(right, left - 60);
}

// A plate between the key light and a ball shades the ball.
TEST(Renderer, ShapesShadeEachOther) {
  Renderer renderer(320, 240);
  DrawList list;
  list.shapes.push_back(ball(Vec3::Zero(), 0.03, {0.5F, 0.5F, 0.5F}));
  Camera camera;
  camera.position = {0, -0.5, 0};
  camera.target = Vec3::Zero();
  const Image lit = renderer.draw(list, camera);
  list.shapes.push_back({{Core::box, {0.04, 0.04, 0.002}, 0, {{-0.07, -0.1, 0.081}, Quat::Identity()}}, {}});
  const Image shaded = renderer.draw(list, camera);
  EXPECT_GT(brightness(lit, 155, 115), brightness(shaded, 155, 115) + 60);
}

/// A dark capsule on the light background, oblique so that no edge is parallel to the pixel rows.
DrawList slanted_capsule() {
  DrawList list;
  list.shapes.push_back(capsule({-0.05, 0, -0.02}, {0.06, 0.01, 0.03}, 0.02, {0, 0, 0}));
  return list;
}

Camera straight_camera() {
  Camera camera;
  camera.position = {0, -0.5, 0};
  camera.target = Vec3::Zero();
  return camera;
}

// Oracle: an anti-aliased edge has intermediate levels; without anti-aliasing it has two.
TEST(Renderer, EdgesAreAntiAliased) {
  Renderer renderer(320, 240);
  const Image with = renderer.draw(slanted_capsule(), straight_camera());
  const Image without = renderer.draw({}, straight_camera());
  int between = 0;
  for (int y = 0; y < 240; ++y)
    for (int x = 1; x < 319; ++x) {
      const int background = brightness(without, x, y);
      const int left = brightness(with, x - 1, y);
      const int here = brightness(with, x, y);
      const int right = brightness(with, x + 1, y);
      const bool edge = std::abs(left - right) > background / 2;
      between += edge && here > std::min(left, right) + 60 && here < std::max(left, right) - 60;
    }
  EXPECT_GT(between, 60);
}

// Oracle: a line of 0.4 pixels between two columns covers a sample in each row, and no centre of a pixel.
TEST(Renderer, LineThinnerThanAPixelHasNoGaps) {
  Renderer renderer(320, 240);
  DrawList line;
  line.arrows.push_back({{0, 0, -0.1}, {0, 0, 0.1}, 0.00026, {0, 0, 0}, false});
  const Image with = renderer.draw(line, straight_camera());
  const Image without = renderer.draw({}, straight_camera());
  const Projection project(straight_camera(), 320, 240);
  const int top = static_cast<int>(project(Vec3(0, 0, 0.09)).y());
  const int bottom = static_cast<int>(project(Vec3(0, 0, -0.09)).y());
  ASSERT_GT(bottom, top + 100);
  for (int y = top; y <= bottom; ++y) {
    int most = 0;
    for (int x = 0; x < 320; ++x) most = std::max(most, difference(with, without, x, y));
    EXPECT_GT(most, 30) << "row " << y;
  }
}

// Oracle: the signs of drawings of vectors. Towards the reader a ring with a dot, away from him one with a
// cross; what is behind shows between them.
TEST(Renderer, ArrowAlongTheSightIsARingWithADotOrACross) {
  Renderer renderer(320, 240);
  const Camera camera = straight_camera();
  const Image without = renderer.draw({}, camera);
  const Vec3 sight = (camera.position - camera.target).normalized();
  constexpr double kRadius = 0.006, kRing = kHeadWidth * kRadius;
  const auto check = [&](bool towards, double tilt) {
    DrawList list;
    const Vec3 along = std::cos(tilt) * sight + std::sin(tilt) * sight.cross(Vec3::UnitZ());
    const Vec3 end = (towards ? 1 : -1) * 0.05 * along;
    list.arrows.push_back({-end, end, kRadius, {0, 0, 0}, true});
    const Image with = renderer.draw(list, camera);
    const auto drawn = [&](double radius, double degrees) {
      const double angle = degrees * M_PI / 180;
      const Eigen::Vector2d at = Projection(camera, 320, 240)(
          end +
          radius * kRing * (std::cos(angle) * sight.cross(Vec3::UnitZ()) + std::sin(angle) * Vec3::UnitZ()));
      return difference(with, without, static_cast<int>(at.x()), static_cast<int>(at.y())) > 40;
    };
    EXPECT_TRUE(drawn(0, 0)) << towards;
    int crossed = 0;
    for (int degrees = 0; degrees < 360; degrees += 5) {
      EXPECT_TRUE(drawn(0.88, degrees)) << towards << degrees;
      EXPECT_FALSE(drawn(1.15, degrees)) << towards << degrees;
      crossed += drawn(0.55, degrees) ? 1 : 0;
    }
    // Each of four arms takes about 4 of 72 directions at this radius, a blot all.
    EXPECT_GE(crossed, towards ? 0 : 4);
    EXPECT_LE(crossed, towards ? 0 : 24);
  };
  check(false, 0);
  // The disc of a head hides its tip and its shaft up to 24 degrees.
  for (const double degrees : {0, 10, 20}) check(true, degrees * M_PI / 180);
}

// The renderer numbers shapes up to 255: of two with the same number each has its own colour. The camera is
// far, so that places in the picture do not depend on the distance.
TEST(Renderer, ShapesBeyondItsNumbersHaveTheirColours) {
  Camera camera;
  camera.position = {0, -20, 0};
  camera.field_of_view = 0.03;
  DrawList list;
  const auto place = [](int i) { return Vec3((i % 17 - 8) * 0.03, 0, (i / 17 - 7) * 0.03); };
  for (int i = 0; i < 255; ++i)
    list.shapes.push_back(capsule(place(i), place(i) + Vec3(0, 0, 1e-4), 0.01, {0.8F, 0.05F, 0.05F}));
  // Behind and between them a chain of balls that overlap.
  const Vec3 behind(0.012, 0.05, 0.015);
  for (int i = 0; i < 45; ++i) {
    const Vec3 p = place(i) + behind;
    const bool green = i % 2 == 0;
    list.shapes.push_back(
        capsule(p, p + Vec3(0, 0, 1e-4), 0.018, {0.05F, green ? 0.8F : 0.05F, green ? 0.05F : 0.8F}));
  }
  Renderer renderer(640, 480);
  const Image image = renderer.draw(list, camera);
  const Projection project(camera, 640, 480);
  const auto pixel = [&](const Vec3& point) {
    const Eigen::Vector2d at = project(point);
    return image.pixel(static_cast<int>(at.x()), static_cast<int>(at.y()));
  };
  for (int i = 0; i < 255; ++i)
    for (const double x : {0.0, 0.006}) {
      const std::uint8_t* front = pixel(place(i) + Vec3(x, 0, 0));
      EXPECT_GT(front[0], front[1] + 20) << "ball " << i;
    }
  for (int i = 0; i < 45; ++i) {
    const std::uint8_t* back = pixel(place(i) + behind + Vec3(0.0125, 0, 0));
    const int strong = i % 2 == 0 ? 1 : 2;
    EXPECT_GT(back[strong], back[3 - strong] + 20) << "ball " << 255 + i;
  }
}

/// True if the ray through a point of the picture passes the capsule's axis within its radius.
bool hits(const Solid& shape, const Projection& project, double px, double py, double grown) {
  const Vec3 d = ((px - project.width / 2) * project.x - (py - project.height / 2) * project.y -
                  project.focus * project.z)
                     .normalized();
  const Vec3 axis = shape.pose.q * Vec3::UnitZ();
  const auto beyond = [&](double along) {
    const Vec3 w = shape.pose.p + axis * along - project.eye;
    return (w - w.dot(d) * d).norm() - grown / project.focus * w.dot(d);
  };
  // The distance is convex along the axis.
  double low = -shape.half.z(), high = shape.half.z();
  for (int i = 0; i < 40; ++i) {
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    const bool left = beyond(a) < beyond(b);
    (left ? high : low) = left ? b : a;
  }
  return beyond(0.5 * (low + high)) <= shape.round;
}

// Oracle: distance of each pixel's ray from the capsule's axis. Pixels that lie more than 1.5 pixels inside
// or outside the exact outline must be painted, or not, accordingly.
TEST(Renderer, CapsuleOutlineMatchesItsProjectionWithinOneAndAHalfPixels) {
  Renderer renderer(320, 240);
  const DrawList list = slanted_capsule();
  const Camera camera = straight_camera();
  const Image with = renderer.draw(list, camera);
  const Image without = renderer.draw({}, camera);
  const Projection project(camera, 320, 240);
  int wrong = 0;
  int painted = 0;
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x) {
      const bool drawn = brightness(with, x, y) < brightness(without, x, y) / 2;
      painted += drawn;
      if (drawn && !hits(list.shapes[0].solid, project, x + 0.5, y + 0.5, 1.5)) ++wrong;
      if (!drawn && hits(list.shapes[0].solid, project, x + 0.5, y + 0.5, -1.5)) ++wrong;
    }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(painted, 2000);
}

// Oracle: bit equality, also across Renderers.
TEST(Renderer, SameListGivesTheSameBytes) {
  Renderer renderer(320, 240);
  DrawList list = hand_list(Side::left);
  list.ground_height = -0.1;
  const Camera camera = framed_camera(View::three_quarter, {}, Side::left, list, 320.0 / 240);
  const Image first = renderer.draw(list, camera);
  renderer.draw(slanted_capsule(), straight_camera());
  EXPECT_EQ(renderer.draw(list, camera).rgb, first.rgb);
  Renderer other(320, 240);
  EXPECT_EQ(other.draw(list, camera).rgb, first.rgb);
}

TEST(Renderer, TwoCanDrawAlternately) {
  Renderer a(64, 48), b(48, 64);
  EXPECT_EQ(a.draw({}, {}).width, 64);
  EXPECT_EQ(b.draw({}, {}).width, 48);
  EXPECT_EQ(a.draw({}, {}).width, 64);
}

TEST(Renderer, SizesOutOfRangeAreErrors) {
  EXPECT_THROW(Renderer(15, 100), Error);
  EXPECT_THROW(Renderer(100, 8193), Error);
}

TEST(Renderer, EmptyListShowsTheBackgroundOnly) {
  Renderer renderer(64, 48);
  const Image image = renderer.draw({}, {});
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) EXPECT_GT(brightness(image, x, y), 3 * 190);
}

TEST(Renderer, EmptyGroundHasAGrid) {
  Renderer renderer(320, 240);
  DrawList list;
  list.ground_height = 0;
  EXPECT_GT(share_differing(renderer.draw(list, {}), renderer.draw({}, {}), 8), 0.01);
}

TEST(Renderer, CameraWithoutADirectionIsAnError) {
  Renderer renderer(64, 48);
  Camera camera;
  camera.target = camera.position;
  EXPECT_THROW(renderer.draw({}, camera), Error);
}

// Pictures above 2048 pixels are drawn in tiles. Oracle: reduced by averaging, they equal the small picture
// except at edges.
TEST(Renderer, TiledPictureShowsWhatASmallOneShows) {
  DrawList list = hand_list(Side::right);
  list.ground_height = -0.05;
  const Camera camera = framed_camera(View::three_quarter, {}, Side::right, list, 2);
  const Image large = Renderer(2304, 1152).draw(list, camera);
  const Image small = Renderer(576, 288).draw(list, camera);
  Image shrunk{576, 288, {}};
  for (int y = 0; y < 288; ++y)
    for (int x = 0; x < 576; ++x)
      for (int c = 0; c < 3; ++c) {
        int sum = 0;
        for (int i = 0; i < 16; ++i) sum += large.pixel(4 * x + i % 4, 4 * y + i / 4)[c];
        shrunk.rgb.push_back(static_cast<std::uint8_t>(sum / 16));
      }
  EXPECT_LT(share_differing(shrunk, small, 24), 0.01);
}

}  // namespace
}  // namespace handsim::output
