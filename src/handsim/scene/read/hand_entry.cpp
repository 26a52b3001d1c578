#include "handsim/scene/read/hand_entry.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include <fmt/format.h>

#include "handsim/control/pose_table.h"
#include "handsim/core/data_folder.h"
#include "handsim/core/input_file.h"
#include "handsim/hand/doubts.h"
#include "handsim/hand/what_if.h"
#include "handsim/model/effects.h"
#include "handsim/scene/read/blocks.h"

namespace handsim::scene {

namespace {

const Quantity kKeyTime = {Dimension::time, 0, 1e6};
/// About a thousand bodies, the most that the engines can step in reasonable time.
constexpr std::size_t kMostHands = 60;
constexpr std::size_t kMostKeyframes = 100'000;

/// @param last time of the previous keyframe, if known; set to this one's.
model::PoseKey read_keyframe(MapReader reader, std::optional<double>& last) {
  model::PoseKey out;
  out.time = reader.number("time", kKeyTime);
  const bool known = reader.has("time") && reader.sound();
  if (known && last && out.time <= *last)
    reader.problem("time", fmt::format("{:g} s after {:g} s", out.time, *last), "increasing times");
  if (known) last = out.time;
  out.pose = read_pose(reader);
  reader.finish();
  return out;
}

/// The wrist's poses from a table.
model::PoseMotion read_table(MapReader& reader, const std::string& hand) {
  model::PoseMotion motion;
  const YamlNode* node = reader.value("table", {{YamlNode::Kind::scalar}, "a .csv, .mot or .sto file"});
  if (!node) return motion;
  const std::filesystem::path path = reader.file_path("table", *node);
  const std::optional<double> filter = reader.maybe_number("filter", {Dimension::frequency, 0.01, 1e4});
  // A schema is made without the files that a scene names.
  if (reader.diagnostics().recorder) return motion;
  try {
    motion = control::read_pose_table(path, hand, filter);
  } catch (const Error& error) {
    reader.diagnostics().add(error);
  }
  return motion;
}

/// @param hand name of the hand in the columns of a table.
model::PoseMotion read_motion(MapReader reader, const std::string& hand) {
  model::PoseMotion motion;
  if (reader.has("table")) {
    motion = read_table(reader, hand);
    if (reader.has("keyframes")) reader.problem("keyframes", "keyframes beside a table", "one of the two");
    reader.has("interpolation");
    reader.finish();
    if (motion.keys.empty()) motion.keys.emplace_back();
    return motion;
  }
  motion.interpolation = reader.choice<model::Interpolation>(
      "interpolation",
      {{"minimum_jerk", model::Interpolation::minimum_jerk}, {"linear", model::Interpolation::linear}},
      model::Interpolation::minimum_jerk);
  std::optional<double> last;
  reader.each("keyframes", 1, kMostKeyframes,
              [&](MapReader key) { motion.keys.push_back(read_keyframe(std::move(key), last)); });
  reader.finish();
  if (motion.keys.empty()) motion.keys.emplace_back();
  return motion;
}

void refuse_keys_of_other_mounts(MapReader& reader, hand::Mount mount) {
  const auto refuse = [&](const char* key, hand::Mount of, const char* need) {
    if (of != mount && reader.has(key)) reader.problem(key, "a key of another mount", need);
  };
  refuse("motion", hand::Mount::driven, "mount: driven with it, or no motion");
  refuse("velocity", hand::Mount::free, "mount: free with it, or no velocity");
  refuse("angular_velocity", hand::Mount::free, "mount: free with it, or no angular_velocity");
  refuse("along", hand::Mount::rail, "mount: rail with it, or no along");
}

void read_wrist(MapReader reader, const Tasks& tasks, const std::string& hand, hand::Placement& placement) {
  placement.mount = reader.choice<hand::Mount>("mount",
                                               {{"fixed", hand::Mount::fixed},
                                                {"hinge", hand::Mount::hinge},
                                                {"universal", hand::Mount::universal},
                                                {"free", hand::Mount::free},
                                                {"driven", hand::Mount::driven},
                                                {"rail", hand::Mount::rail}},
                                               hand::Mount::fixed);
  // The mount decides which other keys are allowed.
  if (!reader.sound()) return;
  const bool placed =
      std::ranges::any_of(tasks, [&](const auto& task) { return task->kind->mount == placement.mount; });
  if (placement.mount == hand::Mount::driven && (!placed || reader.has("motion"))) {
    placement.motion =
        read_motion(reader.required_map("motion", "a mapping with keyframes or a table"), hand);
    placement.pose = placement.motion.keys.front().pose;
  } else if (!placed) {
    placement.pose = read_pose(reader, Vec3::Zero());
  }
  if (placement.mount == hand::Mount::free) {
    placement.velocity = reader.vector("velocity", kVelocity, Vec3::Zero());
    placement.angular_velocity = reader.vector("angular_velocity", kAngularVelocity, Vec3::Zero());
  }
  if (placement.mount == hand::Mount::rail && reader.has("along"))
    placement.rail_direction = reader.direction("along");
  refuse_keys_of_other_mounts(reader, placement.mount);
  reader.finish();
}

/// @param axes number of the joint's axes that the hand has.
void read_joint_angles(MapReader& pose, const hand::JointSpec& joint, std::size_t axes, const YamlNode& value,
                       std::vector<double>& out) {
  const std::string& name = joint.name;
  const bool list = value.kind == YamlNode::Kind::sequence;
  const std::size_t count = list ? value.items.size() : 1;
  if (count < 1 || count > axes)
    return pose.problem(name, value.described(), axes == 1 ? "one angle" : "one or two angles");
  for (std::size_t i = 0; i < count; ++i) {
    const YamlNode& item = list ? value.items[i] : value;
    const std::string path = list ? item_path(pose.path_of(name), i) : pose.path_of(name);
    const auto angle = read_number(item, path, {Dimension::angle, -M_PI, M_PI}, pose.diagnostics());
    out.push_back(angle.value_or(0));
    const auto& stop = joint.axes[i].stop;
    if (angle && stop && (*angle < stop->low || *angle > stop->high))
      pose.warning(name, fmt::format("{} starts at {:.4g} rad, outside its range of {:.4g} to {:.4g} rad",
                                     joint.axes[i].name, *angle, stop->low, stop->high));
  }
}

/// @param known false if hand model or wrist could not be read: any joint is then accepted.
void read_start_pose(MapReader& reader, HandEntry& entry, bool known) {
  if (!reader.has("pose")) return;
  MapReader pose = reader.map("pose");
  const hand::JointSpec& wrist = entry.model->wrist;
  std::map<std::string, const hand::JointSpec*> joints = {{wrist.name, &wrist}};
  const hand::JointSpec* forearm = entry.model->forearm ? &entry.model->forearm->joint : nullptr;
  if (forearm) joints[forearm->name] = forearm;
  for (const hand::SegmentSpec& segment : entry.model->segments) joints[segment.joint.name] = &segment.joint;
  std::vector<std::string> names;
  for (const auto& [joint, spec] : joints) names.push_back(joint);
  for (const std::string& name : pose.keys()) {
    const YamlNode* value = pose.value(
        name, {{YamlNode::Kind::scalar, YamlNode::Kind::sequence}, "an angle, or one for each axis"});
    const auto found = joints.find(name);
    if (!known || !value || found == joints.end()) continue;
    const hand::JointSpec& joint = *found->second;
    if ((&joint == &wrist || &joint == forearm) && !entry.has_wrist_joint()) {
      pose.problem(name, "an angle of a wrist that has no joint", "wrist.mount hinge or universal with it");
    } else {
      const bool one = &joint == &wrist && entry.placement.mount == hand::Mount::hinge;
      read_joint_angles(pose, joint, one ? 1 : joint.axes.size(), *value, entry.placement.start[name]);
    }
  }
  for (const YamlEntry& given : pose.node().entries)
    if (known && !joints.contains(given.key)) pose.unknown_key(given, "an unknown key", names);
}

void check_mount(MapReader& reader, const HandEntry& entry) {
  if (entry.placement.mount == hand::Mount::universal && entry.model->wrist.axes.size() < 2)
    reader.map("wrist").problem("mount", "universal with a hand model whose wrist has one axis",
                                "hinge, or a hand model whose wrist has two axes");
}

/// `right`, `left`, or with the number of this hand of a side.
struct HandNames {
  int count[2] = {0, 0};
  std::string next(model::Side side) {
    const bool right = side == model::Side::right;
    const int n = ++count[right ? 0 : 1];
    return (right ? "right" : "left") + (n > 1 ? std::to_string(n) : std::string());
  }
};

/// True if hands need their muscles: the scene lists an effect of theirs, or has climbs, which tell tensions.
bool needs_muscles(const YamlNode& scene) {
  if (scene.find("climbs")) return true;
  const YamlNode* effects = scene.find("effects");
  return effects && std::ranges::any_of(effects->items, [](const YamlNode& item) {
           return item.text == model::name(model::Effect::muscles) ||
                  item.text == model::name(model::Effect::tendon_coupling);
         });
}

HandEntry read_hand(MapReader reader, const Tasks& tasks, HandNames& names, bool with_muscles) {
  HandEntry entry;
  entry.place = reader.node().place();
  Diagnostics& diagnostics = reader.diagnostics();
  if (const YamlNode* node = referenced(reader, "model", FileKind::hand_model, false,
                                        (data_folder() / "handmodels/anatomical.yaml").string())) {
    // A scene without muscles does not pay for reading them.
    YamlNode model = *node;
    if (!with_muscles) model.entries.remove_if([](const YamlEntry& each) { return each.key == "muscles"; });
    entry.model = hand::shared_hand_spec(reader.resolve("model", std::move(model)), reader.path_of("model"),
                                         diagnostics);
  } else {
    entry.model = std::make_shared<const hand::HandSpec>();
  }
  const bool model_known = reader.sound();
  if (auto changed = hand::read_what_if(reader, *entry.model))
    entry.model = std::make_shared<const hand::HandSpec>(std::move(*changed));
  if (const YamlNode* node = referenced(reader, "person", FileKind::person))
    entry.person = hand::read_person(*node, reader.path_of("person"), diagnostics);

  const bool person_known = reader.sound();
  entry.placement.side =
      reader.choice<model::Side>("side", {{"right", model::Side::right}, {"left", model::Side::left}});
  const std::size_t before_wrist = diagnostics.problems.size();
  entry.placement.name = names.next(entry.placement.side);
  read_wrist(reader.map("wrist"), tasks, entry.placement.name, entry.placement);
  const bool wrist_known = diagnostics.problems.size() == before_wrist;
  if (model_known && wrist_known) check_mount(reader, entry);
  read_start_pose(reader, entry, model_known && wrist_known);
  MapReader tissue = reader.map("tissue");
  entry.placement.tissue_stiffness = tissue.number("stiffness", {Dimension::none, 0, 1000}, 1.0);
  entry.placement.tissue_damping = tissue.number("damping", {Dimension::none, 0, 1000}, 1.0);
  tissue.finish();
  entry.placement.tendon_strain = reader.maybe_number(
      "tendon_strain", {Dimension::none, model::kLeastTendonStrain, model::kMostTendonStrain});
  entry.placement.short_range = reader.maybe_number(
      "short_range_stiffness", {Dimension::none, model::kLeastShortRange, model::kMostShortRange});
  reader.finish();
  if (person_known)
    for (const std::string& text : hand::doubts(*entry.model, entry.person)) reader.warning("person", text);
  return entry;
}

}  // namespace

std::vector<HandEntry> read_hands(MapReader& reader, const Tasks& tasks) {
  std::vector<HandEntry> hands;
  HandNames names;
  const bool with_muscles = needs_muscles(reader.node());
  reader.each("hands", 0, kMostHands, [&](MapReader block) {
    hands.push_back(read_hand(std::move(block), tasks, names, with_muscles));
  });
  return hands;
}

}  // namespace handsim::scene
