#include "handsim/study/track/track_checks.h"

#include <algorithm>
#include <cmath>

#include "handsim/core/error.h"
#include "handsim/engine/contact/overlap.h"
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
      out.where = model.shapes[static_cast<std::size_t>(each.shape_a)].name + " and " +
                  model.shapes[static_cast<std::size_t>(each.shape_b)].name;
    }
    ++out.tested;
    if (overlaps) ++out.frames;
  }
}

void compare(const control::MotionTable& table, const std::vector<double>& times, TrackedHand& tracked) {
  const model::CubicSpline known(table.times, table.values, table.names.size());
  std::vector<double> row(table.names.size());
  for (std::size_t i = 0; i < tracked.axes.size(); ++i) {
    const auto column =
        std::find(table.names.begin(), table.names.end(), tracked.name + "." + tracked.axes[i]);
    if (column == table.names.end() || !tracked.determined[i]) continue;
    double squares = 0, count = 0;
    for (std::size_t k = 0; k < times.size(); ++k) {
      if (tracked.frames[k].status != FrameStatus::tracked) continue;
      known.at(times[k], row);
      const double error =
          tracked.frames[k].pose.angles[i] - row[static_cast<std::size_t>(column - table.names.begin())];
      squares += error * error;
      count += 1;
    }
    tracked.truth.push_back({tracked.axes[i], count > 0 ? std::sqrt(squares / count) : 0});
  }
  if (tracked.truth.empty())
    throw input_error(table.file, "no column of hand " + tracked.name,
                      "columns " + tracked.name + ".JOINT.AXIS");
}

}  // namespace handsim::study
