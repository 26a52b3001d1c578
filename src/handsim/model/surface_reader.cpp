#include "handsim/model/surface_reader.h"

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace handsim::model {

namespace {

constexpr std::size_t kMostPoints = 1000;
const Quantity kDepth = {Dimension::length, 1e-6, 0.1}, kForce = {Dimension::force, 1e-9, 1e6};

ForceCurve read_exponential(MapReader reader) {
  const double force = reader.number("force", kForce), depth = reader.number("depth", kDepth);
  reader.finish();
  return ForceCurve::exponential(force, depth);
}

ForceCurve read_table(MapReader& reader) {
  std::vector<ForceCurve::Point> points;
  ForceCurve::Point last;
  reader.each("table", 2, kMostPoints, [&](MapReader row) {
    ForceCurve::Point point;
    point.depth = row.number("depth", kDepth);
    point.force = row.number("force", kForce);
    row.finish();
    if (!row.sound()) return;
    // Forces that do not rise with depth have several depths for one force.
    if (!(point.depth > last.depth))
      row.problem("depth", fmt::format("{:g} m", point.depth),
                  fmt::format("more than {:g} m, that of the row before", last.depth));
    else if (!(point.force > last.force))
      row.problem("force", fmt::format("{:g} N", point.force),
                  fmt::format("more than {:g} N, that of the row before", last.force));
    else
      points.push_back(last = point);
  });
  if (points.size() < 2) points = {{1e-3, 1}, {2e-3, 2}};
  return ForceCurve::table(std::move(points));
}

std::vector<Relaxation> read_relaxation(MapReader& reader) {
  std::vector<Relaxation> out;
  double sum = 0;
  reader.each("relaxation", 0, kMostRelaxations, [&](MapReader row) {
    Relaxation part;
    part.time = row.number("time", {Dimension::time, 1e-5, 1e4});
    part.share = row.number("share", {Dimension::none, 0, 1, true});
    row.finish();
    out.push_back(part);
    sum += part.share;
  });
  if (sum < 1) return out;
  reader.problem("relaxation", fmt::format("shares that add up to {:g}", sum),
                 "shares that add up to less than 1");
  return {};
}

void read_friction_over_load(MapReader reader, Material& material) {
  const double exponent = reader.number("exponent", {Dimension::none, -1, 1});
  const double force = reader.number("force", {Dimension::force, 1e-3, 1e4});
  const auto range = reader.maybe_range("range", {Dimension::none, 1e-2, 100}, true);
  reader.finish();
  if (range)
    material.friction_over_load = {exponent, std::pow(force, -exponent), range->first, range->second};
}

/// Those of its keys that give the force over depth.
std::vector<std::string> curves_of(MapReader& reader) {
  std::vector<std::string> out;
  for (const char* key : {"stiffness", "exponential", "table"})
    if (reader.has(key)) out.emplace_back(key);
  return out;
}

/// Reads `exponential`, `table`, `relaxation`, `reference_radius`, `spins_by_area` and `friction_over_load`
/// into a material that has its fields, and checks them and `damping` against these.
void read_pad_law(MapReader& reader, Material& material) {
  const std::vector<std::string> curves = curves_of(reader);
  PadLaw law;
  if (material.compliance) law.curve = ForceCurve::spring(material.compliance->stiffness);
  if (reader.has("exponential")) law.curve = read_exponential(reader.map("exponential"));
  if (reader.has("table")) law.curve = read_table(reader);
  law.relaxations = read_relaxation(reader);
  law.radius = reader.maybe_number("reference_radius", {Dimension::length, 1e-4, 1}).value_or(0);
  if (reader.has("spins_by_area")) material.spins_by_area = reader.flag("spins_by_area", false);
  if (reader.has("friction_over_load")) read_friction_over_load(reader.map("friction_over_load"), material);
  if (curves.size() > 1)
    reader.problem(curves[1], fmt::format("{} beside {}", curves[1], curves[0]),
                   "one of stiffness, exponential and table");
  for (const char* key : {"damping", "relaxation", "reference_radius", "friction_over_load", "spins_by_area"})
    if (curves.empty() && reader.has(key))
      reader.problem(key, fmt::format("{} of a rigid surface", key),
                     "a stiffness, an exponential or a table beside it");
  const bool spring = law.curve.kind == ForceCurve::Kind::spring && law.relaxations.empty() &&
                      law.radius == 0 && !material.friction_over_load;
  if (curves.empty() || spring) return;
  if (!material.compliance) material.compliance.emplace();
  material.compliance->stiffness = 0;
  material.compliance->law = std::make_shared<const PadLaw>(std::move(law));
}

}  // namespace

Material read_material(MapReader& reader, std::string name) {
  Material material;
  material.name = std::move(name);
  reader.fields(material);
  read_pad_law(reader, material);
  // Standard deviations over the values, for studies of uncertainty.
  if (reader.has("spread")) {
    MapReader spread = reader.map("spread");
    for (const char* key : {"friction", "stiffness", "depth"})
      spread.maybe_number(key, {Dimension::none, 0, 1});
    spread.finish();
  }
  return material;
}

}  // namespace handsim::model
