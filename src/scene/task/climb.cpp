#include "handsim/scene/task/climb.h"

#include <algorithm>

#include <fmt/format.h>

#include "handsim/scene/read/readers.h"
#include "handsim/scene/task/hand_program.h"

namespace handsim::scene {

namespace {

const Quantity kPhaseTime = {Dimension::time, 0.01, 1e3};
constexpr std::size_t kMostClimbs = 60;

LoadSpec read_load(MapReader reader) {
  LoadSpec load;
  if (reader.has("direction")) load.direction = reader.direction("direction");
  load.rate = reader.number("rate", {Dimension::none, 0.1, 1e5}, load.rate);
  load.most = reader.number("max", {Dimension::force, 1, 1e5}, load.most);
  reader.finish();
  return load;
}

ClimbSpec read_climb(MapReader reader) {
  ClimbSpec climb;
  climb.place = reader.node().place();
  if (reader.has("hand")) climb.hand = reader.name("hand");
  climb.hold = reader.name("hold");
  MapReader wrist = reader.required_map("wrist", "position and rotation of the hand frame at the hold");
  climb.wrist = read_pose(wrist);
  wrist.finish();
  climb.hand_length = reader.maybe_number("hand_length", {Dimension::length, 0.03, 0.5});
  climb.open = reader.text("open");
  climb.closed = read_pose_names(reader, "closed");
  MapReader approach = reader.map("approach");
  climb.approach_height = approach.number("height", {Dimension::length, 0, 1}, climb.approach_height);
  climb.approach_time = approach.number("time", kPhaseTime, climb.approach_time);
  approach.finish();
  climb.close_time = reader.number("close", kPhaseTime, climb.close_time);
  climb.settle_time = reader.number("settle", kPhaseTime, climb.settle_time);
  climb.load = read_load(reader.map("load"));
  if (YamlNode* table = referenced(reader, "strength", FileKind::grip_norms))
    climb.strength = hand::read_grip_table(*table, reader.path_of("strength"), reader.diagnostics());
  reader.finish();
  return climb;
}

/// Where a right hand's wrist is at a hold, for the hand of a person.
Pose fitted_wrist(const ClimbSpec& climb, const HandEntry& entry, const Vec3& hold) {
  Pose wrist = climb.wrist;
  if (!climb.hand_length) return wrist;
  const double scale = hand::hand_size(entry.model.anthropometry, entry.person).length / *climb.hand_length;
  wrist.p = hold + scale * (wrist.p - hold);
  return wrist;
}

void place_climb(SceneSpec& scene, const ClimbSpec& climb, const std::string& path,
                 Diagnostics& diagnostics) {
  const auto say = [&](const char* key, std::string got, std::string need) {
    diagnostics.problems.push_back({climb.place, path + key, std::move(got), std::move(need)});
  };
  const auto hold = std::find_if(scene.objects.begin(), scene.objects.end(),
                                 [&](const ObjectSpec& o) { return o.name == climb.hold; });
  const bool known = hold != scene.objects.end();
  if (!known || !hold->is_static)
    say(".hold", known ? climb.hold + ", which moves" : climb.hold,
        "the name of a static object of the scene");
  const auto hand = find_hand(scene, climb.hand, climb.place, path + ".hand", diagnostics);
  if (!known || !hand) return;
  HandEntry& entry = scene.hands[*hand];
  const auto same = [&](const ClimbPlan& plan) { return plan.hand == *hand; };
  if (entry.placement.mount != hand::Mount::rail)
    return say(".hand", "a hand that hangs on no rail", "wrist.mount rail");
  if (std::any_of(scene.climb_plans.begin(), scene.climb_plans.end(), same))
    return say(".hand", "a second climb of one hand", "one climb a hand");
  const bool left = entry.placement.side == model::Side::left;
  ClimbPlan plan;
  plan.hand = *hand;
  plan.hold = climb.hold;
  plan.height = climb.approach_height;
  plan.load = climb.load;
  if (left) plan.load.direction = mirrored(plan.load.direction);
  double time = 0;
  const auto phase = [&](const char* name, double span) {
    plan.phases.push_back({name, time, time + span});
    time += span;
  };
  phase("approach", climb.approach_time);
  phase("close", climb.close_time * static_cast<double>(climb.closed.size()) + climb.settle_time);
  phase("load", climb.load.most / climb.load.rate);
  plan.strength = hand::grip_strength(climb.strength, entry.person);
  if (plan.strength.extrapolated)
    diagnostics.warnings.push_back(
        fmt::format("{}.strength: age or stature of {} is outside the table: its nearest row", path,
                    entry.placement.name));
  const Pose wrist = fitted_wrist(climb, entry, hold->pose.p);
  entry.placement.pose = left ? mirrored(wrist) : wrist;
  entry.placement.along = plan.load.direction;
  entry.placement.start[hand::kRailName] = {-climb.approach_height};
  if (left) hold->pose = mirrored(hold->pose);
  scene.climb_plans.push_back(std::move(plan));
}

}  // namespace

std::vector<ClimbSpec> read_climbs(MapReader& reader) {
  std::vector<ClimbSpec> climbs;
  each_block(reader, "climbs", kMostClimbs,
             [&](MapReader block) { climbs.push_back(read_climb(std::move(block))); });
  return climbs;
}

void place_climbs(SceneSpec& scene, Diagnostics& diagnostics) {
  for (std::size_t i = 0; i < scene.climbs.size(); ++i)
    place_climb(scene, scene.climbs[i], item_path("climbs", i), diagnostics);
  // In a scene with climbs rails have no place of their own.
  if (scene.climbs.empty() || !diagnostics.problems.empty()) return;
  for (std::size_t i = 0; i < scene.hands.size(); ++i) {
    const auto mine = [&](const ClimbPlan& plan) { return plan.hand == i; };
    if (scene.hands[i].placement.mount == hand::Mount::rail &&
        std::none_of(scene.climb_plans.begin(), scene.climb_plans.end(), mine))
      diagnostics.problems.push_back({scene.hands[i].place, item_path("hands", i) + ".wrist.mount",
                                      "a rail without a climb", "a climb of this hand, or another mount"});
  }
}

void add_climb_programs(SceneSpec& scene, Diagnostics& diagnostics) {
  for (std::size_t i = 0; i < scene.climb_plans.size(); ++i) {
    const ClimbSpec& climb = scene.climbs[i];
    const ClimbPlan& plan = scene.climb_plans[i];
    HandProgram program;
    program.hand = plan.hand;
    program.open = climb.open;
    program.closed = climb.closed;
    program.close = plan.approach().end;
    program.move = climb.close_time;
    program.title = "climb on " + climb.hold;
    program.place = climb.place;
    program.path = item_path("climbs", i);
    program.what = "a climb";
    add_hand_program(scene, program, diagnostics);
  }
}

double climbs_end(const SceneSpec& scene) {
  double end = 0;
  for (const ClimbPlan& plan : scene.climb_plans) end = std::max(end, plan.loading().end);
  return end;
}

}  // namespace handsim::scene
