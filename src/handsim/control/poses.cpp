#include "handsim/control/poses.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/units.h"

namespace handsim::control {

namespace {

/// Rounding of an angle and a range that are given in degrees [rad].
constexpr double kRangeTolerance = 1e-9;
constexpr int kMaxRepeats = 10'000;
constexpr std::size_t kMostJoints = 200;  ///< of a pose, with those of the poses that it is `like`
/// Largest number of keys of all programs of a file, after repetition.
constexpr std::size_t kMostKeys = 200'000;
const Quantity kTime = {Dimension::time, 0, 1e5};

enum class Unit { rad, deg };

/// Bare numbers are in the file's unit; a text may have a unit of its own.
std::optional<double> read_angle(const YamlNode& node, const std::string& path, Unit unit,
                                 Diagnostics& diagnostics) {
  const Quantity angle = {Dimension::angle, -M_PI, M_PI};
  if (unit == Unit::deg && node.kind == YamlNode::Kind::scalar)
    if (const auto number = parse_number(node.text)) {
      if (std::abs(*number) <= 180) return *number * kDegree;
      diagnostics.problems.push_back({node.place(), path, node.described(), "an angle, -180 to 180 deg"});
      return std::nullopt;
    }
  return read_number(node, path, angle, diagnostics);
}

PoseAngles read_angles(MapReader& pose, const std::string& joint, Unit unit) {
  PoseAngles out;
  const YamlNode* node = pose.value(joint, {{YamlNode::Kind::scalar, YamlNode::Kind::sequence},
                                            "an angle, or a list of one for each axis"});
  if (!node) return out;
  out.place = node->place();
  for (const YamlNode& item :
       node->kind == YamlNode::Kind::sequence ? node->items : SharedList<std::vector<YamlNode>>{*node})
    out.angles.push_back(read_angle(item, pose.path_of(joint), unit, pose.diagnostics()).value_or(0));
  return out;
}

template <class Map>
std::vector<std::string> names_of(const Map& map) {
  std::vector<std::string> out;
  for (const auto& entry : map) out.push_back(entry.first);
  return out;
}

/// `like: fist` starts from an earlier pose of the file; joints named here replace those of that pose.
PoseSpec read_pose(MapReader reader, Unit unit, const PoseFile& before) {
  PoseSpec pose;
  if (const auto like = reader.maybe_text("like")) {
    const auto found = before.poses.find(*like);
    if (found != before.poses.end())
      pose = found->second;
    else
      reader.problem("like", *like, "a pose above this one" + nearest_hint(*like, names_of(before.poses)));
  }
  pose.place = reader.node().place();
  for (const std::string& joint : reader.keys())
    if (joint != "like") pose.joints[joint] = read_angles(reader, joint, unit);
  if (pose.joints.size() > kMostJoints) {
    reader.problem("", fmt::format("{} joints", pose.joints.size()),
                   fmt::format("at most {} joints", kMostJoints));
    pose.joints.clear();
  }
  return pose;
}

void check_order(MapReader& reader, const ProgramKey& key, const std::vector<ProgramKey>& before) {
  if (before.empty()) return;
  const ProgramKey& last = before.back();
  if (!(key.time > last.time))
    reader.problem("time", fmt::format("{:g} s after {:g} s", key.time, last.time), "increasing times");
  else if (key.time < last.time + last.move * (1 - 1e-9))
    reader.problem(
        "time",
        fmt::format("{:g} s, but the previous movement lasts until {:g} s", key.time, last.time + last.move),
        "a time at or after its end, or a shorter move");
}

std::vector<ProgramKey> read_keys(MapReader& program, const std::string& list, double move,
                                  const PoseFile& file) {
  std::vector<ProgramKey> out;
  program.each(list, 1, kMostKeys, [&](MapReader reader) {
    ProgramKey key;
    key.place = reader.node().place();
    key.time = reader.number("time", kTime);
    key.move = reader.number("move", kTime, move);
    key.pose = reader.text("pose");
    if (!key.pose.empty() && !file.poses.contains(key.pose))
      reader.problem("pose", fmt::format("\"{}\", an unknown pose", key.pose),
                     "a pose of the file" + nearest_hint(key.pose, names_of(file.poses)));
    check_order(reader, key, out);
    reader.finish();
    out.push_back(std::move(key));
  });
  return out;
}

std::size_t key_count(const ProgramSpec& program) {
  std::size_t count = program.keys.size();
  for (const auto& [hand, keys] : program.hands) count += keys.size();
  return count;
}

void repeat(std::vector<ProgramKey>& keys, int times, double every) {
  const std::vector<ProgramKey> once = keys;
  for (int n = 1; n < times; ++n)
    for (ProgramKey key : once) {
      key.time += n * every;
      keys.push_back(std::move(key));
    }
}

/// @param room number of keys still allowed, those of this program included.
void read_repeat(MapReader reader, ProgramSpec& program, std::size_t room) {
  const int times = reader.integer("times", 1, kMaxRepeats, 1);
  const double every = reader.number("every", kTime);
  if (key_count(program) * static_cast<std::size_t>(times) > room) {
    reader.problem("times", fmt::format("{} times {} keys", times, key_count(program)),
                   fmt::format("at most {} keys in all programs of a file", kMostKeys));
    return reader.finish();
  }
  const auto apply = [&](std::vector<ProgramKey>& keys) {
    if (keys.empty()) return;
    const double length = keys.back().time + keys.back().move - keys.front().time;
    if (every < length || every <= keys.back().time - keys.front().time)
      return reader.problem("every", fmt::format("{:g} s", every),
                            fmt::format("at least the program's {:g} s", length));
    repeat(keys, times, every);
  };
  apply(program.keys);
  for (auto& [hand, keys] : program.hands) apply(keys);
  reader.finish();
}

ProgramSpec read_program(MapReader reader, const PoseFile& file) {
  ProgramSpec program;
  program.place = reader.node().place();
  program.interpolation = reader.choice<model::Interpolation>(
      "interpolation",
      {{"minimum_jerk", model::Interpolation::minimum_jerk}, {"linear", model::Interpolation::linear}},
      model::Interpolation::minimum_jerk);
  const double move = reader.number("move", kTime, 0.4);
  if (reader.has("keys") == reader.has("hands"))
    reader.problem("keys", reader.has("keys") ? "keys and hands" : "neither keys nor hands",
                   "keys for every hand, or hands, each with its keys");
  if (reader.has("keys")) program.keys = read_keys(reader, "keys", move, file);
  if (reader.has("hands")) {
    MapReader hands = reader.map("hands");
    for (const std::string& hand : hands.keys()) program.hands[hand] = read_keys(hands, hand, move, file);
  }
  std::size_t taken = 0;
  for (const auto& [name, other] : file.programs) taken += key_count(other);
  const std::size_t room = kMostKeys - std::min(taken, kMostKeys);
  if (key_count(program) > room)
    reader.problem("keys", fmt::format("{} keys", taken + key_count(program)),
                   fmt::format("at most {} keys in all programs of a file", kMostKeys));
  if (reader.has("repeat")) read_repeat(reader.map("repeat"), program, room);
  reader.finish();
  return program;
}

void check_range(const std::string& pose, const HandAxis& axis, double angle, const Place& place,
                 Diagnostics& diagnostics) {
  if (!axis.stop || axis.stop->stiff ||
      (angle >= axis.stop->low - kRangeTolerance && angle <= axis.stop->high + kRangeTolerance))
    return;
  diagnostics.problems.push_back({place, fmt::format("poses.{}.{}", pose, axis.joint),
                                  fmt::format("{:.4g} deg for {}", angle / kDegree, axis.name()),
                                  fmt::format("an angle in its range, {:.4g} to {:.4g} deg",
                                              axis.stop->low / kDegree, axis.stop->high / kDegree)});
}

/// A joint that the hand does not have is left out, with a warning; a misspelt one is a problem.
void report_absent(const PoseSpec& pose, const std::string& joint, const Place& place, const std::string& key,
                   const HandAxes& hand, Diagnostics& diagnostics) {
  const std::vector<std::string> known = hand.joints();
  if (is_misspelt(joint, known, names_of(pose.joints)))
    return diagnostics.problems.push_back({place, key, "a joint that the hand does not have",
                                           "a joint of its hand model" + nearest_hint(joint, known)});
  std::vector<std::string>& told = diagnostics.warnings;
  std::string text =
      fmt::format("{}: poses: hand {} has no joint {}: left out", place.file, hand.hand, joint);
  if (std::ranges::find(told, text) == told.end()) told.push_back(std::move(text));
}

}  // namespace

const std::vector<ProgramKey>* ProgramSpec::keys_for(const std::string& hand) const {
  if (!keys.empty()) return &keys;
  const auto found = hands.find(hand);
  return found == hands.end() ? nullptr : &found->second;
}

PoseFile read_pose_file(const YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  PoseFile file;
  MapReader reader(node, path, diagnostics);
  reader.text("title", "untitled");
  const Unit unit = reader.choice<Unit>("unit", {{"rad", Unit::rad}, {"deg", Unit::deg}}, Unit::rad);
  reader.named_texts("sources");
  MapReader poses = reader.required_map("poses", "a mapping of names to poses");
  for (const std::string& name : poses.keys()) file.poses[name] = read_pose(poses.map(name), unit, file);
  if (reader.has("programs")) {
    MapReader programs = reader.map("programs");
    for (const auto& name : programs.keys()) file.programs[name] = read_program(programs.map(name), file);
  }
  reader.finish();
  return file;
}

std::vector<double> pose_angles(const std::string& name, const PoseSpec& pose, const HandAxes& hand,
                                Diagnostics& diagnostics) {
  std::vector<double> out(hand.axes.size(), 0.0);
  for (const auto& [joint, given] : pose.joints) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < hand.axes.size(); ++i) {
      const HandAxis& axis = hand.axes[i];
      if (axis.joint != joint) continue;
      ++count;
      if (axis.axis_index >= given.angles.size()) continue;
      out[i] = given.angles[axis.axis_index];
      if (!pose.pressing) check_range(name, axis, out[i], given.place, diagnostics);
    }
    const std::string key = fmt::format("poses.{}.{}", name, joint);
    if (count == 0 && !hand.accepts(joint))
      report_absent(pose, joint, given.place, key, hand, diagnostics);
    else if (count == 0)
      diagnostics.warnings.push_back(fmt::format("{}{}: hand {} is mounted without this joint: not driven",
                                                 given.place.text(), key, hand.hand));
    else if (given.angles.size() > count)
      diagnostics.problems.push_back(
          {given.place, key, fmt::format("{} angles", given.angles.size()),
           fmt::format("at most {}: {}.{} has no more axes", count, hand.hand, joint)});
  }
  return out;
}

Trajectory program_trajectory(const ProgramSpec& program, const std::vector<ProgramKey>& keys,
                              const PoseFile& file, const HandAxes& hand, std::span<const double> start,
                              Diagnostics& diagnostics) {
  Trajectory out(hand.axes.size(), program.interpolation);
  std::map<std::string, std::vector<double>> angles;
  std::vector<double> held(start.begin(), start.end());
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const ProgramKey& key = keys[i];
    const auto pose = file.poses.find(key.pose);
    if (pose == file.poses.end()) continue;  // reported when the file was read
    if (!angles.contains(key.pose)) angles[key.pose] = pose_angles(key.pose, pose->second, hand, diagnostics);
    out.add(key.time, held);
    held = angles[key.pose];
    out.add(key.time + key.move, held);
    const double end = i + 1 < keys.size() ? keys[i + 1].time : std::numeric_limits<double>::infinity();
    out.add_phase({key.pose, key.time, key.time + key.move, end});
  }
  return out;
}

}  // namespace handsim::control
