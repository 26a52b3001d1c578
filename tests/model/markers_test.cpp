#include "handsim/model/markers.h"

#include <set>

#include <gtest/gtest.h>

#include "engine/shared_motions.h"

namespace handsim::model {
namespace {

// Oracle: the same points from the other side: a joint's anchor on its parent, and a segment's end that moves
// with no other body. Bound: rounding, as joints of a placed hand have no gap.
TEST(Markers, LieInTheJointsOfABentHandAndAtItsTips) {
  const Model model = engine::test::shipped_hand("anatomical.yaml", hand::Mount::universal);
  std::vector<double> q(as_index(model.dof_count()));
  for (std::size_t i = 0; i < q.size(); ++i) q[i] = 0.2 + 0.15 * std::sin(static_cast<double>(i));
  const State state = state_at(model, q);
  ASSERT_EQ(model.hands.size(), 1U);
  const HandIndex& hand = model.hands[0];
  const auto place = [&](int body, const Vec3& point) {
    return Vec3(state.bodies[as_index(body)].pose() * point);
  };
  std::set<std::string> names;
  std::size_t joints = 0, tips = 0;
  for (const Marker& marker : hand_markers(model)) {
    EXPECT_TRUE(names.insert(marker.name).second) << marker.name;
    const Vec3 found = place(marker.body, marker.point);
    for (const Joint& joint : model.joints) {
      if (joint.name != marker.name) continue;
      EXPECT_LT((found - place(joint.parent, joint.parent_frame.p)).norm(), 1e-14) << marker.name;
      EXPECT_EQ(marker.body, joint.child);
      ++joints;
    }
    for (const Fingertip& tip : hand.fingertips) {
      if (marker.name != model.bodies[as_index(tip.body)].name + ".tip") continue;
      EXPECT_EQ(found, place(tip.body, tip.point));
      ++tips;
    }
    if (marker.name == "right.wrist") {
      EXPECT_EQ(found, place(hand.palm, hand.wrist_frame.p));
    }
  }
  EXPECT_TRUE(names.contains("right.wrist"));
  EXPECT_TRUE(names.contains("right.index_pip"));
  EXPECT_TRUE(names.contains("right.index_distal.tip"));
  EXPECT_EQ(tips, 5U);
  // Nothing but joints, of which the wrist is one here, and tips.
  EXPECT_EQ(names.size(), joints + tips);
}

}  // namespace
}  // namespace handsim::model
