// The hand on a forearm, with metacarpals that flex: the anatomical hand, otherwise.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "hand/shipped_hands.h"
#include "handsim/hand/build.h"
#include "handsim/model/energy.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/mass_properties.h"
#include "handsim/model/validate.h"
#include "support/sanitized.h"

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

/// Distance of two capsules' axes: that to one of them is convex along the other, so a ternary search finds
/// it.
double axes_apart(const std::array<Vec3, 2>& a, const std::array<Vec3, 2>& b) {
  const Vec3 along = b[1] - b[0];
  const auto distance = [&](double at) {
    const Vec3 off = a[0] + at * (a[1] - a[0]) - b[0];
    return (off - std::clamp(off.dot(along) / along.squaredNorm(), 0.0, 1.0) * along).norm();
  };
  double near = 0, far = 1;
  for (int i = 0; i < 40; ++i) {
    const double third = (far - near) / 3;
    if (distance(near + third) < distance(far - third))
      far -= third;
    else
      near += third;
  }
  return distance(0.5 * (near + far));
}

/// How deep the proximal and the last segment of the thumb lie in shapes of the palm at most [m], on a grid
/// over the thumb's own range, and at which share of the grid they are deeper than 3 mm.
std::pair<double, double> thumb_in_palm(const BuiltHand& hand) {
  const model::Model model = placed(hand, model::Side::right, Mount::fixed);
  std::vector<const model::Shape*> palm, thumb;
  for (const model::Shape& shape : model.shapes) {
    const std::string& body = model.bodies[static_cast<std::size_t>(shape.body)].name;
    if (body == "right.thumb_proximal" || body == "right.thumb_distal")
      thumb.push_back(&shape);
    else if (shape.part == model::Part::palm || shape.name.find("metacarpal.") != std::string::npos)
      if (body != "right.thumb_metacarpal") palm.push_back(&shape);
  }
  std::vector<std::pair<int, model::Stop>> range;
  for (const model::Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      if (joint.name.starts_with("right.thumb"))
        range.emplace_back(joint.first_dof + static_cast<int>(a), *joint.axes[a].stop);
  constexpr int kSteps = 6, kAll = kSteps * kSteps * kSteps * kSteps;
  std::vector<double> q(static_cast<std::size_t>(model.dof_count()), 0.0);
  double deepest = 0;
  int deep = 0;
  for (int i = 0; i < kAll; ++i) {
    int rest = i;
    for (const auto& [dof, stop] : range) {
      q[static_cast<std::size_t>(dof)] = stop.low + (stop.high - stop.low) * (rest % kSteps) / (kSteps - 1);
      rest /= kSteps;
    }
    const model::State state = model::state_at(model, q);
    const auto axis = [&](const model::Shape& shape) {
      const Pose pose = state.bodies[static_cast<std::size_t>(shape.body)].pose() * shape.pose;
      const Vec3 half(0, 0, 0.5 * shape.length);
      return std::array<Vec3, 2>{pose * Vec3(-half), pose * half};
    };
    double most = 0;
    for (const model::Shape* a : thumb)
      for (const model::Shape* b : palm) {
        // Axes are no nearer than their middles less half of their lengths: most pairs need no search.
        const auto middle = [&](const model::Shape& of) -> Vec3 {
          return state.bodies[static_cast<std::size_t>(of.body)].pose() * of.pose.p;
        };
        const double least = (middle(*a) - middle(*b)).norm() - 0.5 * (a->length + b->length);
        if (a->radius + b->radius - least <= most) continue;
        most = std::max(most, a->radius + b->radius - axes_apart(axis(*a), axis(*b)));
      }
    deepest = std::max(deepest, most);
    deep += most > 3e-3;
  }
  return {deepest, static_cast<double>(deep) / kAll};
}

// Oracle: the anatomical hand, whose pad is a rigid part of the palm. What is left is the corner in which the
// thumb flexes and adducts at once, across the index's metacarpal.
TEST(Forearm, CarriesTheThenarPadOutOfTheThumbsWay) {
  HANDSIM_SKIP_WITH_SANITIZER("the time is that of the oracle; other tests build these hands");
  for (const Person& each : kPeople) {
    const BuiltHand hand = build_hand(shipped("forearm"), each);
    const auto [before, often] = thumb_in_palm(build_hand(shipped("anatomical"), each));
    const auto [now, seldom] = thumb_in_palm(hand);
    EXPECT_LT(now, before);
    EXPECT_LE(seldom, 0.5 * often);
    std::printf("%.2f m: %.1f mm before, %.1f now; deeper than 3 mm: %.3f, %.3f\n", each.stature,
                1e3 * before, 1e3 * now, often, seldom);
    const auto pad = std::ranges::find(hand.shapes, "thumb_metacarpal.thenar", &model::Shape::name);
    ASSERT_NE(pad, hand.shapes.end());
    EXPECT_EQ(hand.bodies[static_cast<std::size_t>(pad->body)].name, "thumb_metacarpal");
    // It is the palm's skin for those who touch it.
    EXPECT_EQ(pad->part, model::Part::palm);
    const model::Model model = placed(hand, model::Side::right, Mount::fixed);
    for (const model::Shape& shape : model.shapes)
      if (shape.name == "right.thumb_metacarpal.thenar" || shape.name == "right.palm.hypothenar") {
        EXPECT_EQ(model.groups[static_cast<std::size_t>(shape.group)].name, "palm-right");
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
