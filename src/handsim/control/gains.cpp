#include "handsim/control/gains.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace handsim::control {

namespace {

AxisGains read_gains(MapReader& reader) {
  AxisGains out;
  reader.fields(out);
  const bool given = out.proportional || out.derivative || out.integral;
  const bool designed = out.frequency || out.damping_ratio || out.integral_time;
  if (given && designed)
    reader.problem(out.frequency       ? "frequency"
                   : out.damping_ratio ? "damping_ratio"
                                       : "integral_time",
                   "given and designed gains in one row",
                   "proportional, derivative, integral, or frequency, damping_ratio, integral_time");
  return out;
}

GainRow read_row(MapReader reader) {
  GainRow row;
  row.place = reader.node().place();
  row.joints = reader.texts("joints", 1, kMostItems,
                            "all, the name of a joint (index_mcp) or of its axis (index_mcp.flexion), a "
                            "pattern (*_mcp), or a list of them");
  for (const std::string& name : row.joints)
    if (std::ranges::count(name, '*') > 1) reader.problem("joints", name, "at most one * in a name");
  row.gains = read_gains(reader);
  reader.maybe_text("source");
  reader.finish();
  return row;
}

/// True if the axis or its joint is as a pattern with one `*`, for any letters.
bool fits(std::string_view pattern, const HandAxis& axis) {
  const std::size_t star = pattern.find('*');
  if (star == std::string_view::npos) return false;
  const std::string_view head = pattern.substr(0, star), tail = pattern.substr(star + 1);
  const auto as = [&](std::string_view name) {
    return name.size() >= head.size() + tail.size() && name.starts_with(head) && name.ends_with(tail);
  };
  return as(axis.joint) || as(axis.name());
}

}  // namespace

void AxisGains::overlay(const AxisGains& later) {
  if (later.proportional || later.derivative || later.integral)
    frequency = damping_ratio = integral_time = std::nullopt;
  if (later.frequency || later.damping_ratio || later.integral_time)
    proportional = derivative = integral = std::nullopt;
  fields([&](std::string_view, auto member, auto) {
    if (later.*member) this->*member = later.*member;
  });
}

ControllerSpec read_controller(const YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  ControllerSpec spec;
  MapReader reader(node, path, diagnostics);
  reader.text("title", "untitled");
  spec.form = reader.choice<Form>(
      "form", {{"implicit", Form::implicit_gain}, {"explicit", Form::explicit_torque}}, Form::implicit_gain);
  spec.gravity_compensation = reader.flag("gravity_compensation", false);
  spec.tissue_compensation = reader.flag("tissue_compensation", false);
  spec.feed_forward = reader.flag("feed_forward", false);
  spec.grip_strength = reader.maybe_number("grip_strength", {Dimension::force, 1, 5000});
  reader.named_texts("sources");
  reader.each("gains", 1, kMostItems, [&](MapReader row) { spec.rows.push_back(read_row(std::move(row))); });
  reader.finish();
  return spec;
}

void check_names(const ControllerSpec& spec, const std::vector<HandAxes>& hands, Diagnostics& diagnostics) {
  std::vector<std::string> known, named, absent;
  for (const HandAxes& hand : hands)
    for (const HandAxis& axis : hand.axes) known.insert(known.end(), {axis.joint, axis.name()});
  for (const GainRow& row : spec.rows) named.insert(named.end(), row.joints.begin(), row.joints.end());
  for (const GainRow& row : spec.rows)
    for (const std::string& name : row.joints) {
      const bool matched = name.find('*') != std::string::npos ||
                           std::ranges::any_of(hands, [&](const auto& hand) { return hand.accepts(name); });
      if (matched) continue;
      if (is_misspelt(name, known, named))
        diagnostics.problems.push_back({row.place, "gains.joints",
                                        fmt::format("\"{}\", a joint that no hand of the scene has", name),
                                        "a joint or joint.axis of a hand" + nearest_hint(name, known)});
      else if (std::ranges::find(absent, name) == absent.end())
        absent.push_back(name);
    }
  if (!absent.empty())
    diagnostics.warnings.push_back(
        fmt::format("{}gains: rows of joints that no hand of the scene has are left out: {}",
                    spec.rows.front().place.text(), fmt::join(absent, ", ")));
}

std::optional<AxisGains> gains_of(const ControllerSpec& spec, const HandAxis& axis) {
  std::optional<AxisGains> out;
  for (const GainRow& row : spec.rows) {
    if (std::ranges::none_of(row.joints,
                             [&](const std::string& n) { return matches(axis, n) || fits(n, axis); }))
      continue;
    if (!out) out.emplace();
    out->overlay(row.gains);
  }
  return out;
}

}  // namespace handsim::control
