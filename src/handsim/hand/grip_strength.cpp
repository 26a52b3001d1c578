#include "handsim/hand/grip_strength.h"

#include <algorithm>
#include <cmath>

namespace handsim::hand {

namespace {

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
    const double shortness = std::min(1.0, person.stature / norm.stature.first), area = shortness * shortness;
    out.norm += area * norm.mean;
    variance += area * area * norm.deviation * norm.deviation;
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
