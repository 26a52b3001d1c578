#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/index.h"
#include "handsim/core/input_file.h"
#include "handsim/output/report/binary.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/simulation/report/run_data.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/watch/hand_parts.h"

namespace handsim::simulation {

std::optional<ContactRows> read_contacts(const RunFiles& run) {
  const std::filesystem::path path = run.folder / "contacts.csv";
  if (!has_entry(path)) return std::nullopt;
  std::map<std::string, int, std::less<>> shapes;
  for (std::size_t i = 0; i < run.scene.model.shapes.size(); ++i)
    shapes[run.scene.model.shapes[i].name] = static_cast<int>(i);
  ContactRows out;
  out.first.push_back(0);
  constexpr std::size_t kColumns = 14;
  const auto columns = output::read_rows(path, [&](std::size_t line,
                                                   std::span<const std::string_view> fields) {
    if (fields.size() != kColumns)
      throw output::row_error(path, line, fmt::format("{} columns", fields.size()), "contacts.csv of a run");
    const auto number = [&](std::size_t i) {
      const double value = output::field_number(fields[i], path, line);
      if (!std::isfinite(static_cast<float>(value)))
        throw output::row_error(path, line, std::string(fields[i]), "a finite number");
      return value;
    };
    const auto vector = [&](std::size_t i) { return Vec3(number(i), number(i + 1), number(i + 2)); };
    const auto a = shapes.find(fields[1]), b = shapes.find(fields[2]);
    if (a == shapes.end() || b == shapes.end())
      throw output::row_error(path, line, "the name of an unknown shape", "shapes of the scene beside it");
    // Both tables have rows at the same times.
    const double time = number(0);
    while (out.first.size() < run.times.size() && run.times[out.first.size() - 1] < time - 1e-9)
      out.first.push_back(out.contacts.size());
    if (std::abs(run.times[out.first.size() - 1] - time) > 1e-9 * std::max(1.0, time))
      throw output::row_error(path, line, fmt::format("the time {:g}", time),
                              "times of trajectory.csv that increase");
    const Vec3 normal = vector(6);
    out.contacts.push_back(
        {a->second, b->second, vector(3), normal, number(9), number(10) * normal + vector(11)});
  });
  if (columns.size() != kColumns || output::contact_head() != fmt::format("{}\n", fmt::join(columns, ",")))
    throw input_error(path.string(), "other columns", "contacts.csv of a run");
  out.first.resize(run.times.size() + 1, out.contacts.size());
  return out;
}

namespace {

/// Sums of normal forces by part of a hand, of parts that touch anything.
std::vector<PartCurve> part_sums(const RunFiles& run, const ContactRows& rows) {
  const model::Model& model = run.scene.model;
  std::map<std::pair<int, int>, std::vector<double>> sums;
  const auto add = [&](std::size_t row, int shape, double force) {
    const model::Shape& of = model.shapes[at(shape)];
    for (std::size_t h = 0; h < model.hands.size(); ++h) {
      const std::vector<int>& bodies = model.hands[h].bodies;
      if (hand_part(of.part) < 0 || std::find(bodies.begin(), bodies.end(), of.body) == bodies.end())
        continue;
      std::vector<double>& values = sums[{static_cast<int>(h), hand_part(of.part)}];
      values.resize(run.times.size());
      values[row] += force;
    }
  };
  for (std::size_t row = 0; row < run.times.size(); ++row)
    for (const engine::Contact& contact : rows.of(row)) {
      add(row, contact.shape_a, contact.normal_force());
      add(row, contact.shape_b, contact.normal_force());
    }
  std::vector<PartCurve> out;
  for (auto& [key, values] : sums)
    out.push_back({model.hands[at(key.first)].name + "." + kHandParts[at(key.second)], std::move(values)});
  return out;
}

}  // namespace

Json contacts_json(const RunFiles& run, const std::optional<ContactRows>& contacts,
                   std::vector<PartCurve>& sums) {
  if (!contacts) return nullptr;
  const ContactRows& rows = *contacts;
  sums = part_sums(run, rows);
  // Position and force of each contact, and its two shapes.
  constexpr double kBytes = 6 * 4 + 2 * 2;
  const std::size_t stride = std::max<std::size_t>(
      1, static_cast<std::size_t>(
             std::ceil(kBytes * static_cast<double>(rows.contacts.size()) / kContactBytes)));
  std::vector<float> times, starts, values;
  std::vector<std::uint16_t> shapes;
  double largest = 0;
  for (std::size_t row = 0; row < run.times.size(); row += stride) {
    times.push_back(static_cast<float>(run.times[row]));
    starts.push_back(static_cast<float>(values.size() / 6));
    for (const engine::Contact& contact : rows.of(row)) {
      const Vec3 force = shown_force(run.scene.model, contact);
      largest = std::max(largest, force.norm());
      for (const double x : contact.position) values.push_back(static_cast<float>(x));
      for (const double x : force) values.push_back(static_cast<float>(x));
      shapes.push_back(static_cast<std::uint16_t>(contact.shape_a));
      shapes.push_back(static_cast<std::uint16_t>(contact.shape_b));
    }
  }
  starts.push_back(static_cast<float>(values.size() / 6));
  Json names = Json::array();
  for (const model::Shape& shape : run.scene.model.shapes)
    names.push_back({{"name", shape.name}, {"body", shape.body}});
  return {{"times", output::base64(times)},
          {"starts", output::base64(starts)},
          {"values", output::base64(values)},
          {"shapes", output::base64(shapes)},
          {"names", names},
          {"largest", largest},
          {"stride", stride}};
}

}  // namespace handsim::simulation
