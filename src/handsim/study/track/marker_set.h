// Where markers and sensors sit on a hand: the content of a marker set file.
#pragma once

#include <string>
#include <vector>

#include "handsim/study/track/hand_tree.h"

namespace handsim::study {

/// A marker or sensor as the file states it.
struct MarkerSpec {
  std::string name;
  model::Side hand = model::Side::right;
  std::string segment;               ///< `palm`, or a segment of the hand model
  Vec3 at = Vec3::Zero();            ///< in the frame of the right hand's segment [m]; palm: the hand frame
  Quat rotation = Quat::Identity();  ///< of a sensor against the right hand's segment
  Feature::Kind kind = Feature::Kind::point;
  Place place;
};

struct MarkerSet {
  std::vector<MarkerSpec> markers;
};

/// Reads a marker set; every defect goes into the diagnostics.
MarkerSet read_marker_set(const YamlNode& node, const std::string& path, Diagnostics& diagnostics);
/// The features of one hand. @throws Error (input) for unknown segments.
std::vector<Feature> features_of(const MarkerSet& set, const hand::HandSpec& spec, model::Side side);

}  // namespace handsim::study
