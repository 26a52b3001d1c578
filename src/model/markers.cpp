#include "handsim/model/markers.h"

#include <algorithm>

#include "handsim/core/index.h"

namespace handsim::model {

namespace {

bool carries_another(const Model& model, int body) {
  return std::any_of(model.joints.begin(), model.joints.end(),
                     [&](const Joint& joint) { return joint.parent == body; });
}

/// The far end of a segment's capsule.
void add_tip(const Model& model, int body, std::vector<Marker>& out) {
  for (const Shape& shape : model.shapes)
    if (shape.body == body && shape.kind == ShapeKind::capsule)
      out.push_back({model.bodies[at(body)].name + ".tip", body,
                     shape.pose * Vec3(0, 0, 0.5 * shape.length + shape.radius)});
}

}  // namespace

std::vector<Marker> hand_markers(const Model& model) {
  std::vector<Marker> out;
  for (const HandIndex& hand : model.hands) {
    out.push_back({hand.name + ".wrist", hand.palm, hand.wrist_frame.p});
    for (const Joint& joint : model.joints)
      if (joint.child != hand.palm &&
          std::find(hand.bodies.begin(), hand.bodies.end(), joint.child) != hand.bodies.end())
        out.push_back({joint.name, joint.child, joint.child_frame.p});
    for (const int body : hand.bodies)
      if (body != hand.palm && !carries_another(model, body)) add_tip(model, body, out);
  }
  return out;
}

}  // namespace handsim::model
