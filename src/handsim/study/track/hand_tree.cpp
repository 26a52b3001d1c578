#include "handsim/study/track/hand_tree.h"

#include <array>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/engine/collision/segments.h"

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
  find_pairs(spec, hand);
}

void HandTree::find_pairs(const hand::HandSpec& spec, const hand::BuiltHand& hand) {
  const model::HandIndex& index = model_.hands.front();
  std::vector<int> palm = index.palm_parts, thumb;
  palm.push_back(index.palm);
  const auto among = [](const std::vector<int>& bodies, int body) {
    return std::ranges::find(bodies, body) != bodies.end();
  };
  for (std::size_t row = 0; row < spec.segments.size(); ++row) {
    const int body = index.bodies[as_index(hand.segments[row].body)];
    // The first segment is jointed to the palm: its capsule begins in it.
    if (spec.segments[row].finger == kFingers.front() && spec.segments[row].parent && !among(palm, body))
      thumb.push_back(body);
  }
  for (const model::Shape& a : model_.shapes)
    for (const model::Shape& b : model_.shapes)
      if (a.kind == model::ShapeKind::capsule && b.kind == a.kind && among(thumb, a.body) &&
          among(palm, b.body))
        pairs_.emplace_back(&a - model_.shapes.data(), &b - model_.shapes.data());
}

HandTree::Capsule HandTree::capsule(const model::Shape& shape) const {
  const Pose x = state_.bodies[as_index(shape.body)].pose() * shape.pose;
  return {shape.name, x.p, x.q * Vec3(0, 0, 0.5 * shape.length), shape.radius};
}

std::vector<HandTree::Capsule> HandTree::capsules() const {
  std::vector<Capsule> out;
  for (const model::Shape& each : model_.shapes)
    if (each.kind == model::ShapeKind::capsule) out.push_back(capsule(each));
  return out;
}

std::optional<HandTree::Inside> HandTree::inside(std::size_t pair, double least) const {
  const model::Shape &shape_a = model_.shapes[pairs_[pair].first],
                     &shape_b = model_.shapes[pairs_[pair].second];
  const Capsule a = capsule(shape_a), b = capsule(shape_b);
  const auto [s, t] = engine::nearest_of_segments(a.at, a.along, b.at, b.along);
  const Vec3 at_a = a.at + s * a.along, at_b = b.at + t * b.along, apart = at_a - at_b;
  const double distance = apart.norm(), depth = a.radius + b.radius - distance;
  if (depth < least || distance < 1e-9) return std::nullopt;
  const Eigen::RowVector3d inwards = -apart.transpose() / distance;
  return Inside{depth, inwards * (model::jacobian(model_, state_, shape_a.body, at_a).topRows<3>() -
                                  model::jacobian(model_, state_, shape_b.body, at_b).topRows<3>())};
}

HandPose HandTree::moved_freely(const HandPose& from, const Eigen::Ref<const Eigen::VectorXd>& step) const {
  HandPose out = from;
  out.wrist.p += step.head<3>();
  out.wrist.q = (rotation_quaternion(step.segment<3>(3)) * from.wrist.q).normalized();
  for (std::size_t i = 0; i < out.angles.size(); ++i) out.angles[i] += step[static_cast<Eigen::Index>(6 + i)];
  return out;
}

HandPose HandTree::within_stops(HandPose pose) const {
  for (std::size_t i = 0; i < pose.angles.size(); ++i)
    pose.angles[i] = std::clamp(pose.angles[i], axes_[i].low, axes_[i].high);
  return pose;
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
