#include "handsim/study/track/marker_set.h"

#include <algorithm>

namespace handsim::study {

namespace {

/// A point this near the joint of its segment, by the segment's length, hardly moves with it.
constexpr double kNearBase = 0.5;

MarkerSpec read_marker(MapReader reader, Feature::Kind kind) {
  MarkerSpec out;
  out.kind = kind;
  out.place = reader.node().place();
  out.name = reader.text("name");
  out.hand = reader.choice<model::Side>("hand", {{"right", model::Side::right}, {"left", model::Side::left}},
                                        model::Side::right);
  out.segment = reader.text("segment");
  const Quantity where = {Dimension::length, -0.5, 0.5};
  if (kind == Feature::Kind::point)
    out.at = reader.vector("at", where);
  else
    out.rotation = reader.rotation("rotation");
  reader.finish();
  return out;
}

/// A point of a tracker; one without a segment is not used.
MarkerSpec read_point(MapReader reader) {
  MarkerSpec out;
  out.place = reader.node().place();
  out.hand.reset();
  out.name = reader.text("name");
  out.segment = reader.text("segment", "none");
  const Quantity shares = {Dimension::none, -2, 2}, spread = {Dimension::none, 0, 2};
  out.shares = reader.vector("at", shares, Vec3(0, 0, 0));
  out.spread = reader.vector("spread", spread, Vec3(0, 0, 0));
  reader.finish();
  return out;
}

RecordingFormat read_format(MapReader reader, const std::vector<MarkerSpec>& points) {
  RecordingFormat out;
  out.up = reader.choice<char>("up", {{"z", 'z'}, {"y", 'y'}, {"-y", 'Y'}}, 'z');
  out.left_handed = reader.choice<bool>("handedness", {{"right", false}, {"left", true}}, false);
  out.unit = reader.choice<double>("unit", {{"m", 1}, {"cm", 1e-2}, {"mm", 1e-3}}, 1);
  out.origin_unseen = reader.choice<bool>("unseen", {{"null", false}, {"origin", true}}, true);
  out.confidence = reader.text("confidence", out.confidence);
  out.least_confidence = reader.number("least_confidence", {Dimension::none, 0, 1}, out.least_confidence);
  out.names.clear();
  for (const MarkerSpec& point : points) out.names.push_back(point.name);
  reader.finish();
  return out;
}

/// The point at which each segment begins, and at which the last one ends: of those in the palm the most
/// distal one of the finger. Bones lie between them.
void join_bones(std::vector<Feature>& features, const hand::HandSpec& spec, double arm) {
  const auto begin = [&](std::size_t row) {
    std::optional<std::size_t> out;
    for (std::size_t i = 0; i < features.size(); ++i) {
      const Feature& each = features[i];
      const bool here = each.segment == row && each.shares.y() < kNearBase,
                 in_palm = !spec.segments[row].parent && !each.segment &&
                           each.name.find("." + spec.segments[row].finger + "_") != std::string::npos;
      if ((here || in_palm) && (!out || each.shares.y() > features[*out].shares.y())) out = i;
    }
    return out;
  };
  for (std::size_t i = 0; i < features.size() && arm > 0; ++i) {
    if (!features[i].segment) continue;
    const std::size_t row = *features[i].segment;
    const bool end = features[i].shares.y() >= kNearBase;
    const std::optional<std::size_t> bone = end ? row : spec.segments[row].parent;
    if (!bone) continue;
    features[i].from = begin(*bone);
    features[i].bone = *bone;
    features[i].arm = arm;
  }
}

}  // namespace

MarkerSet read_marker_set(const YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  MarkerSet out;
  MapReader reader(node, path, diagnostics);
  reader.text("title", "untitled");
  reader.named_texts("sources");
  reader.each("markers", 0, kMostItems, [&](MapReader marker) {
    out.markers.push_back(read_marker(std::move(marker), Feature::Kind::point));
  });
  reader.each("sensors", 0, kMostItems, [&](MapReader sensor) {
    out.markers.push_back(read_marker(std::move(sensor), Feature::Kind::orientation));
  });
  if (reader.has("points")) {
    if (!out.markers.empty()) reader.problem("points", "points beside markers", "either of them");
    reader.each("points", 1, kMostItems,
                [&](MapReader point) { out.markers.push_back(read_point(std::move(point))); });
    out.format = read_format(reader.map("recording"), out.markers);
    out.bones = reader.number("bones", {Dimension::length, 0, 0.2}, 0);
  }
  if (reader.sound() && out.markers.empty())
    reader.problem("markers", "none", "at least one marker, sensor or point");
  reader.finish();
  return out;
}

std::vector<Feature> features_of(const MarkerSet& set, const hand::HandSpec& spec, model::Side side) {
  std::vector<Feature> out;
  std::vector<Problem> problems;
  std::vector<std::string> known = {"palm"};
  for (const hand::SegmentSpec& segment : spec.segments) known.push_back(segment.name);
  for (const MarkerSpec& marker : set.markers) {
    if (marker.hand.value_or(side) != side || (!marker.hand && marker.segment == "none")) continue;
    const auto found = std::ranges::find(known, marker.segment);
    if (found == known.end()) {
      problems.push_back({marker.place, "segment", marker.segment + ", an unknown segment",
                          "palm, or a segment of the hand model" + nearest_hint(marker.segment, known)});
      continue;
    }
    const std::string before = marker.hand ? "" : side == model::Side::right ? "right." : "left.";
    Feature& feature = out.emplace_back();
    feature.kind = marker.kind;
    feature.name = before + marker.name;
    feature.at = marker.at;
    feature.rotation = marker.rotation;
    feature.shares = marker.shares;
    feature.spread = marker.spread;
    if (found != known.begin()) feature.segment = as_index(found - known.begin() - 1);
    feature.base = !feature.segment || (!spec.segments[*feature.segment].parent && marker.at.isZero() &&
                                        std::abs(marker.shares.y()) < kNearBase);
  }
  if (!problems.empty()) throw Error(problems);
  join_bones(out, spec, set.bones);
  return out;
}

}  // namespace handsim::study
