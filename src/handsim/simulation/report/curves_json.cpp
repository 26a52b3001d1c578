#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/input_file.h"
#include "handsim/core/units.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/report/binary.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/simulation/report/run_data.h"
#include "handsim/simulation/run/output_size.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/watch/hand_parts.h"

namespace handsim::simulation {

namespace {

/// Curves are kept within this share of their range: half a pixel of a plot of this height.
constexpr double kCurveTolerance = 1.0 / 500;

/// Collects curves; each is thinned on its own.
class Curves {
 public:
  explicit Curves(std::size_t count)
      : most_(static_cast<std::size_t>(kCurveBytes / 8 /
                                       static_cast<double>(std::max<std::size_t>(1, count)))) {}

  /// @param kind `value`, `target`: dashed, in the colour of the value of its name, or the part of a hand
  /// that a muscle moves
  void add(const std::string& group, const char* unit, const std::string& name, const char* kind,
           const std::vector<double>& times, const std::vector<float>& values) {
    if (values.empty()) return;
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const double range = *high - *low;
    (*low == 0 && *high == 0 ? zero_ : other_).insert(group);
    const output::Thinned thin = output::thinned(times, values, {std::max(range * kCurveTolerance, 1e-30)},
                                                 std::max<std::size_t>(most_, 16));
    std::vector<float> t, v;
    for (const std::size_t row : thin.rows) {
      t.push_back(static_cast<float>(times[row]));
      v.push_back(values[row]);
    }
    json_.push_back({{"group", group},
                     {"unit", unit},
                     {"name", name},
                     {"kind", kind},
                     {"times", output::base64(t)},
                     {"values", output::base64(v)}});
  }
  /// The curves, without groups that are zero all the time; `zero` has their names.
  Json take(Json& zero) {
    Json out = Json::array();
    for (const std::string& group : other_) zero_.erase(group);
    for (Json& curve : json_)
      if (!zero_.contains(curve["group"])) out.push_back(std::move(curve));
    zero = zero_;
    return out;
  }

 private:
  std::size_t most_;
  std::set<std::string> zero_, other_;  ///< groups with a curve that is zero, and with another one
  Json json_ = Json::array();
};

std::vector<float> column(const output::NumberTable& table, std::size_t index, double factor = 1) {
  std::vector<float> out;
  for (std::size_t row = 0; row < table.rows(); ++row)
    out.push_back(static_cast<float>(factor * table.at(row, index)));
  return out;
}

/// The name of a column without its unit, and the unit.
std::pair<std::string, std::string> parted(const std::string& name) {
  const std::size_t at = name.find('[');
  if (at == std::string::npos) return {name, ""};
  return {name.substr(0, at), name.substr(at + 1, name.size() - at - 2)};
}

struct RunTable {
  RunTable(const std::filesystem::path& path, std::vector<std::string> columns)
      : table(output::read_numbers(path)) {
    columns.insert(columns.begin(), "time");
    if (table.columns != columns)
      throw input_error(path.string(), "columns of another scene", "the table of the run beside it");
    const std::vector<float> t = column(table, 0);
    times.assign(t.begin(), t.end());
  }
  output::NumberTable table;
  std::vector<double> times;
};

/// Targets, angles and torques of driven axes.
void add_control(const std::filesystem::path& path, const scene::Scene& scene, Curves& curves) {
  const RunTable of(path, control_columns(scene));
  std::size_t c = 1;
  for (const control::DrivenAxis& axis : scene.control->axes) {
    curves.add("Angles", "deg", axis.name, "target", of.times, column(of.table, c));
    curves.add("Angles", "deg", axis.name, "value", of.times, column(of.table, c + 1));
    curves.add("Torques", "N m", axis.name, "value", of.times, column(of.table, c + 2));
    c += 3;
  }
}

void add_muscles(const std::filesystem::path& path, const scene::Scene& scene, Curves& curves) {
  const RunTable of(path, muscle_columns(scene));
  std::size_t c = 1;
  for (const model::Muscle& muscle : scene.model.muscles) {
    const char* part = moved_by(muscle, scene.model);
    curves.add(std::string("Activations, ") + part, "", muscle.name, part, of.times, column(of.table, c + 1));
    curves.add(std::string("Tensions, ") + part, "N", muscle.name, part, of.times, column(of.table, c + 2));
    c += kMuscleColumns.size();
  }
}

void add_coordinates(const RunFiles& run, Curves& curves) {
  for (std::size_t c = 1; c <= as_index(run.scene.model.dof_count()); ++c) {
    const auto [name, unit] = parted(run.trajectory.columns[c]);
    const bool angle = unit == "rad";
    curves.add(angle ? "Angles" : "Sliders", angle ? "deg" : "mm", name, "value", run.times,
               column(run.trajectory, c, angle ? kDegreesPerRadian : 1e3));
  }
}

/// The largest gap of a hand's joints, or of all others.
void add_gaps(const RunFiles& run, Curves& curves) {
  const model::Model& model = run.scene.model;
  if (model.joints.empty()) return;
  std::vector<std::string> names = {"joints"};
  std::vector<std::size_t> owner(model.joints.size(), 0);
  for (const model::HandIndex& hand : model.hands) {
    for (const int joint : hand.joints) owner[as_index(joint)] = names.size();
    names.push_back(hand.name);
  }
  std::vector<std::vector<float>> gaps(names.size(), std::vector<float>(run.times.size()));
  for (std::size_t row = 0; row < run.times.size(); ++row) {
    const model::State state = run.state(row);
    for (std::size_t j = 0; j < model.joints.size(); ++j) {
      float& largest = gaps[owner[j]][row];
      largest = std::max(largest, static_cast<float>(1e6 * model::joint_gap(model.joints[j], state)));
      // Rounding, of an engine without gaps.
      if (largest < 1e-6F) largest = 0;
    }
  }
  for (std::size_t i = 0; i < names.size(); ++i)
    if (std::ranges::find(owner, i) != owner.end())
      curves.add("Joint gaps", "um", names[i], "value", run.times, gaps[i]);
}

/// Columns of monitor.csv: energies and residuals. A residual is measured in some steps only.
void add_monitor(const std::filesystem::path& path, Curves& curves) {
  const output::NumberTable table = output::read_numbers(path, false);
  if (fmt::format("{}", fmt::join(table.columns, ",")) != std::string("time[s]") + kMonitorColumns)
    throw input_error(path.string(), "other columns", "monitor.csv of a run");
  for (std::size_t c = 1; c < table.columns.size(); ++c) {
    const auto [name, unit] = parted(table.columns[c]);
    std::vector<double> times;
    std::vector<float> values;
    for (std::size_t row = 0; row < table.rows(); ++row) {
      const auto value = static_cast<float>(table.at(row, c));
      if (!std::isfinite(value)) continue;
      times.push_back(table.at(row, 0));
      values.push_back(value);
    }
    const char* group = unit == "J"       ? "Energies"
                        : unit == "rad/s" ? "Residuals of rotations"
                                          : "Residuals of velocities";
    curves.add(group, unit.c_str(), name, "value", times, values);
  }
}

void add_phases(const std::vector<scene::TaskPhase>& phases, Json& out) {
  for (const scene::TaskPhase& phase : phases)
    out.push_back({{"kind", "phase"}, {"name", phase.name}, {"time", phase.start}, {"end", phase.end}});
}

/// Sums of normal forces by part of a hand, of parts that touch anything.
std::vector<PartCurve> part_sums(const RunFiles& run, const RecordedContacts& rows) {
  const model::Model& model = run.scene.model;
  std::map<std::pair<std::size_t, std::size_t>, std::vector<double>> sums;
  const auto add = [&](std::size_t row, int shape, double force) {
    const model::Shape& of = model.shapes[as_index(shape)];
    for (std::size_t h = 0; h < model.hands.size(); ++h) {
      const std::vector<int>& bodies = model.hands[h].bodies;
      if (!hand_part(of.part) || std::ranges::find(bodies, of.body) == bodies.end()) continue;
      std::vector<double>& values = sums[{h, *hand_part(of.part)}];
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
    out.push_back({model.hands[key.first].name + "." + kHandParts[key.second], std::move(values)});
  return out;
}

}  // namespace

Json curves_json(const RunFiles& run, const std::vector<PartCurve>& sums, Json& zero) {
  const std::filesystem::path control = run.folder / "control.sto", monitor = run.folder / "monitor.csv",
                              muscles = run.folder / "muscles.sto";
  const scene::Scene& scene = run.scene;
  const bool driven = scene.control.has_value();
  Curves curves((driven ? 3 * scene.control->axes.size() : as_index(scene.model.dof_count())) +
                2 * scene.model.muscles.size() + sums.size() + 8);
  const bool has_control = has_entry(control);
  if (!has_control || !driven) add_coordinates(run, curves);
  if (has_control && driven) add_control(control, scene, curves);
  if (has_entry(muscles)) add_muscles(muscles, scene, curves);
  for (const PartCurve& sum : sums)
    curves.add("Contact forces", "N", sum.name, "value", run.times, {sum.values.begin(), sum.values.end()});
  add_gaps(run, curves);
  if (has_entry(monitor)) add_monitor(monitor, curves);
  return curves.take(zero);
}

Json marks_json(const RunFiles& run) {
  Json out = Json::array();
  for (const scene::GraspPlan& grasp : run.scene.plans.grasps) add_phases(grasp.phases, out);
  for (const scene::ClimbPlan& climb : run.scene.plans.climbs) add_phases(climb.phases, out);
  for (const Json& entry : run.summary.value("climbs", Json::array())) {
    if (entry.contains("failure_time_s") && entry["failure_time_s"].is_number())
      out.push_back({{"kind", "failed"},
                     {"name", "climb " + entry.value("name", "") + " fails"},
                     {"time", entry["failure_time_s"]}});
  }
  for (const Json& entry : run.summary.value("grasps", Json::array())) {
    const Json outcome = entry.value("outcome", Json());
    if (entry.value("lost_time_s", Json()).is_number())
      out.push_back({{"kind", "failed"},
                     {"name", entry.value("name", "") + " " +
                                  (outcome.is_string() ? outcome.get<std::string>() : "lost")},
                     {"time", entry["lost_time_s"]}});
  }
  if (run.summary.contains("fault")) {
    const Json& fault = run.summary["fault"];
    out.push_back({{"kind", "failed"},
                   {"name", "diverged: " + fault.value("where", "") + ", " + fault.value("quantity", "") +
                                " " + fault.value("detail", "")},
                   {"time", fault.value("time_s", 0.0)}});
  }
  return out;
}

std::optional<RecordedContacts> read_contacts(const RunFiles& run) {
  const std::filesystem::path path = run.folder / "contacts.csv";
  if (!has_entry(path)) return std::nullopt;
  std::map<std::string, int, std::less<>> shapes;
  for (std::size_t i = 0; i < run.scene.model.shapes.size(); ++i)
    shapes[run.scene.model.shapes[i].name] = static_cast<int>(i);
  RecordedContacts out;
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

Json contacts_json(const RunFiles& run, const std::optional<RecordedContacts>& contacts,
                   std::vector<PartCurve>& sums) {
  if (!contacts) return nullptr;
  const RecordedContacts& rows = *contacts;
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
