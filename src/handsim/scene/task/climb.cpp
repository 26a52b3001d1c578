#include "handsim/scene/task/climb.h"

#include <fmt/format.h>

#include "handsim/scene/read/blocks.h"
#include "handsim/scene/task/tasks.h"

namespace handsim::scene {

namespace {

struct ClimbSpec : TaskSpec {
  TaskPlan plan(const TaskSite& site) const override;

  /// Length of the hand for which the wrist's position is given [m]: for other hands the distance from the
  /// hold's origin is scaled in proportion. Absent: not scaled.
  std::optional<double> hand_length;
  double approach_height = 0.03;  ///< of the wrist's start, against the load [m]
  LoadSpec load;
  hand::GripTable strength;  ///< norms of grip strength
};

LoadSpec read_load(MapReader reader) {
  LoadSpec load;
  if (reader.has("direction")) load.direction = reader.direction("direction");
  load.rate = reader.number("rate", {Dimension::none, 0.1, 1e5}, load.rate);
  load.most = reader.number("max", {Dimension::force, 1, 1e5}, load.most);
  reader.finish();
  return load;
}

TaskPlan ClimbSpec::plan(const TaskSite& site) const {
  const bool left = site.entry.placement.side == model::Side::left;
  TaskPlan out;
  ClimbPlan& climb = out.climb.emplace();
  climb.hand = site.hand;
  climb.hold = object;
  climb.phases = phases;
  climb.height = approach_height;
  climb.load = load;
  if (left) climb.load.direction = mirrored(load.direction);
  climb.strength = hand::grip_strength(strength, site.entry.person);
  if (climb.strength.extrapolated)
    out.warnings.push_back(
        fmt::format("{}.strength: age or stature of {} is outside the table: the nearest row is used", path,
                    site.entry.placement.name));
  Pose at = wrist;
  const Vec3& hold = site.object.pose.p;
  if (hand_length) at.p = hold + site.built.size.length / *hand_length * (at.p - hold);
  out.placement = site.entry.placement;
  out.placement.pose = left ? mirrored(at) : at;
  out.placement.rail_direction = climb.load.direction;
  out.placement.start[hand::kRailName] = {-approach_height};
  out.object_pose = left ? mirrored(site.object.pose) : site.object.pose;
  out.moves = moves_through_poses(*this, climb.approach().end);
  return out;
}

}  // namespace

std::unique_ptr<TaskSpec> read_climb(MapReader& block) {
  auto out = std::make_unique<ClimbSpec>();
  ClimbSpec& climb = *out;
  read_task(block, "hold", climb);
  climb.hand_length = block.maybe_number("hand_length", {Dimension::length, 0.03, 0.5});
  MapReader approach = block.map("approach");
  climb.approach_height = approach.number("height", {Dimension::length, 0, 1}, climb.approach_height);
  add_phase(climb, "approach", approach.number("time", kSpan, 0.5));
  approach.finish();
  climb.close_time = block.number("close", kSpan, climb.close_time);
  add_phase(climb, "close",
            climb.close_time * static_cast<double>(climb.closed.size()) + block.number("settle", kSpan, 0.3));
  climb.load = read_load(block.map("load"));
  add_phase(climb, "load", climb.load.most / climb.load.rate);
  if (const YamlNode* table = referenced(block, "strength", FileKind::grip_norms))
    climb.strength = hand::read_grip_table(*table, block.path_of("strength"), block.diagnostics());
  return out;
}

}  // namespace handsim::scene
