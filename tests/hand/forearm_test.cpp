// The hand on a forearm, with metacarpals that flex: the anatomical hand, otherwise.
#include <gtest/gtest.h>

#include <cmath>

#include "hand/shipped_hands.h"
#include "handsim/hand/build.h"
#include "handsim/model/energy.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/mass_properties.h"
#include "handsim/model/validate.h"

namespace handsim::hand {
namespace {

const std::vector<Person> kPeople = {person(0.5, 3.5, Sex::female), person(1.1, 19, Sex::male),
                                     person(1.62, 62, Sex::female), person(1.755, 84.5, Sex::male),
                                     person(2.1, 130, Sex::male)};

model::MassProperties whole(const BuiltHand& hand) {
  std::vector<model::MassProperties> parts;
  for (const model::Body& body : hand.bodies) {
    const Mat3 r = body.zero_pose.q.toRotationMatrix();
    parts.push_back({body.mass, body.zero_pose.p, r * body.inertia * r.transpose()});
  }
  return model::joined(parts);
}

model::Model placed(const BuiltHand& hand, model::Side side, Mount mount) {
  model::Model model = model::make_model();
  Placement placement;
  placement.side = side;
  placement.mount = mount;
  placement.motion.keys = {{0, {}}};
  add_hand(model, hand, placement);
  return model;
}

// Oracle: the anatomical hand, straight: mass, centre of mass and inertia in all, to the rounding of sums and
// differences.
TEST(Forearm, DividesThePalmWithoutChangingTheHand) {
  const HandSpec flat = shipped("anatomical"), hollow = shipped("forearm");
  for (const Person& each : kPeople) {
    const BuiltHand a = build_hand(flat, each), b = build_hand(hollow, each);
    const model::MassProperties x = whole(a), y = whole(b);
    EXPECT_NEAR(y.mass, x.mass, 1e-13 * x.mass);
    EXPECT_NEAR(b.mass, a.mass, 1e-13 * a.mass);
    EXPECT_LT((y.centre - x.centre).norm(), 1e-12 * a.size.length);
    EXPECT_LT((y.inertia - x.inertia).norm(), 1e-12 * x.inertia.norm());
    EXPECT_EQ(b.bodies.size(), a.bodies.size() + 2);
    EXPECT_EQ(b.shapes.size(), a.shapes.size());
    // The knuckles are where they were.
    for (const char* name : {"ring_mcp", "little_mcp", "index_mcp"}) {
      const auto place = [&](const BuiltHand& hand) {
        for (const model::Joint& joint : hand.joints)
          if (joint.name == name)
            return Vec3(hand.bodies[static_cast<std::size_t>(joint.parent)].zero_pose * joint.parent_frame.p);
        return Vec3(Vec3::Constant(1));
      };
      EXPECT_LT((place(a) - place(b)).norm(), 1e-12 * a.size.length) << name;
    }
  }
}

// Oracle: rules of the model: positive masses, moments that a body can have, closed joints, on every mount.
TEST(Forearm, HasNoDefectsOnAnyMount) {
  for (const Person& each : kPeople) {
    const BuiltHand hand = build_hand(shipped("forearm"), each);
    for (const Mount mount : {Mount::fixed, Mount::hinge, Mount::universal, Mount::free, Mount::driven})
      for (const model::Side side : {model::Side::right, model::Side::left}) {
        const model::Model model = placed(hand, side, mount);
        EXPECT_TRUE(model::defects(model).empty());
        const bool hangs = mount == Mount::hinge || mount == Mount::universal;
        EXPECT_EQ(model.bodies.size(), (hangs ? 2U : 1U) + 18U);
        EXPECT_EQ(model.hands[0].forearm.has_value(), hangs);
      }
  }
}

// Oracle: m k^2 of the forearm and the parallel-axis theorem of the other bodies, against twice the kinetic
// energy at 1 rad/s. Pronation of a right hand turns its back towards the thumb's side, that of a left one,
// too.
TEST(Forearm, PronatesAboutItsLongAxis) {
  const Person man = kPeople[3];
  const HandSpec spec = shipped("forearm");
  const BuiltHand hand = build_hand(spec, man);
  double moment =
      hand.forearm->body.mass * std::pow(spec.forearm->along * spec.forearm->length.value(hand.size), 2);
  for (const model::Body& body : hand.bodies) {
    const Mat3 r = body.zero_pose.q.toRotationMatrix();
    const Vec3 p = body.zero_pose.p;
    moment += (r * body.inertia * r.transpose())(1, 1) + body.mass * (p.x() * p.x() + p.z() * p.z());
  }
  EXPECT_DOUBLE_EQ(hand.forearm->body.mass, 0.0162 * man.mass);
  for (const model::Side side : {model::Side::right, model::Side::left}) {
    const model::Model model = placed(hand, side, Mount::universal);
    ASSERT_EQ(model.joints[0].name, "right.forearm");
    model::State state = model::initial_state(model);
    const double angle = 0.3;
    const Vec3 way = Vec3(0, side == model::Side::right ? -1 : 1, 0);
    const Quat turn(Eigen::AngleAxisd(angle, way));
    for (std::size_t b = 1; b < state.bodies.size(); ++b) {
      state.bodies[b].p = turn * state.bodies[b].p;
      state.bodies[b].q = turn * state.bodies[b].q;
      state.bodies[b].w = way;
      state.bodies[b].v = way.cross(state.bodies[b].p);
    }
    model::update_coordinates(model, state);
    EXPECT_NEAR(state.q[0], angle, 1e-12);
    EXPECT_NEAR(state.u[0], 1, 1e-12);
    for (std::size_t i = 1; i < state.q.size(); ++i) EXPECT_NEAR(state.q[i], 0, 1e-12);
    EXPECT_NEAR(2 * model::kinetic_energy(model, state), moment, 1e-12 * moment);
  }
}

}  // namespace
}  // namespace handsim::hand
