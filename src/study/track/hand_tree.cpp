#include "handsim/study/track/hand_tree.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "handsim/core/error.h"

namespace handsim::study {

namespace {

constexpr std::array kFingers = {"thumb", "index", "middle", "ring", "little"};

}  // namespace

HandTree::HandTree(const hand::HandSpec& spec, const hand::BuiltHand& hand, model::Side side) : side_(side) {
  const bool left = side == model::Side::left;
  for (std::size_t i = 0; i < spec.segments.size(); ++i) {
    const hand::SegmentSpec& row = spec.segments[i];
    Link link;
    link.parent = row.parent;
    const Pose parent = row.parent < 0 ? Pose{} : hand.segments[static_cast<std::size_t>(row.parent)].frame;
    link.at = parent.inverse() * hand.segments[i].frame;
    if (left) link.at = mirrored(link.at);
    link.first = axes_.size();
    for (const model::JointAxis& axis : row.joint.axes) {
      link.axes.push_back(left ? mirrored_axis(axis.axis) : axis.axis);
      const double low = axis.stop ? axis.stop->low : -M_PI, high = axis.stop ? axis.stop->high : M_PI;
      axes_.push_back({row.joint.name + "." + axis.name, low, high, axis.name == "flexion"});
    }
    link.world.resize(link.axes.size());
    links_.push_back(std::move(link));
  }
}

void HandTree::place(std::span<const double> angles) {
  for (Link& link : links_) {
    const Pose start =
        link.parent < 0 ? link.at : links_[static_cast<std::size_t>(link.parent)].frame * link.at;
    link.frame.p = start.p;
    Quat q = start.q;
    for (std::size_t k = 0; k < link.axes.size(); ++k) {
      link.world[k] = q * link.axes[k];
      q = q * Quat(Eigen::AngleAxisd(angles[link.first + k], link.axes[k]));
    }
    link.frame.q = q;
  }
}

Vec3 HandTree::point(const Feature& feature) const {
  const Vec3 at = side_ == model::Side::left ? mirrored(feature.at) : feature.at;
  return feature.segment < 0 ? at : links_[static_cast<std::size_t>(feature.segment)].frame * at;
}

Quat HandTree::orientation(const Feature& feature) const {
  const Quat rotation = side_ == model::Side::left ? mirrored(feature.rotation) : feature.rotation;
  return feature.segment < 0 ? rotation
                             : links_[static_cast<std::size_t>(feature.segment)].frame.q * rotation;
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
  std::vector<Feature> out;
  for (const std::string& name : keypoint_names()) {
    Feature feature;
    feature.name = name;
    const bool tip = name.ends_with("_tip");
    const auto found = std::find_if(spec.segments.begin(), spec.segments.end(), [&](const auto& row) {
      return tip ? !row.has_child &&
                       name.starts_with(row.joint.name.substr(0, row.joint.name.find('_')) + "_")
                 : row.joint.name == name;
    });
    if (name != "wrist") {
      if (found == spec.segments.end())
        throw input_error("--model", "a hand model without " + name, "joints thumb_cmc to little_dip");
      const auto segment = static_cast<std::size_t>(found - spec.segments.begin());
      feature.segment = static_cast<int>(segment);
      if (tip) feature.at = {0, hand.segments[segment].length, 0};
    }
    out.push_back(std::move(feature));
  }
  return out;
}

}  // namespace handsim::study
