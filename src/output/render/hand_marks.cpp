#include "handsim/output/render/hand_marks.h"

#include <algorithm>
#include <limits>
#include <optional>

namespace handsim::output {

namespace {

/// A nail is the part of a capsule that stands out of the fingertip's capsule; its sizes over the
/// fingertip's radius: it is 1.1 radii wide, and stands out by 0.1.
constexpr double kNailRadius = 0.72, kNailOffset = 0.38, kNailFrom = -0.5, kNailTo = 0.15;
/// Of a stump over the palm's width or thickness.
constexpr double kStumpWidth = 0.64, kStumpLength = 0.2, kStumpThickness = 0.86;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

bool is_last(const model::Model& model, int body) {
  return std::none_of(model.joints.begin(), model.joints.end(),
                      [&](const model::Joint& joint) { return joint.parent == body; });
}

/// The nail of a fingertip: opposite to where its flexion moves it.
std::optional<HandMark> nail(const model::Model& model, const model::Joint& joint) {
  const auto capsule = std::find_if(model.shapes.begin(), model.shapes.end(), [&](const model::Shape& shape) {
    return shape.body == joint.child && shape.kind == model::ShapeKind::capsule;
  });
  const auto flexion = std::find_if(joint.axes.begin(), joint.axes.end(),
                                    [](const model::JointAxis& axis) { return axis.name == "flexion"; });
  if (capsule == model.shapes.end() || flexion == joint.axes.end()) return std::nullopt;
  Vec3 distal = capsule->pose.q * Vec3::UnitZ();
  if (distal.dot(capsule->pose.p - joint.child_frame.p) < 0) distal = -distal;
  const Vec3 across = joint.child_frame.q * flexion->axis;
  const Vec3 dorsal = -across.cross(distal);
  if (dorsal.norm() < 0.5) return std::nullopt;
  const double r = capsule->radius, tip = capsule->length / 2;
  const double from = std::max(tip + kNailFrom * r, -tip), to = tip + kNailTo * r;
  HandMark mark;
  mark.solid = {Core::box, {0, 0, (to - from) / 2}, kNailRadius * r, {}, {}};
  mark.solid.pose.p = capsule->pose.p + (from + to) / 2 * distal + kNailOffset * r * dorsal.normalized();
  mark.solid.pose.q = capsule->pose.q;
  mark.body = joint.child;
  mark.shape = static_cast<int>(capsule - model.shapes.begin());
  mark.nail = true;
  return mark;
}

/// Behind the palm, as thick and two thirds as wide.
std::optional<HandMark> stump(const model::Model& model, const model::HandIndex& hand) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Vec3 low = Vec3::Constant(kInfinity), high = -low;
  std::optional<int> on;
  const Pose x_HP = hand.wrist_frame.inverse();
  for (std::size_t i = 0; i < model.shapes.size(); ++i) {
    const model::Shape& shape = model.shapes[i];
    if (shape.body != hand.palm || shape.part != model::Part::palm) continue;
    if (!on) on = static_cast<int>(i);
    const Solid drawn = solid(shape, x_HP * shape.pose);
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], -support(drawn, -Vec3::Unit(k)));
      high[k] = std::max(high[k], support(drawn, Vec3::Unit(k)));
    }
  }
  if (!on) return std::nullopt;
  const Vec3 size = high - low;
  HandMark mark;
  const double round = kStumpThickness * size.z() / 2;
  mark.solid = {Core::box,
                {std::max(kStumpWidth * size.x() / 2 - round, 0.0), kStumpLength * size.x() / 2, 0},
                round,
                {},
                {}};
  const Vec3 centre = {(low.x() + high.x()) / 2, low.y(), (low.z() + high.z()) / 2};
  mark.solid.pose = hand.wrist_frame * Pose{centre, Quat::Identity()};
  mark.body = hand.palm;
  mark.shape = *on;
  return mark;
}

}  // namespace

std::vector<HandMark> hand_marks(const model::Model& model) {
  std::vector<HandMark> out;
  for (const model::HandIndex& hand : model.hands) {
    if (const auto mark = stump(model, hand)) out.push_back(*mark);
    for (const int index : hand.joints) {
      const model::Joint& joint = model.joints[at(index)];
      if (joint.child == hand.palm || !is_last(model, joint.child)) continue;
      if (const auto mark = nail(model, joint)) out.push_back(*mark);
    }
  }
  return out;
}

}  // namespace handsim::output
