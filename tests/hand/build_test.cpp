#include "handsim/hand/build.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "hand/shipped_hands.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/validate.h"
#include "places.h"

namespace handsim::hand {
namespace {

Person man() {
  Person out;
  out.stature = 1.755;
  out.mass = 84.5;
  out.sex = Sex::male;
  return out;
}

model::Model with_hand(const BuiltHand& hand, model::Side side, Mount mount = Mount::fixed) {
  model::Model model = model::make_model();
  Placement placement;
  placement.side = side;
  placement.name = side == model::Side::right ? "right" : "left";
  placement.mount = mount;
  placement.motion.keys = {{0, {}}};
  add_hand(model, hand, placement);
  return model;
}

class ShippedHands : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, ShippedHands, ::testing::Values("anatomical", "prototype"));

TEST_P(ShippedHands, HaveAPalmFifteenCapsulesAndNoDefects) {
  const BuiltHand hand = build_hand(shipped(GetParam()), man());
  ASSERT_EQ(hand.bodies.size(), 16U);
  const bool box = std::string(GetParam()) == "prototype";
  ASSERT_EQ(hand.shapes.size(), box ? 16U : 21U);
  EXPECT_EQ(hand.shapes[0].kind, box ? model::ShapeKind::box : model::ShapeKind::capsule);
  for (std::size_t i = 1; i < hand.shapes.size(); ++i)
    EXPECT_EQ(hand.shapes[i].kind, model::ShapeKind::capsule);
  for (const Mount mount : {Mount::fixed, Mount::hinge, Mount::free, Mount::driven})
    for (const model::Side side : {model::Side::right, model::Side::left})
      EXPECT_TRUE(model::defects(with_hand(hand, side, mount)).empty());
}

// Oracle: the hand model: a segment ends at its length from its joint, where the last one's capsule ends too.
// Bound: rounding.
TEST_P(ShippedHands, HaveFingertipsAtTheEndsOfTheirFingers) {
  const BuiltHand hand = build_hand(shipped(GetParam()), man());
  for (const model::Side side : {model::Side::right, model::Side::left}) {
    const model::Model model = with_hand(hand, side, Mount::hinge);
    const std::vector<model::Fingertip>& tips = model.hands[0].fingertips;
    ASSERT_EQ(tips.size(), 5U);
    EXPECT_EQ(tips[1].name, model.hands[0].name + ".index_tip");
    EXPECT_EQ(tips[4].finger, model::Part::little);
    for (const model::Fingertip& tip : tips) {
      const auto body = static_cast<std::size_t>(tip.body);
      EXPECT_TRUE(model.bodies[body].name.ends_with("_distal"));
      const auto joint = std::find_if(model.joints.begin(), model.joints.end(),
                                      [&](const model::Joint& each) { return each.child == tip.body; });
      const auto segment = std::find_if(hand.segments.begin(), hand.segments.end(), [&](const auto& each) {
        return model.hands[0].palm + each.body == tip.body;
      });
      EXPECT_NEAR((tip.point - joint->child_frame.p).norm(), segment->length, 1e-16);
      const auto shape = std::find_if(model.shapes.begin(), model.shapes.end(),
                                      [&](const model::Shape& each) { return each.body == tip.body; });
      const Vec3 in_shape = shape->pose.inverse() * tip.point;
      EXPECT_NEAR(std::abs(in_shape.z()), 0.5 * shape->length + shape->radius, 1e-16);
      EXPECT_LT(in_shape.head<2>().norm(), 1e-16);
    }
  }
}

// Oracle: the prototype's own values, which the hand model file states; on both axes of the thumb's universal
// joint.
TEST(ShippedPrototype, KeepsTheBounceAndFudgeFactorOfItsThumb) {
  const model::Model model = with_hand(build_hand(shipped("prototype"), man()), model::Side::left);
  int found = 0;
  for (const model::Joint& joint : model.joints)
    if (joint.kind == model::JointKind::universal)
      for (const model::JointAxis& axis : joint.axes) {
        ++found;
        EXPECT_EQ(axis.stop->restitution, 0.2);
        EXPECT_EQ(axis.stop->motor_share, 0.2);
      }
  EXPECT_EQ(found, 2);
}

TEST_P(ShippedHands, PartsSumToTheHandsMass) {
  const BuiltHand hand = build_hand(shipped(GetParam()), man());
  double sum = 0;
  for (const model::Body& body : hand.bodies) {
    EXPECT_GT(body.mass, 0) << body.name;
    sum += body.mass;
  }
  // Sixteen additions of numbers below 0.6 kg round by less than this.
  EXPECT_NEAR(sum, hand.mass, 1e-15);
}

// Oracle: the length rules themselves, against positions of the joints in the assembled model.
TEST_P(ShippedHands, SegmentLengthsAreExactJointCentreToJointCentre) {
  const HandSpec spec = shipped(GetParam());
  const BuiltHand hand = build_hand(spec, man());
  for (const model::Side side : {model::Side::right, model::Side::left}) {
    const model::Model model = with_hand(hand, side);
    const model::State state = model::initial_state(model);
    for (std::size_t i = 0; i < spec.segments.size(); ++i) {
      const model::Joint& joint = model.joints[i];
      const Vec3 start = state.bodies[static_cast<std::size_t>(joint.child)].pose() * joint.child_frame.p;
      const double length = spec.segments[i].length.value(hand.size);
      const model::Shape& shape = model.shapes[*hand.segments[i].capsule];
      if (!spec.segments[i].has_child) {
        const Vec3 tip = state.bodies[static_cast<std::size_t>(joint.child)].pose() *
                         (shape.pose.p + Vec3(0, 0.5 * shape.length + shape.radius, 0));
        EXPECT_NEAR((tip - start).norm(), length, 1e-12);
        continue;
      }
      for (const model::Joint& next : model.joints) {
        if (next.parent != joint.child) continue;
        const Vec3 end = state.bodies[static_cast<std::size_t>(next.parent)].pose() * next.parent_frame.p;
        EXPECT_NEAR((end - start).norm(), length, 1e-12) << joint.name;
      }
    }
  }
}

bool mirrored_bits(const Vec3& a, const Vec3& b) {
  return a.x() == -b.x() && a.y() == b.y() && a.z() == b.z();
}
bool mirrored_bits(const Quat& a, const Quat& b) {
  return a.w() == b.w() && a.x() == b.x() && a.y() == -b.y() && a.z() == -b.z();
}

TEST_P(ShippedHands, LeftIsTheMirrorOfRightToTheBit) {
  const BuiltHand hand = build_hand(shipped(GetParam()), man());
  for (const Mount mount : {Mount::fixed, Mount::hinge}) {
    const model::Model right = with_hand(hand, model::Side::right, mount);
    const model::Model left = with_hand(hand, model::Side::left, mount);
    ASSERT_EQ(right.bodies.size(), left.bodies.size());
    for (std::size_t i = 1; i < right.bodies.size(); ++i) {
      EXPECT_EQ(right.bodies[i].mass, left.bodies[i].mass);
      Mat3 image = right.bodies[i].inertia;
      for (const int k : {1, 2}) image(0, k) = image(k, 0) = -image(0, k);
      EXPECT_EQ(left.bodies[i].inertia, image);
      EXPECT_TRUE(mirrored_bits(right.bodies[i].zero_pose.p, left.bodies[i].zero_pose.p))
          << right.bodies[i].name;
      EXPECT_TRUE(mirrored_bits(right.bodies[i].zero_pose.q, left.bodies[i].zero_pose.q))
          << right.bodies[i].name;
    }
    for (std::size_t j = 0; j < right.joints.size(); ++j) {
      const model::Joint& r = right.joints[j];
      const model::Joint& l = left.joints[j];
      EXPECT_TRUE(mirrored_bits(r.parent_frame.p, l.parent_frame.p)) << r.name;
      EXPECT_TRUE(mirrored_bits(r.parent_frame.q, l.parent_frame.q)) << r.name;
      EXPECT_TRUE(mirrored_bits(r.child_frame.p, l.child_frame.p)) << r.name;
      for (std::size_t a = 0; a < r.axes.size(); ++a) {
        EXPECT_EQ(l.axes[a].axis, mirrored_axis(r.axes[a].axis)) << r.name;
        EXPECT_EQ(l.axes[a].stop->low, r.axes[a].stop->low);
      }
    }
  }
}

// Flexion is positive and moves every fingertip to the palm's side (-z); radial abduction of the index moves
// it to the thumb's side on both hands.
TEST(AnatomicalHand, FlexionCurlsTowardThePalmOnBothSides) {
  const BuiltHand hand = build_hand(shipped("anatomical"), man());
  for (const model::Side side : {model::Side::right, model::Side::left}) {
    const model::Model model = with_hand(hand, side);
    for (const model::Joint& joint : model.joints) {
      if (joint.name.find("thumb") != std::string::npos) continue;
      std::vector<double> q(static_cast<std::size_t>(model.dof_count()), 0.0);
      q[static_cast<std::size_t>(joint.first_dof)] = 0.5;
      const model::State straight = model::initial_state(model);
      const model::State bent = model::state_at(model, q);
      const auto child = static_cast<std::size_t>(joint.child);
      EXPECT_LT(bent.bodies[child].p.z(), straight.bodies[child].p.z() - 1e-3) << joint.name;
    }
  }
}

TEST(AnatomicalHand, AbductionMovesAwayFromTheMiddleFinger) {
  const BuiltHand hand = build_hand(shipped("anatomical"), man());
  for (const model::Side side : {model::Side::right, model::Side::left}) {
    const model::Model model = with_hand(hand, side);
    const double radial = side == model::Side::right ? -1 : 1;
    for (const model::Joint& joint : model.joints) {
      const bool index = joint.name.find("index_mcp") != std::string::npos;
      const bool little = joint.name.find("little_mcp") != std::string::npos;
      if (!index && !little) continue;
      std::vector<double> q(static_cast<std::size_t>(model.dof_count()), 0.0);
      q[static_cast<std::size_t>(joint.first_dof) + 1] = 0.2;
      const auto child = static_cast<std::size_t>(joint.child);
      const double moved =
          model::state_at(model, q).bodies[child].p.x() - model::initial_state(model).bodies[child].p.x();
      EXPECT_GT(moved * radial * (index ? 1 : -1), 1e-3) << joint.name;
    }
  }
}

TEST(BuildHand, MeasuredMassScalesEveryPart) {
  Person p = man();
  p.hand_mass = 0.4;
  for (const char* name : {"anatomical", "prototype"}) {
    const BuiltHand hand = build_hand(shipped(name), p);
    EXPECT_EQ(hand.mass, 0.4);
  }
}

TEST(BuildHand, AJointCanBeSwitchedBetweenHingeAndUniversal) {
  YamlNode node = load_yaml(test::in_source("handmodels/prototype.yaml"));
  for (YamlNode& row : node.find("segments")->items) {
    if (row.find("name")->text != "index_proximal") continue;
    *row.find("joint") = parse_yaml(
        "{name: index_mcp, type: universal, axes: [{name: flexion, axis: [-1, 0, 0], range: [0, 1]},"
        " {name: abduction, axis: [0, 0, 1], range: [-0.2, 0.2]}]}",
        "joint");
  }
  Diagnostics diagnostics;
  const HandSpec spec = read_hand_spec(node, "", diagnostics);
  diagnostics.throw_if_any();
  const model::Model model = with_hand(build_hand(spec, man()), model::Side::right);
  EXPECT_EQ(model.dof_count(), 17);
  EXPECT_TRUE(model::defects(model).empty());
}

TEST(BuildHand, UnknownJointsInTheStartPoseAreNamed) {
  Placement placement;
  placement.start["index_mpc"] = {0.1};
  model::Model model = model::make_model();
  try {
    add_hand(model, build_hand(shipped("anatomical"), man()), placement);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("nearest: index_mcp"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace handsim::hand
