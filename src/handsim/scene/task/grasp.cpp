#include "handsim/scene/task/grasp.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "handsim/model/shape_extent.h"
#include "handsim/model/surface_reader.h"
#include "handsim/scene/read/blocks.h"
#include "handsim/scene/task/grip_fit.h"
#include "handsim/scene/task/tasks.h"

namespace handsim::scene {

namespace {

constexpr std::size_t kMostLevels = 20;

/// Oscillations in six directions, +-x, +-y, +-z of the world.
struct ShakeLevel {
  double acceleration = 9.81;  ///< largest [m/s^2]
  double frequency = 2;        ///< [Hz]
};

constexpr std::uint32_t kPostColour = 0xA8A296;  ///< Dull, so that it stands back behind the object: sRGB.

/// A static cylinder under the object.
struct PostSpec {
  double radius = 0.01;  ///< [m]
  double height = 0.1;   ///< [m]
  model::Material material;
};

struct GraspSpec : TaskSpec {
  TaskPlan plan(const TaskSite& site) const override;
  /// Fits the grip; returns X_WH at the object, right hand.
  Pose fit(const TaskSite& site, TaskPlan& out) const;

  Pose at;                            ///< X_HO: pose of the object in a right hand
  std::optional<double> hand_length;  ///< for which `at` is given; for others its position is scaled [m]
  bool on_palm = false;               ///< the object is moved along the hand's z axis onto the palm
  std::optional<GripSpec> grip;       ///< absent: poses as they stand
  std::optional<PostSpec> post;       ///< absent: the object rests on the ground or on objects of the scene
  Vec3 from = Vec3::Zero();           ///< start of the wrist, in the hand frame at the grasp [m]
  double lift_height = 0.2;           ///< [m]
  std::vector<ShakeLevel> shake;      ///< one after the other, six directions each
  int shake_cycles = 2;               ///< in each direction
};

void read_at(MapReader reader, GraspSpec& grasp) {
  grasp.at = read_pose(reader);
  grasp.hand_length = reader.maybe_number("hand_length", {Dimension::length, 0.03, 0.5});
  grasp.on_palm = reader.choice<bool>("touches", {{"palm", true}, {"nothing", false}}, false);
  reader.finish();
}

std::optional<PostSpec> read_support(MapReader& reader) {
  using Kind = YamlNode::Kind;
  const char* need = "`ground`, or {radius, height} of a post";
  const YamlNode* node = reader.value("support", {{Kind::map, Kind::scalar}, need, true, {"ground"}});
  if (!node || node->kind == Kind::scalar) {
    if (node && node->text != "ground") reader.problem("support", node->described(), need);
    return std::nullopt;
  }
  MapReader support = reader.map("support");
  PostSpec post;
  post.radius = support.number("radius", {Dimension::length, 1e-3, 1}, post.radius);
  post.height = support.number("height", {Dimension::length, 1e-3, 2}, post.height);
  post.material = model::read_material(support, "post");
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
  reader.each("levels", 0, kMostLevels,
              [&](MapReader level) { grasp.shake.push_back(read_level(std::move(level))); });
  grasp.shake_cycles = reader.integer("cycles", 1, 1000, grasp.shake_cycles);
  reader.finish();
}

/// Lowest point of a solid whose frame is at a pose [m].
double lowest(const model::Shape& shape, const Pose& frame) {
  const Pose pose = frame * shape.pose;
  const Vec3 down = pose.q.conjugate() * Vec3(0, 0, -1);
  return pose.p.z() - model::support(shape, down);
}

/// Keyframes of a wrist from approach to lift, and its shakes. @param at X_WH at the object, right hand
model::PoseMotion wrist_motion(const GraspSpec& grasp, const Pose& at, bool left) {
  const auto for_side = [&](const auto& x) { return left ? mirrored(x) : x; };
  const Pose wrist = for_side(at);
  Pose lifted = wrist;
  lifted.p.z() += grasp.lift_height;
  model::PoseMotion motion;
  motion.keys.push_back({0, wrist * Pose{for_side(grasp.from), Quat::Identity()}});
  motion.keys.push_back({grasp.phases[0].end, wrist});
  motion.keys.push_back({grasp.phases[1].end, wrist});
  motion.keys.push_back({grasp.phases[2].end, lifted});
  const double unit_acceleration = grasp.shake.empty() ? 1 : model::shake_acceleration(grasp.shake_cycles);
  const double x = left ? -1 : 1;
  for (std::size_t i = 0; i < grasp.shake.size(); ++i) {
    const ShakeLevel& level = grasp.shake[i];
    const double amplitude = level.acceleration / (unit_acceleration * level.frequency * level.frequency);
    double begin = grasp.phases[4 + i].start;
    for (const Vec3& direction :
         {Vec3(x, 0, 0), Vec3(-x, 0, 0), Vec3(0, 1, 0), Vec3(0, -1, 0), Vec3(0, 0, 1), Vec3(0, 0, -1)}) {
      motion.shakes.push_back({begin, level.frequency, grasp.shake_cycles, amplitude * direction});
      begin += grasp.shake_cycles / level.frequency;
    }
  }
  return motion;
}

/// @param pose of the object above the post.
ObjectSpec make_post(const PostSpec& post, const std::string& name, const ObjectSpec& object,
                     const Pose& pose) {
  ObjectSpec out;
  out.name = name;
  model::Shape cylinder;
  cylinder.kind = model::ShapeKind::cylinder;
  cylinder.radius = post.radius;
  cylinder.length = post.height;
  cylinder.colour = kPostColour;
  out.shapes.push_back(cylinder);
  out.is_static = true;
  out.pose.p = pose * object.body.centre;
  double top = std::numeric_limits<double>::infinity();
  for (const model::Shape& shape : object.shapes) top = std::min(top, lowest(shape, pose));
  out.pose.p.z() = top - post.height / 2;
  out.material = post.material;
  out.material.name = out.name;
  out.place = object.place;
  return out;
}

TaskPlan GraspSpec::plan(const TaskSite& site) const {
  const bool left = site.entry.placement.side == model::Side::left;
  TaskPlan out;
  out.placement = site.entry.placement;
  out.object_pose = left ? mirrored(wrist) * mirrored(at) : wrist * at;
  out.grasp = GraspPlan{site.hand, object, phases, std::nullopt};
  Pose x_WH = wrist;
  if (grip)
    x_WH = fit(site, out);
  else
    out.moves = moves_through_poses(*this, phases[1].start);
  out.placement.motion = wrist_motion(*this, x_WH, left);
  out.placement.pose = out.placement.motion.keys.front().pose;
  if (post) out.support = make_post(*post, *support, site.object, out.object_pose);
  return out;
}

/// The object stays where `wrist` and `at` have it, and the hand comes to it as its size needs.
Pose GraspSpec::fit(const TaskSite& site, TaskPlan& out) const {
  GripPlace lies;
  lies.at = at;
  if (hand_length) lies.at.p *= site.built.size.length / *hand_length;
  lies.on_palm = on_palm;
  lies.from = from;
  if (site.scene.solver.effects.has(model::Effect::gravity))
    lies.weight = wrist.q.conjugate() * (site.object.body.mass * site.scene.gravity);
  double shaken = 0;
  for (const ShakeLevel& level : shake) shaken = std::max(shaken, level.acceleration);
  for (int k = 0; k < 6; ++k)
    lies.loads.push_back(lies.weight + wrist.q.conjugate() * ((k % 2 == 0 ? 1 : -1) * site.object.body.mass *
                                                              shaken * Vec3::Unit(k / 2)));
  FittedGrip fitted = fit_grip(site, *grip, lies, *this);
  out.problems = std::move(fitted.problems);
  out.warnings = std::move(fitted.warnings);
  out.grasp->strength = fitted.strength;
  out.moves = {{0, 0, path + ".open", std::move(fitted.open)},
               {phases[1].start, close_time, path + ".touch", std::move(fitted.touch)},
               {phases[1].start + close_time, grip->squeeze, path + ".press", std::move(fitted.press)}};
  return wrist * at * fitted.x_HO.inverse();
}

}  // namespace

const TaskPhase* GraspPlan::phase(std::string_view name) const {
  for (const TaskPhase& phase : phases)
    if (phase.name == name) return &phase;
  return nullptr;
}

std::unique_ptr<TaskSpec> read_grasp(MapReader& block) {
  auto out = std::make_unique<GraspSpec>();
  GraspSpec& grasp = *out;
  read_task(block, "object", grasp);
  read_at(block.required_map("at", "position and rotation of the object in the hand frame"), grasp);
  if (block.has("grip")) grasp.grip = read_grip(block.map("grip"));
  grasp.post = read_support(block);
  if (grasp.post) grasp.support = grasp.object + "_post";
  MapReader approach = block.map("approach");
  grasp.from = approach.vector("from", kCoordinate, grasp.from);
  add_phase(grasp, "approach", approach.number("time", kSpan, 0.5));
  approach.finish();
  grasp.close_time = block.number("close", kSpan, grasp.close_time);
  const double closing = grasp.grip ? grasp.close_time + grasp.grip->squeeze
                                    : grasp.close_time * static_cast<double>(grasp.closed.size());
  add_phase(grasp, "close", closing + block.number("settle", kSpan, 0.3));
  MapReader lift = block.map("lift");
  grasp.lift_height = lift.number("height", {Dimension::length, 0, 10}, grasp.lift_height);
  add_phase(grasp, "lift", lift.number("time", kSpan, 0.6));
  lift.finish();
  add_phase(grasp, "hold", block.number("hold", kSpan, 5.0));
  if (block.has("shake")) read_shake(block.map("shake"), grasp);
  for (std::size_t i = 0; i < grasp.shake.size(); ++i)
    add_phase(grasp, fmt::format("shake_{}", i + 1), 6 * (grasp.shake_cycles / grasp.shake[i].frequency));
  const double rest = block.number("rest", {Dimension::time, 0, 1e3}, 0.5);
  if (rest > 0) add_phase(grasp, "rest", rest);
  return out;
}

}  // namespace handsim::scene
