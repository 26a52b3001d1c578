#include "handsim/hand/grip_strength.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace handsim::hand {

namespace {

/// The middle of the youngest adults' ages, 17 to 19 [years].
constexpr double kGrown = 18.5;

GripNorm read_norm(MapReader reader) {
  GripNorm norm;
  norm.sex = reader.choice<Sex>("sex", {{"male", Sex::male}, {"female", Sex::female}});
  const auto range = [&](const char* key, const Quantity& quantity) {
    return reader.maybe_range(key, quantity, true).value_or(std::pair(0.0, 1.0));
  };
  norm.age = range("age", {Dimension::none, 0, 150});
  norm.stature = range("stature", {Dimension::length, 0.3, 3});
  norm.mean = reader.number("mean", {Dimension::force, 1, 5000});
  norm.deviation = reader.number("deviation", {Dimension::force, 0, 5000});
  reader.finish();
  return norm;
}

double distance_outside(const std::pair<double, double>& range, double value) {
  return std::max({0.0, range.first - value, value - range.second});
}

/// The row of this sex that is nearest in age, then in stature.
const GripNorm& nearest(const GripTable& table, Sex sex, double age, double stature) {
  const GripNorm* best = nullptr;
  std::pair<double, double> least;
  for (const GripNorm& norm : table.norms) {
    if (norm.sex != sex) continue;
    // Ages are completed years; a stature on a boundary belongs to the taller group.
    const double years = distance_outside({norm.age.first, norm.age.second + 1 - 1e-9}, age);
    const double metres = distance_outside({norm.stature.first, norm.stature.second - 1e-9}, stature);
    const std::pair<double, double> off = {years, metres};
    if (best && off >= least) continue;
    best = &norm;
    least = off;
  }
  return *best;
}

/// Mean and standard deviation of a row [N], for shorter people by the areas of their muscles.
std::array<double, 2> strength_in(const GripNorm& norm, double stature) {
  const double shortness = std::min(1.0, stature / norm.stature.first), area = shortness * shortness;
  return {area * norm.mean, area * norm.deviation};
}

double middle_age(const GripNorm& norm) { return (norm.age.first + norm.age.second + 1) / 2; }

/// Of one sex. Children grow within a group of ages: up to the middle of the youngest adults a norm is linear
/// in age between the middles of its groups.
std::array<double, 2> norm_at(const GripTable& table, Sex sex, double age, double stature) {
  std::array<double, 2> out = strength_in(nearest(table, sex, age, stature), stature);
  const GripNorm *below = nullptr, *above = nullptr;
  for (const GripNorm& each : table.norms) {
    const double middle = middle_age(each);
    if (each.sex != sex || middle > kGrown) continue;
    if (middle <= age && (!below || middle > middle_age(*below))) below = &each;
    if (middle > age && (!above || middle < middle_age(*above))) above = &each;
  }
  if (!below || !above) return out;
  const double first = middle_age(*below), last = middle_age(*above), share = (age - first) / (last - first);
  // At a middle several rows are told apart by stature.
  const auto from = strength_in(nearest(table, sex, first, stature), stature);
  const auto to = strength_in(nearest(table, sex, last, stature), stature);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = (1 - share) * from[i] + share * to[i];
  return out;
}

}  // namespace

GripTable read_grip_table(const YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  MapReader reader(node, path, diagnostics);
  GripTable table;
  reader.text("title", "untitled");
  reader.text("source");
  bool has[2] = {false, false};
  reader.each("norms", 1, kMostItems, [&](MapReader row) {
    table.norms.push_back(read_norm(std::move(row)));
    has[table.norms.back().sex == Sex::male ? 0 : 1] = true;
  });
  if (reader.sound() && !(has[0] && has[1]))
    reader.problem("norms", "rows of one sex", "rows of men and of women");
  reader.finish();
  return table;
}

GripStrength grip_strength(const GripTable& table, const Person& person) {
  const double age = person.age.value_or(kDefaultAge);
  GripStrength out;
  double rows = 0, variance = 0;
  for (const Sex sex : {Sex::male, Sex::female}) {
    if (person.sex != Sex::unknown && person.sex != sex) continue;
    const GripNorm& norm = nearest(table, sex, age, person.stature);
    const auto [mean, deviation] = norm_at(table, sex, age, person.stature);
    out.norm += mean;
    variance += deviation * deviation;
    out.extrapolated = out.extrapolated || distance_outside({norm.age.first, norm.age.second + 1}, age) > 0 ||
                       distance_outside(norm.stature, person.stature) > 0;
    ++rows;
  }
  out.norm /= rows;
  out.deviation = std::sqrt(variance / rows);
  out.measured = person.grip_strength.has_value();
  out.own = person.grip_strength.value_or(
      std::max(0.1 * out.norm, out.norm + out.deviation * person.deviation("grip_strength")));
  return out;
}

}  // namespace handsim::hand
