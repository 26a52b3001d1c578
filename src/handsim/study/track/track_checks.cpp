#include "handsim/study/track/track_checks.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/text.h"
#include "handsim/engine/collision/overlap.h"
#include "handsim/engine/collision/segments.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/spline.h"

namespace handsim::study {

namespace {

/// The capsules of a hand in its pose, in the world.
std::vector<HandTree::Capsule> placed(HandTree& tree, const HandPose& pose, const std::string& name) {
  tree.place(pose.angles);
  std::vector<HandTree::Capsule> out = tree.capsules();
  for (HandTree::Capsule& each : out) {
    each.name = name + each.name.substr(each.name.find('.'));
    each.at = pose.wrist * each.at;
    each.along = pose.wrist.q * each.along;
  }
  return out;
}

struct Deepest {
  double depth = 0;           ///< [m]
  Vec3 apart = Vec3::Zero();  ///< unit, from the first hand to the second
  std::size_t a = 0, b = 0;
};

/// @param shift of the second hand against the first [m]
Deepest deepest(const std::vector<HandTree::Capsule>& first, const std::vector<HandTree::Capsule>& second,
                const Vec3& shift) {
  Deepest out;
  for (std::size_t i = 0; i < first.size(); ++i)
    for (std::size_t j = 0; j < second.size(); ++j) {
      const HandTree::Capsule &a = first[i], &b = second[j];
      const Vec3 at = b.at + shift;
      const auto [s, t] = engine::nearest_of_segments(a.at, a.along, at, b.along);
      const Vec3 apart = at + t * b.along - a.at - s * a.along;
      const double distance = apart.norm(), depth = a.radius + b.radius - distance;
      if (depth > out.depth && distance > 1e-9) out = {depth, apart / distance, i, j};
    }
  return out;
}

}  // namespace

const char* side_name(model::Side side) { return side == model::Side::right ? "right" : "left"; }

std::vector<std::string> recording_warnings(const TrackInput& input, const Recording& recording) {
  constexpr double kLongestInterval = 0.5;
  constexpr std::size_t kMostNamed = 5;
  std::vector<std::string> known, out;
  for (const model::Side side : {model::Side::right, model::Side::left})
    if (input.markers && !input.markers->is_convention()) {
      for (const Feature& feature : features_of(*input.markers, input.model, side))
        known.push_back(feature.name);
    } else {
      const RecordingFormat format = input.markers ? *input.markers->format : RecordingFormat{};
      for (const std::string& name : format.names.empty() ? keypoint_names() : format.names)
        known.push_back(fmt::format("{}.{}", side_name(side), name));
    }
  std::size_t unused = 0;
  std::string names, things;
  for (const auto& [name, channel] : recording.channels) {
    if (std::ranges::find(known, name) != known.end()) continue;
    const std::string hint = nearest_hint(name, known);
    if (++unused <= kMostNamed) names += (unused > 1 ? ", " : "") + name + hint;
    if (hint.empty() && things.empty()) things = name;
  }
  if (unused > kMostNamed) names += ", ...";
  if (unused == recording.channels.size())
    throw input_error(recording.file, "no point of a hand, but " + names,
                      input.markers && !input.markers->is_convention()
                          ? "the names of --markers"
                          : "keypoints such as right.wrist or left.0, or --markers with these names");
  if (unused > 0)
    out.push_back(fmt::format("{}: {} names that no hand uses: {}", recording.file, unused, names));
  if (!things.empty())
    out.push_back(fmt::format(
        "{}: if {} is on an object in the hand, TORQUES AND ACTIVATIONS OF THIS MOTION ARE THOSE OF "
        "AN EMPTY HAND: handsim inverse --loads adds the forces on it",
        recording.file, things));
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

void shift_times(TrackResult& result, const std::string& recording) {
  constexpr double kLongestWait = 0.5;
  std::size_t first = result.times.size();
  for (const TrackedHand& hand : result.hands)
    first =
        std::min(first, as_index(std::ranges::find(hand.frames, FrameStatus::tracked, &TrackedFrame::status) -
                                 hand.frames.begin()));
  const double begin = result.times[first < result.times.size() ? first : 0];
  if (begin >= 0 && begin <= kLongestWait && result.times.back() <= kLongestRecording) return;
  result.start = begin;
  for (double& time : result.times) time -= result.start;
  result.warnings.push_back(fmt::format(
      "{}: a hand is first seen at {:.12g} s, which is 0 in all that is written", recording, result.start));
}

void collect_overlaps(const hand::BuiltHand& hand, const std::vector<double>& times, TrackedHand& tracked) {
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
      OverlapFigures::Pair& pair = out.pairs[model.shapes[as_index(each.shape_a)].name + " and " +
                                             model.shapes[as_index(each.shape_b)].name];
      if (each.depth > pair.depth) pair = {each.depth, times[good[i]]};
    }
    ++out.tested;
    if (overlaps) ++out.frames;
  }
}

void part_hands(const hand::HandSpec& spec, const hand::BuiltHand& hand, TrackResult& result) {
  constexpr int kMostMoves = 50;
  constexpr double kReach = 0.5;  // wrists farther apart than this have no hands that touch [m]
  if (result.hands.size() < 2) return;
  TrackedHand &first = result.hands[0], &second = result.hands[1];
  HandTree tree_a(spec, hand, first.side), tree_b(spec, hand, second.side);
  for (std::size_t k = 0; k < result.times.size(); ++k) {
    TrackedFrame &a = first.frames[k], &b = second.frames[k];
    if (a.status != FrameStatus::tracked || b.status != FrameStatus::tracked ||
        (a.pose.wrist.p - b.pose.wrist.p).norm() > kReach)
      continue;
    const std::vector<HandTree::Capsule> of_a = placed(tree_a, a.pose, first.name),
                                         of_b = placed(tree_b, b.pose, second.name);
    Vec3 shift = Vec3::Zero();
    for (int move = 0; move < kMostMoves; ++move) {
      const Deepest found = deepest(of_a, of_b, shift);
      if (found.depth <= kGive) break;
      if (move == 0) ++result.between.frames;
      if (move == 0 && found.depth > result.between.depth) {
        result.between.depth = found.depth;
        result.between.time = result.times[k];
        result.between.where = of_a[found.a].name + " and " + of_b[found.b].name;
      }
      shift += (found.depth - 0.9 * kGive) * found.apart;
    }
    a.pose.wrist.p -= 0.5 * shift;
    b.pose.wrist.p += 0.5 * shift;
    result.between.moved = std::max(result.between.moved, 0.5 * shift.norm());
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
      const double error = tracked.frames[k].pose.angles[i] - row[as_index(column - table.names.begin())];
      squares += error * error;
      count += 1;
    }
    tracked.truth.push_back({tracked.axes[i], count > 0 ? std::sqrt(squares / count) : 0});
  }
  if (tracked.truth.empty())
    throw input_error(table.file, "no column of hand " + tracked.name,
                      "columns " + tracked.name + ".JOINT.AXIS");
}

std::string person_text(const hand::Person& person) {
  std::string out = "title: ";
  for (const char c : person.title) out += c == ':' || c == '#' || c == '"' || c == '\n' ? ' ' : c;
  out +=
      fmt::format("\nstature: {}\nmass: {}\nsex: {}\n", person.stature, person.mass, hand::name(person.sex));
  const auto add = [&](const char* key, const std::optional<double>& value) {
    if (value) out += fmt::format("{}: {}\n", key, *value);
  };
  add("hand_length", person.hand_length);
  add("hand_breadth", person.hand_breadth);
  add("hand_circumference", person.hand_circumference);
  add("hand_mass", person.hand_mass);
  add("grip_strength", person.grip_strength);
  add("age", person.age);
  const auto add_all = [&](const char* key, const std::map<std::string, double>& values) {
    for (const auto& [name, value] : values) {
      if (name == values.begin()->first) out += fmt::format("{}:\n", key);
      out += fmt::format("  {}: {}\n", name, value);
    }
  };
  add_all("bones", person.bones);
  add_all("radii", person.radii);
  add_all("fingers", person.fingers);
  return out;
}

}  // namespace handsim::study
