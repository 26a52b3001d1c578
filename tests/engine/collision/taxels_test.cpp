// Points of touch on finger pads.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <numeric>

#include "engine/models.h"
#include "handsim/engine/collision/taxels.h"

namespace handsim::engine {
namespace {

constexpr double kRadius = 8e-3, kLength = 0.016;

/// A palm with four fingertips of one capsule each, along y, palmar side down.
model::Model fingertips() {
  model::Model model = model::make_model();
  model.groups = {{"all"}};
  model.contact_rules = {{0, 0}};
  model.materials = {test::material("skin", 0.8)};
  model.materials[0].compliance = model::Compliance{3000, 0};
  model::HandIndex hand;
  hand.palm = test::add_body(model, test::body("palm", 0.3, {3e-4, 3e-4, 5e-4}));
  for (int i = 0; i < 4; ++i) {
    const Pose at{Vec3(0.02 * i, 0.1, 0), rotation_quaternion({-M_PI / 2, 0, 0})};
    const int body =
        test::add_body(model, test::body("tip" + std::to_string(i), 0.01, Vec3::Constant(1e-6), at));
    model::Shape capsule = test::shape("tip" + std::to_string(i), model::ShapeKind::capsule, body);
    capsule.radius = kRadius;
    capsule.length = kLength;
    capsule.part = model::Part::index;
    model.shapes.push_back(capsule);
    hand.fingertips.push_back({capsule.name, model::Part::index, body, Vec3(0, 0, 0.5 * kLength + kRadius)});
  }
  model::Shape object = test::shape("object", model::ShapeKind::sphere, 0);
  object.radius = 0.1;
  model.shapes.push_back(object);
  model.hands.push_back(hand);
  return model;
}

/// A contact on the palmar side of tip `i`: `along` it, at an angle about it.
Contact touch(const model::State& state, int i, double along, double angle, double depth, double force) {
  const model::BodyState& tip = state.bodies[as_index(2 + i)];
  // z of the body leads to the tip; palmar is the world's -z.
  const Vec3 out(std::sin(angle), 0, -std::cos(angle));
  Contact contact;
  contact.shape_a = 4;
  contact.shape_b = i;
  contact.normal = out;
  contact.depth = depth;
  contact.position = tip.p + Vec3(0, along, 0) + (kRadius - 0.5 * depth) * out;
  contact.force = force * out + 0.3 * force * Vec3::UnitY();
  // The normal leads from b to a: the force on a is along it.
  return contact;
}

// Oracle: the contacts themselves: forces add up to the normal force, and their centre in the tangent plane
// is the contact's place.
TEST(Taxels, AddUpToTheForceAtThePlaceOfTheContact) {
  const model::Model model = fingertips();
  const model::State state = model::initial_state(model);
  Taxels taxels(model, 1e-3);
  ASSERT_EQ(taxels.pads().size(), 4u);
  for (const double along : {-0.004, 0.0013, 0.004})
    for (const double angle : {-0.5, 0.0, 0.77})
      for (const double depth : {0.3e-3, 2e-3}) {
        const Contact contact = touch(state, 1, along, angle, depth, 3.7);
        const auto forces = taxels.read(std::span(&contact, 1), state);
        EXPECT_NEAR(std::accumulate(forces.begin(), forces.end(), 0.0), 3.7, 1e-12);
        const Taxels::Pad& pad = taxels.pads()[1];
        Vec3 centre = Vec3::Zero();
        int loaded = 0;
        for (std::size_t k = 0; k < forces.size(); ++k) {
          EXPECT_GE(forces[k], 0);
          if (forces[k] == 0) continue;
          EXPECT_TRUE(k >= pad.first && k < pad.first + pad.count);
          ++loaded;
          centre += forces[k] / 3.7 * (state.bodies[as_index(pad.body)].pose() * taxels.points()[k]);
        }
        EXPECT_GT(loaded, 4);
        const Vec3 away = centre - contact.position;
        EXPECT_LT((away - away.dot(contact.normal) * contact.normal).norm(), 1e-9);
      }
}

// Oracle: a disc smaller than the grid: the nearest point has all.
TEST(Taxels, ASmallDiscLoadsTheNearestPoint) {
  const model::Model model = fingertips();
  const model::State state = model::initial_state(model);
  Taxels taxels(model, 2e-3);
  const Contact contact = touch(state, 0, 0.001, 0.1, 1e-6, 0.01);
  int loaded = 0;
  for (const double force : taxels.read(std::span(&contact, 1), state)) loaded += force > 0;
  EXPECT_EQ(loaded, 1);
}

// Oracle: geometry: the areas are those of half a cylinder and a quarter of a sphere; points lie on the
// palmar side.
TEST(Taxels, CoverThePalmarHalfOfThePad) {
  const model::Model model = fingertips();
  const model::State state = model::initial_state(model);
  const Taxels taxels(model, 0.5e-3);
  const Taxels::Pad& pad = taxels.pads()[0];
  double area = 0;
  for (std::size_t k = pad.first; k < pad.first + pad.count; ++k) {
    area += taxels.areas()[k];
    EXPECT_LT((state.bodies[as_index(pad.body)].pose() * taxels.points()[k]).z(),
              state.bodies[as_index(pad.body)].p.z());
  }
  EXPECT_NEAR(area, M_PI * kRadius * kLength + M_PI * kRadius * kRadius, 1e-3 * area);
}

}  // namespace
}  // namespace handsim::engine
