#include "handsim/study/track/track_checks.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/index.h"
#include "handsim/core/text.h"
#include "handsim/engine/collision/overlap.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/spline.h"

namespace handsim::study {

void find_overlaps(const hand::BuiltHand& hand, TrackedHand& tracked) {
  constexpr std::size_t kMostTested = 200;
  constexpr double kDepth = 1e-3;
  model::Model model = model::make_model();
  hand::Placement placement;
  placement.name = tracked.name;
  placement.side = tracked.side;
  hand::add_hand(model, hand, placement);
  std::vector<std::size_t> good;
  for (std::size_t k = 0; k < tracked.frames.size(); ++k)
    if (tracked.frames[k].status == FrameStatus::tracked) good.push_back(k);
  OverlapFigures& out = tracked.overlaps;
  const std::size_t stride = 1 + good.size() / kMostTested;
  for (std::size_t i = 0; i < good.size(); i += stride) {
    const model::State state = model::state_at(model, tracked.frames[good[i]].pose.angles);
    bool overlaps = false;
    for (const engine::Overlap& each : engine::initial_overlaps(model, state)) {
      overlaps = overlaps || each.depth > kDepth;
      if (each.depth <= out.deepest) continue;
      out.deepest = each.depth;
      out.where = model.shapes[at(each.shape_a)].name + " and " + model.shapes[at(each.shape_b)].name;
    }
    ++out.tested;
    if (overlaps) ++out.frames;
  }
}

void compare(const control::MotionTable& table, const std::vector<double>& times, TrackedHand& tracked) {
  const model::CubicSpline known(table.times, table.values, table.names.size());
  std::vector<double> row(table.names.size());
  for (std::size_t i = 0; i < tracked.axes.size(); ++i) {
    const auto column = std::ranges::find(table.names, tracked.name + "." + tracked.axes[i]);
    if (column == table.names.end() || !tracked.determined[i]) continue;
    double squares = 0, count = 0;
    for (std::size_t k = 0; k < times.size(); ++k) {
      if (tracked.frames[k].status != FrameStatus::tracked) continue;
      known.at(times[k], row);
      const double error = tracked.frames[k].pose.angles[i] - row[at(column - table.names.begin())];
      squares += error * error;
      count += 1;
    }
    tracked.truth.push_back({tracked.axes[i], count > 0 ? std::sqrt(squares / count) : 0});
  }
  if (tracked.truth.empty())
    throw input_error(table.file, "no column of hand " + tracked.name,
                      "columns " + tracked.name + ".JOINT.AXIS");
}

std::vector<std::string> recording_warnings(const TrackInput& input, const Recording& recording) {
  constexpr double kLongestInterval = 0.5;
  constexpr std::size_t kMostNamed = 5;
  std::vector<std::string> known, out;
  if (input.markers)
    for (const MarkerSpec& marker : input.markers->markers) known.push_back(marker.name);
  else
    for (const char* side : {"right.", "left."})
      for (const std::string& name : keypoint_names()) known.push_back(side + name);
  std::size_t unused = 0;
  std::string names;
  for (const auto& [name, channel] : recording.channels) {
    if (std::ranges::find(known, name) != known.end()) continue;
    if (++unused <= kMostNamed) names += (unused > 1 ? ", " : "") + name + nearest_hint(name, known);
  }
  if (unused > kMostNamed) names += ", ...";
  if (unused == recording.channels.size())
    throw input_error(recording.file, "no point of a hand, but " + names,
                      input.markers
                          ? "the names of --markers"
                          : "keypoints such as right.wrist or left.0, or --markers with these names");
  if (unused > 0)
    out.push_back(fmt::format("{}: {} names that no hand uses: {}", recording.file, unused, names));
  const double interval = (recording.times.back() - recording.times.front()) /
                          static_cast<double>(std::max<std::size_t>(1, recording.times.size() - 1));
  if (interval > kLongestInterval)
    out.push_back(
        fmt::format("{}: frames {:.3g} s apart: times in milliseconds? They are read as seconds, and no "
                    "motion is followed over such gaps",
                    recording.file, interval));
  return out;
}

std::string swap_warning(const TrackedHand& tracked) {
  if (tracked.frames.empty() || 2 * tracked.count(FrameStatus::swapped) < tracked.frames.size()) return {};
  return fmt::format(
      "{}: most frames have the shape of the other hand: it is a {} hand under the wrong name, or the axes "
      "of the recording are left-handed (such as y down with z away: change the sign of one of them)",
      tracked.name, tracked.side == model::Side::right ? "left" : "right");
}

}  // namespace handsim::study
