#include "handsim/control/motion_trajectory.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/model/spline.h"

namespace handsim::control {

namespace {

constexpr std::size_t kMostPlaces = 5;
/// No joint turns this far [rad]; also the largest angle of a table in degrees that may be in radians.
constexpr double kLargestTurn = 2 * M_PI;

struct Source {
  std::optional<std::size_t> column;
  double sign = 1, offset = 0;         ///< of a renamed column
  const Coupling* coupling = nullptr;  ///< of an axis without a column
  std::optional<std::size_t> leader;   ///< axis that the coupling names
};

class HandTable {
 public:
  HandTable(const MotionTable& table, const HandAxes& hand, const MotionOptions& options)
      : table_(table), hand_(hand), options_(options), sources_(hand.axes.size()) {
    for (const HandAxis& axis : hand.axes) axes_.push_back(axis.name());
    for (std::size_t c = 0; c < table.names.size(); ++c) add_column(c);
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (!sources_[i].column) couple(i);
  }

  bool has(std::size_t axis) const { return sources_[axis].column || sources_[axis].leader; }
  /// Replaces the angles that the table has.
  void read_row(std::size_t row, std::vector<double>& angles) const {
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (const Source& s = sources_[i]; s.column) angles[i] = s.sign * table_.at(row, *s.column) + s.offset;
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (const Source& s = sources_[i]; s.leader)
        angles[i] = s.coupling->ratio * angles[*s.leader] + s.coupling->offset;
  }

  /// Names that the hand does not use, and driven axes that get no angle.
  void report_names(const std::vector<bool>& driven, Diagnostics& diagnostics) const {
    const Place head{table_.file, table_.header_line, 1};
    if (std::ranges::none_of(sources_, [](const Source& s) { return s.column.has_value(); }))
      return diagnostics.problems.push_back(
          {head, hand_.hand, "no column of an axis of this hand",
           fmt::format("columns {}.JOINT.AXIS or JOINT.AXIS, or control.motion.names{}", hand_.hand,
                       unused_.empty() ? "" : "; unused columns: " + listed(unused_))});
    std::vector<std::string> held;
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (driven[i] && !has(i)) held.push_back(axes_[i]);
    const std::string place = fmt::format("{}:{}:1", table_.file, table_.header_line);
    if (!unused_.empty())
      diagnostics.warnings.push_back(
          fmt::format("{}: {} that hand {} does not use: {}", place,
                      unused_.size() == 1 ? "a column" : fmt::format("{} columns", unused_.size()),
                      hand_.hand, listed(unused_)));
    if (!held.empty())
      diagnostics.warnings.push_back(fmt::format("{}: no column for {} of hand {}: held at the start angle",
                                                 place, fmt::join(held, ", "), hand_.hand));
  }

 private:
  /// The first few names, each with the nearest axis.
  std::string listed(const std::vector<std::string>& names) const {
    std::string out;
    for (std::size_t i = 0; i < std::min(names.size(), kMostPlaces); ++i) {
      // A name may start with the hand's name.
      std::string hint = nearest_hint(names[i], axes_);
      if (hint.empty()) hint = nearest_hint(names[i].substr(names[i].find('.') + 1), axes_);
      out += (i > 0 ? ", " : "") + names[i] + hint;
    }
    return names.size() > kMostPlaces ? fmt::format("{} and {} more", out, names.size() - kMostPlaces) : out;
  }

  std::optional<std::size_t> axis_of(const std::string& name) const {
    const bool own = name.starts_with(hand_.hand + ".");
    const auto found = std::ranges::find(axes_, own ? name.substr(hand_.hand.size() + 1) : name);
    if (found == axes_.end()) return std::nullopt;
    return static_cast<std::size_t>(found - axes_.begin());
  }

  /// A name of another hand, or the measured angle beside a target of control.sto.
  bool is_of_others(const std::string& name) const {
    const std::size_t dot = name.find('.');
    if (dot != std::string::npos && (name.starts_with("right") || name.starts_with("left")) &&
        std::ranges::find(axes_, name.substr(dot + 1)) != axes_.end())
      return true;
    return name.ends_with(".angle") &&
           std::ranges::find(table_.names, name.substr(0, name.size() - 6)) != table_.names.end();
  }

  void add_column(std::size_t c) {
    const auto renamed = options_.names.columns.find(table_.names[c]);
    const bool known = renamed != options_.names.columns.end();
    const std::string& name = known ? renamed->second.axis : table_.names[c];
    const auto axis = axis_of(name);
    if (!axis) {
      if (!is_of_others(name)) unused_.push_back(table_.names[c]);
      return;
    }
    // A column of this hand replaces one of all hands.
    Source& source = sources_[*axis];
    if (source.column && !name.starts_with(hand_.hand + ".")) return;
    source = {};
    source.column = c;
    if (known) source.sign = renamed->second.sign;
    if (known) source.offset = renamed->second.offset;
  }

  /// Follows a coupling to an axis that has a column.
  void couple(std::size_t i) {
    for (const std::string& name : {hand_.hand + "." + axes_[i], axes_[i]}) {
      const auto found = options_.names.couplings.find(name);
      if (found == options_.names.couplings.end()) continue;
      const auto leader = axis_of(found->second.axis);
      if (!leader || !sources_[*leader].column) continue;
      sources_[i].coupling = &found->second;
      sources_[i].leader = leader;
      return;
    }
  }

  const MotionTable& table_;
  const HandAxes& hand_;
  const MotionOptions& options_;
  std::vector<std::string> axes_;
  std::vector<Source> sources_;
  std::vector<std::string> unused_;
};

/// Moves angles into their ranges, and reports those that are too far outside.
struct RangeCheck {
  const MotionTable& table;
  const HandAxes& hand;
  bool clamp;
  std::size_t refused = 0, moved = 0;
  double largest = 0;  ///< [rad]
  std::vector<Problem> places = {};

  double inside(std::size_t row, const HandAxis& axis, double angle) {
    if (!axis.stop || (angle >= axis.stop->low && angle <= axis.stop->high)) return angle;
    const double nearest = std::clamp(angle, axis.stop->low, axis.stop->high);
    const double excess = std::abs(angle - nearest);
    if (excess > kMotionRangeTolerance && !clamp) {
      ++refused;
      if (places.size() < kMostPlaces)
        places.push_back({Place{table.file, table.lines[row], 1}, hand.hand + "." + axis.name(),
                          fmt::format("{:.4g} deg at {:g} s", angle / kDegree, table.times[row]),
                          fmt::format("an angle in its range, {:.4g} to {:.4g} deg, or control.motion.clamp",
                                      axis.stop->low / kDegree, axis.stop->high / kDegree)});
    } else if (excess > 1e-9) {
      ++moved;
      largest = std::max(largest, excess);
    }
    return nearest;
  }

  void report(Diagnostics& diagnostics) {
    if (refused > places.size())
      places.back().got +=
          fmt::format(" (and {} more samples of hand {})", refused - places.size(), hand.hand);
    diagnostics.problems.insert(diagnostics.problems.end(), places.begin(), places.end());
    if (moved > 0)
      diagnostics.warnings.push_back(
          fmt::format("{}: {} angles of hand {} up to {:.2g} deg beyond their range: moved to the stop",
                      table.file, moved, hand.hand, largest / kDegree));
  }
};

/// True, with a problem, for a table in radians whose numbers must be degrees; warns of the opposite.
bool has_wrong_unit(const MotionTable& table, Diagnostics& diagnostics) {
  double largest = 0;
  for (const double value : table.values) largest = std::max(largest, std::abs(value));
  if (table.radians && largest > kLargestTurn) {
    diagnostics.problems.push_back(
        {Place{table.file, table.header_line, 1}, "",
         fmt::format("angles up to {:.4g} in a table in radians, which look like degrees", largest),
         "inDegrees=yes in the header of .mot or .sto, or columns NAME[deg] in CSV"});
    return true;
  }
  const double in_degrees = largest / kDegree;
  if (!table.radians && table.times.size() > 1 && in_degrees > 0.2 && in_degrees < M_PI)
    diagnostics.warnings.push_back(
        fmt::format("{}: no angle is above {:.2g} deg: are these radians?", table.file, in_degrees));
  return false;
}

const Quantity kOffset = {Dimension::angle, -2 * M_PI, 2 * M_PI};
constexpr std::size_t kMostNames = 1000;

/// `index_mcp.flexion`, or a mapping with sign and offset.
ColumnName read_column(MapReader& columns, const std::string& name) {
  using Kind = YamlNode::Kind;
  ColumnName out;
  const YamlNode* node = columns.value(
      name, {{Kind::scalar, Kind::map}, "an axis such as index_mcp.flexion, or {axis, sign, offset}"});
  if (!node) return out;
  if (node->kind == Kind::scalar) {
    out.axis = node->text;
    return out;
  }
  MapReader column = columns.map(name);
  out.axis = column.text("axis");
  out.sign = column.number("sign", {Dimension::none, -1, 1}, 1.0);
  if (std::abs(out.sign) != 1) column.problem("sign", number_text(out.sign), "1 or -1");
  out.offset = column.number("offset", kOffset, 0.0);
  column.finish();
  return out;
}

Coupling read_coupling(MapReader coupling) {
  Coupling out;
  out.axis = coupling.text("axis");
  out.ratio = coupling.number("ratio", {Dimension::none, -10, 10}, 1.0);
  out.offset = coupling.number("offset", kOffset, 0.0);
  coupling.finish();
  return out;
}

/// Coefficients of y = b (x + 2 x1 + x2) - a1 y1 - a2 y2, by the bilinear transform.
struct Section {
  double b = 1, a1 = 0, a2 = 0;

  Section(double step, double cutoff) {
    // Two passes at a higher cut-off have 1/sqrt(2) together at the given one (Winter 2009, 2.2.4.4).
    const double both = std::pow(std::sqrt(2.0) - 1, 0.25);
    const double k = std::tan(M_PI * cutoff * step) / both;
    const double scale = 1 + std::sqrt(2.0) * k + k * k;
    b = k * k / scale;
    a1 = 2 * (k * k - 1) / scale;
    a2 = (1 - std::sqrt(2.0) * k + k * k) / scale;
  }

  /// Starts as if the first value had lasted for ever.
  void run(std::vector<double>& x) const {
    double x1 = x.front(), x2 = x1, y1 = x1, y2 = x1;
    for (double& value : x) {
      const double y = b * (value + 2 * x1 + x2) - a1 * y1 - a2 * y2;
      x2 = x1;
      x1 = value;
      y2 = y1;
      y1 = value = y;
    }
  }
};

}  // namespace

Trajectory motion_trajectory(const MotionTable& table, const HandAxes& hand, const std::vector<bool>& driven,
                             std::span<const double> start, const MotionOptions& options,
                             Diagnostics& diagnostics) {
  const std::size_t width = hand.axes.size();
  Trajectory out(width, model::Interpolation::linear);
  if (has_wrong_unit(table, diagnostics)) return out;
  const HandTable of(table, hand, options);
  of.report_names(driven, diagnostics);
  RangeCheck range{table, hand, options.clamp};
  std::vector<double> times = table.times, angles;
  angles.reserve(times.size() * width);
  std::vector<double> row(start.begin(), start.end());
  for (std::size_t r = 0; r < times.size(); ++r) {
    of.read_row(r, row);
    for (std::size_t i = 0; i < width; ++i)
      angles.push_back(of.has(i) ? range.inside(r, hand.axes[i], row[i]) : row[i]);
  }
  range.report(diagnostics);
  if (options.filter && !low_pass_rows(times, angles, width, *options.filter))
    diagnostics.problems.push_back({Place{table.file, table.header_line, 1}, "control.motion.filter",
                                    fmt::format("a filter at {:g} Hz", *options.filter),
                                    "a cut-off below half the rate of the table"});
  for (std::size_t r = 0; r < times.size(); ++r)
    out.add(times[r], std::span(angles).subspan(r * width, width));
  if (options.spline || options.filter) out.use_spline();
  return out;
}

MotionNames read_motion_names(const YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  MotionNames out;
  MapReader reader(node, path, diagnostics);
  reader.text("title", "untitled");
  reader.named_texts("sources");
  MapReader columns = reader.map("columns");
  for (const std::string& name : columns.keys(kMostNames)) out.columns[name] = read_column(columns, name);
  columns.finish();
  MapReader couplings = reader.map("couplings");
  for (const std::string& name : couplings.keys(kMostNames))
    out.couplings[name] = read_coupling(couplings.required_map(name, "{axis, ratio, offset}"));
  couplings.finish();
  reader.finish();
  return out;
}

void low_pass(std::vector<double>& values, double step, double cutoff) {
  assert(cutoff > 0 && cutoff * step < 0.5);
  const std::size_t n = values.size();
  if (n < 2) return;
  const Section section(step, cutoff);
  // The filter's memory is some periods of its cut-off.
  const std::size_t most = n - 1, wanted = static_cast<std::size_t>(std::ceil(3 / (cutoff * step)));
  const std::size_t pad = std::min(most, wanted);
  std::vector<double> x;
  x.reserve(n + 2 * pad);
  for (std::size_t i = pad; i > 0; --i) x.push_back(2 * values.front() - values[i]);
  x.insert(x.end(), values.begin(), values.end());
  for (std::size_t i = 1; i <= pad; ++i) x.push_back(2 * values.back() - values[n - 1 - i]);
  section.run(x);
  std::ranges::reverse(x);
  section.run(x);
  std::ranges::reverse(x);
  std::copy_n(x.begin() + static_cast<std::ptrdiff_t>(pad), n, values.begin());
}

bool low_pass_rows(std::vector<double>& times, std::vector<double>& values, std::size_t width,
                   double cutoff) {
  const std::size_t n = times.size();
  if (n < 2) return true;
  const double step = (times.back() - times.front()) / static_cast<double>(n - 1);
  if (!(cutoff * step < 0.5)) return false;
  const model::CubicSpline recorded(times, values, width);
  for (std::size_t r = 0; r < n; ++r) {
    times[r] = r + 1 == n ? times.back() : times.front() + static_cast<double>(r) * step;
    recorded.at(times[r], std::span(values).subspan(r * width, width));
  }
  std::vector<double> column(n);
  for (std::size_t c = 0; c < width; ++c) {
    for (std::size_t r = 0; r < n; ++r) column[r] = values[r * width + c];
    low_pass(column, step, cutoff);
    for (std::size_t r = 0; r < n; ++r) values[r * width + c] = column[r];
  }
  return true;
}

}  // namespace handsim::control
