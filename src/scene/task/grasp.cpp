#include "handsim/scene/task/grasp.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "handsim/hand/material.h"
#include "handsim/model/shape_extent.h"
#include "handsim/scene/read/readers.h"
#include "handsim/scene/task/hand_program.h"

namespace handsim::scene {

namespace {

const Quantity kPhaseTime = {Dimension::time, 0.01, 1e3};
const Quantity kPause = {Dimension::time, 0, 1e3};
constexpr std::size_t kMostGrasps = 60;
constexpr std::size_t kMostLevels = 20;

Pose read_frame(MapReader reader) {
  Pose pose = read_pose(reader);
  reader.finish();
  return pose;
}

std::optional<PostSpec> read_support(MapReader& reader) {
  const YamlNode* node = reader.child("support");
  if (node && node->kind == YamlNode::Kind::scalar && node->text == "ground") return std::nullopt;
  MapReader support = reader.required_map("support", "`ground`, or {radius, height} of a post");
  PostSpec post;
  post.radius = support.number("radius", {Dimension::length, 1e-3, 1}, post.radius);
  post.height = support.number("height", {Dimension::length, 1e-3, 2}, post.height);
  post.material = hand::read_material(support, "post");
  support.finish();
  return post;
}

ShakeLevel read_level(MapReader reader) {
  ShakeLevel level;
  level.acceleration = reader.number("acceleration", {Dimension::acceleration, 0, 1000});
  level.frequency = reader.number("frequency", {Dimension::frequency, 0.1, 100});
  reader.finish();
  return level;
}

void read_shake(MapReader reader, GraspSpec& grasp) {
  if (YamlNode* levels = reader.list("levels", true)) {
    if (levels->items.size() > kMostLevels)
      return reader.problem("levels", levels->described(), fmt::format("at most {} levels", kMostLevels));
    for (std::size_t i = 0; i < levels->items.size(); ++i)
      grasp.shake.push_back(read_level(
          MapReader(levels->items[i], item_path(reader.path_of("levels"), i), reader.diagnostics())));
  }
  grasp.shake_cycles = reader.integer("cycles", 1, 1000, grasp.shake_cycles);
  reader.finish();
}

GraspSpec read_grasp(MapReader reader) {
  GraspSpec grasp;
  grasp.place = reader.node().place();
  if (reader.has("hand")) grasp.hand = reader.name("hand");
  grasp.object = reader.name("object");
  grasp.wrist = read_frame(reader.required_map("wrist", "position and rotation of the hand frame"));
  grasp.at = read_frame(reader.required_map("at", "position and rotation of the object in the hand frame"));
  grasp.post = read_support(reader);
  grasp.open = reader.text("open");
  grasp.closed = read_pose_names(reader, "closed");
  MapReader approach = reader.map("approach");
  grasp.from = approach.vector("from", kCoordinate, grasp.from);
  grasp.approach_time = approach.number("time", kPhaseTime, grasp.approach_time);
  approach.finish();
  grasp.close_time = reader.number("close", kPhaseTime, grasp.close_time);
  grasp.settle_time = reader.number("settle", kPhaseTime, grasp.settle_time);
  MapReader lift = reader.map("lift");
  grasp.lift_height = lift.number("height", {Dimension::length, 0, 10}, grasp.lift_height);
  grasp.lift_time = lift.number("time", kPhaseTime, grasp.lift_time);
  lift.finish();
  grasp.hold = reader.number("hold", kPhaseTime, grasp.hold);
  if (reader.has("shake")) read_shake(reader.map("shake"), grasp);
  grasp.rest = reader.number("rest", kPause, grasp.rest);
  reader.finish();
  return grasp;
}

/// Lowest point of a solid whose frame is at a pose [m].
double lowest(const model::Shape& shape, const Pose& frame) {
  const Pose pose = frame * shape.pose;
  const Vec3 down = pose.q.conjugate() * Vec3(0, 0, -1);
  return pose.p.z() - model::support(shape, down);
}

/// A grasp in the frames of the hand that does it.
GraspSpec sided(GraspSpec grasp, model::Side side) {
  if (side == model::Side::right) return grasp;
  grasp.wrist = mirrored(grasp.wrist);
  grasp.at = mirrored(grasp.at);
  grasp.from = mirrored(grasp.from);
  return grasp;
}

/// Keyframes of the wrist, its shakes, and the phases that both make up.
void plan_motion(const GraspSpec& grasp, model::Side side, model::PoseMotion& motion, GraspPlan& plan) {
  double time = 0;
  const auto phase = [&](std::string name, double span) {
    plan.phases.push_back({std::move(name), time, time + span});
    time += span;
  };
  const Pose start = grasp.wrist * Pose{grasp.from, Quat::Identity()};
  Pose lifted = grasp.wrist;
  lifted.p.z() += grasp.lift_height;
  motion.keys.push_back({0, start});
  phase("approach", grasp.approach_time);
  motion.keys.push_back({time, grasp.wrist});
  phase("close", grasp.close_time * static_cast<double>(grasp.closed.size()) + grasp.settle_time);
  motion.keys.push_back({time, grasp.wrist});
  phase("lift", grasp.lift_time);
  motion.keys.push_back({time, lifted});
  phase("hold", grasp.hold);
  const double sharpness = grasp.shake.empty() ? 1 : model::shake_acceleration(grasp.shake_cycles);
  const double x = side == model::Side::right ? 1 : -1;
  for (std::size_t i = 0; i < grasp.shake.size(); ++i) {
    const ShakeLevel& level = grasp.shake[i];
    const double reach = level.acceleration / (sharpness * level.frequency * level.frequency);
    const double span = grasp.shake_cycles / level.frequency;
    double begin = time;
    for (const Vec3& way :
         {Vec3(x, 0, 0), Vec3(-x, 0, 0), Vec3(0, 1, 0), Vec3(0, -1, 0), Vec3(0, 0, 1), Vec3(0, 0, -1)}) {
      motion.shakes.push_back({begin, level.frequency, grasp.shake_cycles, reach * way});
      begin += span;
    }
    phase(fmt::format("shake_{}", i + 1), 6 * span);
  }
  if (grasp.rest > 0) phase("rest", grasp.rest);
}

ObjectSpec make_post(const PostSpec& post, const ObjectSpec& object) {
  ObjectSpec out;
  out.name = object.name + "_post";
  model::Shape cylinder;
  cylinder.kind = model::ShapeKind::cylinder;
  cylinder.radius = post.radius;
  cylinder.length = post.height;
  out.shapes.push_back(cylinder);
  out.is_static = true;
  out.pose.p = object.pose * object.body.centre;
  double top = std::numeric_limits<double>::infinity();
  for (const model::Shape& shape : object.shapes) top = std::min(top, lowest(shape, object.pose));
  out.pose.p.z() = top - post.height / 2;
  out.material = post.material;
  out.material.name = out.name;
  out.place = object.place;
  return out;
}

/// The hand that a grasp speaks of; nothing, with a problem, where there is none that can do it.
std::optional<std::size_t> grasping_hand(const SceneSpec& scene, const GraspSpec& grasp,
                                         const std::string& path, Diagnostics& diagnostics) {
  const auto found = find_hand(scene, grasp.hand, grasp.place, path + ".hand", diagnostics);
  if (!found) return std::nullopt;
  const hand::Placement& placement = scene.hands[*found].placement;
  if (placement.mount == hand::Mount::driven && placement.motion.keys.empty()) return found;
  diagnostics.problems.push_back({grasp.place, path + ".hand", "a hand whose wrist the grasp cannot move",
                                  "mount driven without a motion, and one grasp a hand"});
  return std::nullopt;
}

void place_grasp(SceneSpec& scene, const GraspSpec& given, const std::string& path,
                 Diagnostics& diagnostics) {
  const auto hand = grasping_hand(scene, given, path, diagnostics);
  const auto object = std::find_if(scene.objects.begin(), scene.objects.end(),
                                   [&](const ObjectSpec& o) { return o.name == given.object; });
  if (object == scene.objects.end() || object->is_static)
    diagnostics.problems.push_back(
        {given.place, path + ".object",
         object == scene.objects.end() ? given.object : given.object + ", which does not move",
         "the name of a free object of the scene"});
  if (!hand || object == scene.objects.end()) return;
  hand::Placement& placement = scene.hands[*hand].placement;
  const GraspSpec grasp = sided(given, placement.side);
  GraspPlan plan;
  plan.hand = *hand;
  plan.object = grasp.object;
  plan_motion(grasp, placement.side, placement.motion, plan);
  placement.pose = placement.motion.keys.front().pose;
  object->pose = grasp.wrist * grasp.at;
  scene.grasp_plans.push_back(std::move(plan));
  if (!grasp.post) return;
  ObjectSpec post = make_post(*grasp.post, *object);
  const bool taken = std::any_of(scene.objects.begin(), scene.objects.end(),
                                 [&](const ObjectSpec& o) { return o.name == post.name; });
  if (taken)
    diagnostics.problems.push_back(
        {given.place, path + ".support", post.name + ", an object of the scene", "that name for the post"});
  else
    scene.objects.push_back(std::move(post));
}

}  // namespace

const GraspPhase* GraspPlan::phase(std::string_view name) const {
  for (const GraspPhase& phase : phases)
    if (phase.name == name) return &phase;
  return nullptr;
}

std::vector<GraspSpec> read_grasps(MapReader& reader) {
  std::vector<GraspSpec> grasps;
  each_block(reader, "grasps", kMostGrasps,
             [&](MapReader block) { grasps.push_back(read_grasp(std::move(block))); });
  return grasps;
}

bool places_object(const std::vector<GraspSpec>& grasps, const std::string& object) {
  return std::any_of(grasps.begin(), grasps.end(), [&](const GraspSpec& g) { return g.object == object; });
}

void place_grasps(SceneSpec& scene, Diagnostics& diagnostics) {
  for (std::size_t i = 0; i < scene.grasps.size(); ++i)
    place_grasp(scene, scene.grasps[i], item_path("grasps", i), diagnostics);
  for (std::size_t i = 0; i < scene.hands.size(); ++i) {
    const hand::Placement& placement = scene.hands[i].placement;
    if (placement.mount == hand::Mount::driven && placement.motion.keys.empty())
      diagnostics.problems.push_back({scene.hands[i].place, item_path("hands", i) + ".wrist.motion",
                                      "nothing", "a mapping with keyframes, or a grasp of this hand"});
  }
}

void add_grasp_programs(SceneSpec& scene, Diagnostics& diagnostics) {
  for (std::size_t i = 0; i < scene.grasp_plans.size(); ++i) {
    const GraspSpec& grasp = scene.grasps[i];
    const GraspPlan& plan = scene.grasp_plans[i];
    HandProgram program;
    program.hand = plan.hand;
    program.open = grasp.open;
    program.closed = grasp.closed;
    program.close = plan.phase("close")->start;
    program.move = grasp.close_time;
    program.title = "grasp of " + grasp.object;
    program.place = grasp.place;
    program.path = item_path("grasps", i);
    program.what = "a grasp";
    add_hand_program(scene, program, diagnostics);
  }
}

double grasps_end(const SceneSpec& scene) {
  double end = 0;
  for (const GraspPlan& plan : scene.grasp_plans) end = std::max(end, plan.end());
  return end;
}

}  // namespace handsim::scene
