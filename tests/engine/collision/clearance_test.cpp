// Which pairs of shapes may touch.
#include "handsim/engine/collision/clearance.h"

#include <gtest/gtest.h>

#include "engine/models.h"
#include "handsim/engine/collision/overlap.h"

namespace handsim::engine {
namespace {

using model::ShapeKind;

/// One shape of each kind on a free body of its own, and a plane on the world.
model::Model one_of_each() {
  model::Model model = model::make_model();
  test::add_ground(model);
  for (const ShapeKind kind : {ShapeKind::box, ShapeKind::capsule, ShapeKind::cylinder, ShapeKind::sphere,
                               ShapeKind::capsule, ShapeKind::box}) {
    const std::string name = "shape" + std::to_string(model.shapes.size());
    model::Shape shape = test::shape(name, kind, 0);
    shape.edges = Vec3(0.06, 0.02, 0.1);
    shape.radius = 0.02;
    shape.length = 0.05;
    shape.body = test::add_body(model, test::body(name, 0.1, {1e-4, 1e-4, 1e-4}));
    model.shapes.push_back(shape);
  }
  return model;
}

std::vector<Pose> poses(const model::State& state) {
  std::vector<Pose> out;
  for (const model::BodyState& body : state.bodies) out.push_back(body.pose());
  return out;
}

// Oracle: another way to tell: shapes that penetrate, by the narrow phase, have no gap; and of two capsules
// or a sphere the gap is the distance itself, which a shift by more than it along the line between closes.
TEST(Clearance, NeverPartsWhatTouches) {
  const model::Model model = one_of_each();
  std::mt19937 random(5);
  int touching = 0, apart = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    model::State state = model::initial_state(model);
    for (std::size_t i = 1; i < state.bodies.size(); ++i) {
      const Pose at = test::random_pose(random, 0.1);
      state.bodies[i].p = at.p;
      state.bodies[i].q = at.q;
    }
    const std::vector<Pose> x = poses(state);
    for (const Overlap& overlap : initial_overlaps(model, state)) {
      const auto a = static_cast<std::size_t>(overlap.shape_a), b = static_cast<std::size_t>(overlap.shape_b);
      EXPECT_LE(least_gap(model.shapes[a], x[a], model.shapes[b], x[b]), 1e-12)
          << model.shapes[a].name << ' ' << model.shapes[b].name;
      ++touching;
    }
    for (std::size_t a = 0; a < x.size(); ++a)
      for (std::size_t b = a + 1; b < x.size(); ++b)
        apart += least_gap(model.shapes[a], x[a], model.shapes[b], x[b]) > 0 ? 1 : 0;
  }
  EXPECT_GT(touching, 1000);
  EXPECT_GT(apart, 1000);
}

// Oracle: looking at every pair at every state, along small and large movements, jumps and a plane that
// tilts.
TEST(Clearance, FindsThePairsThatLookingAtAllOfThemFinds) {
  model::Model model = one_of_each();
  // A body of two shapes, neither about its origin.
  model.shapes[2].pose = {Vec3(0.03, 0, 0.01), rotation_quaternion({0, 1, 0})};
  model.shapes[3].pose.p = Vec3(0, -0.02, 0.03);
  model.shapes[3].body = model.shapes[2].body;
  std::vector<Clearance::Pair> pairs;
  for (std::size_t a = 0; a < model.shapes.size(); ++a)
    for (std::size_t b = a + 1; b < model.shapes.size(); ++b) pairs.emplace_back(a, b);
  Clearance clearance(model, pairs);
  std::mt19937 random(7);
  model::State state = model::initial_state(model);
  std::vector<Pose> bodies(state.bodies.size()), x(model.shapes.size());
  int found = 0;
  for (int step = 0; step < 5000; ++step) {
    const double size = step % 500 == 0 ? 0.2 : (step % 50 == 0 ? 0.02 : 2e-4);
    for (std::size_t i = step % 700 == 0 ? 0 : 1; i < bodies.size(); ++i) {
      bodies[i].p += size * test::random_vector(random);
      bodies[i].p = bodies[i].p.cwiseMax(-0.15).cwiseMin(0.15);
      bodies[i].q = (rotation_quaternion(10 * size * test::random_vector(random)) * bodies[i].q).normalized();
      // The other quaternion of the same rotation.
      if (step % 90 == 0) bodies[i].q.coeffs() *= -1;
      state.bodies[i].p = bodies[i].p;
      state.bodies[i].q = bodies[i].q;
    }
    for (std::size_t i = 0; i < x.size(); ++i)
      x[i] = bodies[static_cast<std::size_t>(model.shapes[i].body)] * model.shapes[i].pose;
    const auto near = clearance.near(state);
    std::vector<Clearance::Pair> all;
    for (const auto& [a, b] : pairs)
      if (least_gap(model.shapes[a], x[a], model.shapes[b], x[b]) <= 0) all.emplace_back(a, b);
    ASSERT_EQ(std::vector<Clearance::Pair>(near.begin(), near.end()), all) << step;
    found += static_cast<int>(all.size());
  }
  EXPECT_GT(found, 1000);
}

// Oracle: geometry.
TEST(Clearance, KnowsTheDistanceOfCapsules) {
  model::Shape capsule = test::shape("capsule", ShapeKind::capsule, 0);
  capsule.radius = 0.01;
  capsule.length = 0.1;
  model::Shape ball = test::shape("ball", ShapeKind::sphere, 0);
  ball.radius = 0.02;
  const Pose upright;
  const Pose across{Vec3(0, 0.05, 0.03), rotation_quaternion({0, M_PI / 2, 0})};
  EXPECT_NEAR(least_gap(capsule, upright, capsule, across), 0.05 - 0.02, 1e-15);
  const Pose beyond{Vec3(0, 0.03, 0.09), Quat::Identity()};
  EXPECT_NEAR(least_gap(capsule, upright, ball, beyond), 0.05 - 0.03, 1e-15);
  EXPECT_NEAR(least_gap(ball, beyond, capsule, upright), 0.05 - 0.03, 1e-15);
  const Pose parallel{Vec3(0.04, 0, 0.02), Quat::Identity()};
  EXPECT_NEAR(least_gap(capsule, upright, capsule, parallel), 0.04 - 0.02, 1e-15);
}

}  // namespace
}  // namespace handsim::engine
