#include "handsim/model/markers.h"

#include <algorithm>

namespace handsim::model {

std::vector<Marker> hand_markers(const Model& model) {
  std::vector<Marker> out;
  for (const HandIndex& hand : model.hands) {
    out.push_back({hand.name + ".wrist", hand.palm, hand.wrist_frame.p});
    for (const Joint& joint : model.joints)
      if (joint.child != hand.palm && std::ranges::find(hand.bodies, joint.child) != hand.bodies.end())
        out.push_back({joint.name, joint.child, joint.child_frame.p});
    for (const Fingertip& tip : hand.fingertips)
      out.push_back({model.bodies[as_index(tip.body)].name + ".tip", tip.body, tip.point});
  }
  return out;
}

}  // namespace handsim::model
