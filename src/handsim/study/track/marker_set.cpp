#include "handsim/study/track/marker_set.h"

#include <algorithm>

namespace handsim::study {

namespace {

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

}  // namespace

MarkerSet read_marker_set(const YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  MarkerSet out;
  MapReader reader(node, path, diagnostics);
  reader.text("title", "untitled");
  reader.each("markers", 0, kMostItems, [&](MapReader marker) {
    out.markers.push_back(read_marker(std::move(marker), Feature::Kind::point));
  });
  reader.each("sensors", 0, kMostItems, [&](MapReader sensor) {
    out.markers.push_back(read_marker(std::move(sensor), Feature::Kind::orientation));
  });
  if (reader.sound() && out.markers.empty())
    reader.problem("markers", "none", "at least one marker or sensor");
  reader.finish();
  return out;
}

std::vector<Feature> features_of(const MarkerSet& set, const hand::HandSpec& spec, model::Side side) {
  std::vector<Feature> out;
  std::vector<Problem> problems;
  std::vector<std::string> known = {"palm"};
  for (const hand::SegmentSpec& segment : spec.segments) known.push_back(segment.name);
  for (const MarkerSpec& marker : set.markers) {
    if (marker.hand != side) continue;
    const auto found = std::ranges::find(known, marker.segment);
    if (found == known.end()) {
      problems.push_back({marker.place, "segment", marker.segment + ", an unknown segment",
                          "palm, or a segment of the hand model" + nearest_hint(marker.segment, known)});
      continue;
    }
    out.push_back({marker.kind, marker.name, std::nullopt, marker.at, marker.rotation});
    if (found != known.begin()) out.back().segment = as_index(found - known.begin() - 1);
  }
  if (!problems.empty()) throw Error(problems);
  return out;
}

}  // namespace handsim::study
