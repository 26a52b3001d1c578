#include "handsim/control/pose_table.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/control/motion_file.h"
#include "handsim/control/motion_trajectory.h"
#include "handsim/model/spline.h"

namespace handsim::control {

namespace {

constexpr double kKeyInterval = 1e-3;  ///< of the keyframes of a table [s]

Vec3 vector_at(const MotionTable& table, std::size_t row, const std::vector<std::size_t>& columns) {
  return {table.at(row, columns[0]), table.at(row, columns[1]), table.at(row, columns[2])};
}

class WristColumns {
 public:
  WristColumns(const MotionTable& table, const std::string& hand) : table_(table), hand_(hand) {}

  /// These columns, or none. @throws Error (input) for some of them.
  std::vector<std::size_t> all(const std::vector<std::string>& parts) const {
    std::vector<std::size_t> out;
    std::vector<std::string> missing;
    for (const std::string& part : parts) {
      auto column = std::ranges::find(table_.names, hand_ + ".wrist." + part);
      if (column == table_.names.end()) column = std::ranges::find(table_.names, part);
      if (column == table_.names.end())
        missing.push_back(part);
      else
        out.push_back(as_index(column - table_.names.begin()));
    }
    if (!out.empty() && !missing.empty())
      fail(table_.header_line, fmt::format("no column {}", fmt::join(missing, ", ")),
           "it beside the others of the wrist's pose");
    return out;
  }

  [[noreturn]] void fail(int line, std::string got, std::string need) const {
    throw Error({Problem{Place{table_.file, line, 1}, hand_ + ".wrist", std::move(got), std::move(need)}});
  }
  const MotionTable& table() const { return table_; }

 private:
  const MotionTable& table_;
  const std::string& hand_;
};

struct RotationColumns {
  std::vector<std::size_t> quaternion, vector, axis, angle;  ///< empty: not there
};

Quat rotation_at(const WristColumns& wrist, std::size_t row, const RotationColumns& columns) {
  const MotionTable& table = wrist.table();
  if (const auto& c = columns.quaternion; !c.empty()) {
    const Quat q(table.at(row, c[0]), table.at(row, c[1]), table.at(row, c[2]), table.at(row, c[3]));
    constexpr double kMostStretch = 0.01;
    if (!(std::abs(q.norm() - 1) < kMostStretch))
      wrist.fail(table.lines[row], fmt::format("a quaternion of length {:.4g}", q.norm()), "one of length 1");
    return q.normalized();
  }
  if (!columns.vector.empty()) return rotation_quaternion(vector_at(table, row, columns.vector));
  if (columns.axis.empty()) return Quat::Identity();
  const Vec3 axis = vector_at(table, row, columns.axis);
  if (!(axis.norm() > 1e-9)) wrist.fail(table.lines[row], "an axis of no length", "a direction");
  return rotation_quaternion(table.at(row, columns.angle[0]) * axis.normalized());
}

/// Position and quaternion (x, y, z, qw, qx, qy, qz) of all samples.
struct PoseSamples {
  std::vector<double> times, values;

  void add(double time, const Pose& pose) {
    // q and -q are one rotation: the one nearer to the last.
    last_ = !times.empty() && pose.q.dot(last_) < 0 ? Quat(-pose.q.coeffs()) : pose.q;
    times.push_back(time);
    const Vec3& p = pose.p;
    values.insert(values.end(), {p.x(), p.y(), p.z(), last_.w(), last_.x(), last_.y(), last_.z()});
  }

 private:
  Quat last_ = Quat::Identity();
};

/// A spline through samples, as dense keyframes: straight lines would give the wrist a jerk at each of them.
model::PoseMotion splined(PoseSamples samples) {
  model::PoseMotion out;
  out.interpolation = model::Interpolation::linear;
  const std::vector<double> times = samples.times;
  const model::CubicSpline spline(times, std::move(samples.values), 7);
  const auto add = [&](double time) {
    std::array<double, 7> x{};
    spline.at(time, x);
    out.keys.push_back({time, {Vec3(x[0], x[1], x[2]), Quat(x[3], x[4], x[5], x[6]).normalized()}});
  };
  for (std::size_t i = 0; i + 1 < times.size(); ++i) {
    const double span = times[i + 1] - times[i];
    const int parts = static_cast<int>(std::clamp(std::ceil(span / kKeyInterval), 1.0, 1000.0));
    for (int k = 0; k < parts; ++k) add(times[i] + span * k / parts);
  }
  add(times.back());
  return out;
}

}  // namespace

model::PoseMotion read_pose_table(const std::filesystem::path& path, const std::string& hand,
                                  const std::optional<double>& filter) {
  const MotionTable table = read_motion(path, TableContent::poses);
  const WristColumns wrist(table, hand);
  const std::vector<std::size_t> position = wrist.all({"x", "y", "z"});
  if (position.empty())
    wrist.fail(table.header_line, "no columns x[m], y[m], z[m]", "the position of the wrist");
  const RotationColumns rotation = {wrist.all({"qw", "qx", "qy", "qz"}), wrist.all({"rx", "ry", "rz"}),
                                    wrist.all({"axis.x", "axis.y", "axis.z"}), wrist.all({"angle"})};
  if (rotation.axis.empty() != rotation.angle.empty())
    wrist.fail(table.header_line,
               rotation.angle.empty() ? "an axis without an angle" : "an angle without an axis",
               "both, or a quaternion");
  if (!rotation.quaternion.empty() + !rotation.vector.empty() + !rotation.axis.empty() > 1)
    wrist.fail(table.header_line, "two kinds of rotation",
               "a quaternion, a rotation vector, or axis and angle");
  PoseSamples samples;
  for (std::size_t row = 0; row < table.times.size(); ++row)
    samples.add(table.times[row], {vector_at(table, row, position), rotation_at(wrist, row, rotation)});
  if (filter && !low_pass_rows(samples.times, samples.values, 7, *filter))
    wrist.fail(table.header_line, fmt::format("a filter at {:g} Hz", *filter),
               "a cut-off below half the rate of the table");
  return splined(std::move(samples));
}

}  // namespace handsim::control
