#include "handsim/study/track/bones.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/study/report.h"
#include "handsim/study/track/hand_tree.h"

namespace handsim::study {

namespace {

/// A distance that does not depend on the joint angles.
struct Distance {
  std::size_t a = 0, b = 0;            ///< keypoints
  std::optional<std::size_t> segment;  ///< the bone between them; absent: both on the palm
  double measured = 0;                 ///< [m]
  double weight = 0;                   ///< number of frames
};

/// Pairs of keypoints on the palm, and the ends of every bone.
std::vector<Distance> distances_of(const std::vector<Feature>& points, const hand::HandSpec& spec) {
  std::vector<Distance> out;
  // A keypoint is the base of its own segment; it lies on the palm if that segment starts there.
  const auto on_palm = [&](const Feature& point) {
    return !point.segment || (point.at.isZero() && !spec.segments[*point.segment].parent);
  };
  for (std::size_t a = 0; a < points.size(); ++a)
    for (std::size_t b = a + 1; b < points.size(); ++b)
      if (on_palm(points[a]) && on_palm(points[b])) out.push_back({a, b, std::nullopt});
  for (std::size_t a = 1; a + 1 < points.size(); ++a)
    if (points[a].at.isZero()) out.push_back({a, a + 1, points[a].segment});
  return out;
}

/// Lengths of a distance in all frames that show it, of both hands.
std::vector<double> lengths_of(const Recording& recording, const std::vector<Feature>& points,
                               const Distance& distance) {
  std::vector<double> out;
  for (const char* side : {"right", "left"}) {
    const auto a = recording.channels.find(std::string(side) + "." + points[distance.a].name);
    const auto b = recording.channels.find(std::string(side) + "." + points[distance.b].name);
    if (a == recording.channels.end() || b == recording.channels.end()) continue;
    for (std::size_t i = 0; i < a->second.points.frames().size(); ++i)
      if (const Vec3* other = b->second.points.at(a->second.points.frames()[i]))
        out.push_back((a->second.points.values()[i] - *other).norm());
  }
  return out;
}

/// Mean of a distance without outliers and without the part of the noise: E d^2 = L^2 + 6 s^2, var d = 2 s^2.
void measure(const Recording& recording, const std::vector<Feature>& points, Distance& distance) {
  constexpr double kDeviations = 4, kOfMedian = 1.4826, kRounding = 1e-9;
  std::vector<double> lengths = lengths_of(recording, points, distance);
  if (lengths.size() < 3) return;
  const double middle = median(lengths);
  std::vector<double> off;
  for (const double length : lengths) off.push_back(std::abs(length - middle));
  const double most = kDeviations * kOfMedian * median(off) + kRounding;
  std::erase_if(lengths, [&](double length) { return std::abs(length - middle) > most; });
  double sum = 0, squares = 0;
  for (const double length : lengths) sum += length;
  distance.weight = static_cast<double>(lengths.size());
  const double mean = sum / distance.weight;
  for (const double length : lengths) squares += (length - mean) * (length - mean);
  distance.measured = std::sqrt(std::max(0.0, mean * mean - 2 * squares / distance.weight));
}

/// The longest distance on the palm is 5 to 15 cm: others are in another unit.
void check_unit(const std::vector<Distance>& distances, const std::string& file) {
  double longest = 0;
  for (const Distance& each : distances)
    if (!each.segment) longest = std::max(longest, each.measured);
  if (longest < 0.02 || longest > 0.3)
    throw input_error(
        file, fmt::format("a palm of {:.3g} m", longest),
        "one of 0.02 to 0.3 m: the unit stands behind a column's name, [m] or [mm], in .json as \"unit\"");
}

/// Distances of the hand that is built with these dimensions, at zero angles.
std::vector<double> built(const hand::HandSpec& spec, hand::Person person, double length, double breadth,
                          const std::vector<Distance>& distances) {
  person.hand_length = length;
  person.hand_breadth = breadth;
  person.hand_length_percentile.reset();
  const hand::BuiltHand hand = hand::build_hand(spec, person);
  HandTree tree(spec, hand, model::Side::right);
  tree.place(std::vector<double>(tree.axes().size(), 0.0));
  const std::vector<Feature> points = keypoints(spec, hand);
  std::vector<double> out;
  for (const Distance& each : distances)
    out.push_back((tree.point(points[each.a]) - tree.point(points[each.b])).norm());
  return out;
}

}  // namespace

hand::Person fit_bones(const Recording& recording, const hand::HandSpec& spec, const hand::Person& person) {
  hand::Person out = person;
  out.bones.clear();
  const std::vector<Feature> points = keypoints(spec, hand::build_hand(spec, out));
  std::vector<Distance> distances = distances_of(points, spec);
  for (Distance& each : distances) measure(recording, points, each);
  std::erase_if(distances, [](const Distance& each) { return each.weight < 3; });
  if (std::ranges::none_of(distances, [](const Distance& each) { return !each.segment; }))
    throw input_error(recording.file, "no three frames that show the palm",
                      "keypoints of the palm, or --keep-person");
  check_unit(distances, recording.file);
  // The palm gives both dimensions, then bones their lengths. Nearly linear: Gauss-Newton from predictions.
  const hand::HandSize predicted = hand::hand_size(spec.anthropometry, person);
  Eigen::Vector2d size(predicted.length, predicted.breadth);
  for (int round = 0; round < 20; ++round) {
    constexpr double kStep = 1e-5;
    const std::vector<double> at = built(spec, out, size[0], size[1], distances);
    const std::vector<double> longer = built(spec, out, size[0] + kStep, size[1], distances);
    const std::vector<double> broader = built(spec, out, size[0], size[1] + kStep, distances);
    Eigen::Matrix2d matrix = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < distances.size(); ++i) {
      if (distances[i].segment) continue;
      const Eigen::Vector2d row((longer[i] - at[i]) / kStep, (broader[i] - at[i]) / kStep);
      matrix += distances[i].weight * row * row.transpose();
      right += distances[i].weight * (distances[i].measured - at[i]) * row;
    }
    const Eigen::Vector2d step = matrix.inverse() * right;
    size += step;
    if (step.norm() < 1e-13) break;
  }
  out.hand_length = size[0];
  out.hand_breadth = size[1];
  out.hand_length_percentile.reset();
  out.title =
      person.title + ", hand measured from " + std::filesystem::path(recording.file).filename().string();
  for (const Distance& each : distances)
    if (each.segment) out.bones[spec.segments[*each.segment].name] = each.measured;
  return out;
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
