#include "handsim/study/track/hand_tree.h"

#include <array>

#include <fmt/format.h>

#include "handsim/core/error.h"

namespace handsim::study {

namespace {

constexpr std::array kFingers = {"thumb", "index", "middle", "ring", "little"};

}  // namespace

HandTree::HandTree(const hand::HandSpec& spec, const hand::BuiltHand& hand, model::Side side)
    : side_(side), model_(model::make_model()) {
  hand::Placement placement;
  placement.side = side;
  hand::add_hand(model_, hand, placement);
  const model::HandIndex& index = model_.hands.front();
  frames_.push_back(
      {index.palm, index.wrist_frame, {hand.size.breadth, hand.size.length, hand.size.thickness}});
  for (const hand::BuiltSegment& segment : hand.segments) {
    const auto body = as_index(segment.body);
    const Pose in_body = hand.bodies[body].zero_pose.inverse() * segment.frame;
    frames_.push_back({index.bodies[body],
                       side == model::Side::left ? mirrored(in_body) : in_body,
                       {segment.radius, segment.length, segment.radius}});
  }
  for (const hand::SegmentSpec& row : spec.segments)
    for (const model::JointAxis& axis : row.joint.axes)
      axes_.push_back({row.joint.name + "." + axis.name, axis.stop ? axis.stop->low : -M_PI,
                       axis.stop ? axis.stop->high : M_PI, axis.name == "flexion"});
  state_ = model::state_at(model_, std::vector<double>(axes_.size()));
}

HandPose HandTree::moved(const HandPose& from, const Eigen::Ref<const Eigen::VectorXd>& step) const {
  HandPose out = from;
  out.wrist.p += step.head<3>();
  out.wrist.q = (rotation_quaternion(step.segment<3>(3)) * from.wrist.q).normalized();
  for (std::size_t i = 0; i < out.angles.size(); ++i)
    out.angles[i] =
        std::clamp(from.angles[i] + step[static_cast<Eigen::Index>(6 + i)], axes_[i].low, axes_[i].high);
  return out;
}

void HandTree::place(std::span<const double> angles) { model::place_children(model_, angles, state_); }

Pose HandTree::pose(const Feature& feature) const {
  const Frame& of = frame(feature);
  const Pose own{feature.at + of.size.cwiseProduct(feature.shares), feature.rotation};
  return state_.bodies[as_index(of.body)].pose() * of.in_body *
         (side_ == model::Side::left ? mirrored(own) : own);
}

Mat3 HandTree::by_shares(const Feature& feature) const {
  const Frame& of = frame(feature);
  Vec3 size = of.size;
  if (side_ == model::Side::left) size.x() *= -1;
  return (state_.bodies[as_index(of.body)].pose() * of.in_body).q.toRotationMatrix() * size.asDiagonal();
}

model::Jacobian HandTree::jacobian(const Feature& feature) const {
  return model::jacobian(model_, state_, frame(feature).body, point(feature));
}

std::vector<std::string> keypoint_names() {
  std::vector<std::string> out = {"wrist"};
  for (const char* finger : kFingers) {
    const bool thumb = finger == kFingers.front();
    for (const char* joint :
         thumb ? std::array{"cmc", "mcp", "ip", "tip"} : std::array{"mcp", "pip", "dip", "tip"})
      out.push_back(fmt::format("{}_{}", finger, joint));
  }
  return out;
}

std::vector<Feature> keypoints(const hand::HandSpec& spec, const hand::BuiltHand& hand) {
  // Of points that turn out not to be the joints' centres: a third to a half of a radius, a tenth of a
  // length.
  const Vec3 kPalmSpread(0.1, 0.1, 0.4), kSpread(0.5, 0.1, 0.5);
  const auto ends_in = [&](std::size_t row, const std::string& name) {
    return !spec.segments[row].has_child &&
           std::ranges::any_of(hand.fingertips, [&](const model::Fingertip& tip) {
             return tip.name == name && tip.body == hand.segments[row].body;
           });
  };
  std::vector<Feature> out;
  for (const std::string& name : keypoint_names()) {
    Feature& feature = out.emplace_back();
    feature.name = name;
    feature.spread = name == "wrist" ? kPalmSpread : kSpread;
    feature.base = name == "wrist" || name == "thumb_cmc" || (name.ends_with("_mcp") && name != "thumb_mcp");
    for (std::size_t row = 0; row < spec.segments.size(); ++row) {
      const bool tip = ends_in(row, name);
      if (!tip && spec.segments[row].joint.name != name) continue;
      feature.segment = row;
      if (tip) feature.shares.y() = 1;
    }
    if (name != "wrist" && !feature.segment)
      throw input_error("--model", "a hand model without " + name, "joints thumb_cmc to little_dip");
  }
  return out;
}

}  // namespace handsim::study
