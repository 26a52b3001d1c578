// Where markers, sensors or the points of a tracker sit on a hand: the content of a marker set file.
#pragma once

#include <string>
#include <vector>

#include "handsim/study/track/hand_tree.h"
#include "handsim/study/track/recording.h"

namespace handsim::study {

/// A marker or sensor as the file states it.
struct MarkerSpec {
  std::string name;
  std::optional<model::Side> hand = model::Side::right;  ///< absent: a point of each hand
  std::string segment;                                   ///< `palm`, or a segment of the hand model
  Vec3 at = Vec3::Zero();            ///< in the frame of the right hand's segment [m]; palm: the hand frame
  Quat rotation = Quat::Identity();  ///< of a sensor against the right hand's segment
  Feature::Kind kind = Feature::Kind::point;
  Place place;
  Vec3 shares = Vec3::Zero(), spread = Vec3::Zero();  ///< of a tracker's point (Feature)
};

/// Markers and sensors of one recording, or what the points of a tracker are, in their order.
struct MarkerSet {
  std::vector<MarkerSpec> markers;
  std::optional<RecordingFormat> format;  ///< of a tracker's files
  double bones = 0;                       ///< Feature::arm of the bones between a finger's points [m]

  bool is_convention() const { return format.has_value(); }
};

/// Reads a marker set; every defect goes into the diagnostics.
MarkerSet read_marker_set(const YamlNode& node, const std::string& path, Diagnostics& diagnostics);
/// The features of one hand; of a convention `right.NAME`. @throws Error (input) for unknown segments.
std::vector<Feature> features_of(const MarkerSet& set, const hand::HandSpec& spec, model::Side side);

}  // namespace handsim::study
