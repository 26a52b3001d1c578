#include "handsim/control/pose_table.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "handsim/control/motion_file.h"
#include "handsim/control/motion_trajectory.h"
#include "handsim/model/spline.h"

namespace handsim::control {

namespace {

constexpr double kKeyInterval = 1e-3;  ///< of the keyframes of a table [s]

class WristColumns {
 public:
  WristColumns(const MotionTable& table, const std::string& hand) : table_(table), hand_(hand) {}

  std::optional<std::size_t> find(const std::string& part) const {
    for (const std::string& name : {hand_ + ".wrist." + part, part})
      for (std::size_t c = 0; c < table_.names.size(); ++c)
        if (table_.names[c] == name) return c;
    return std::nullopt;
  }

  /// All of these columns, or none. @throws Error (input) for some of them.
  template <std::size_t Count>
  std::optional<std::array<std::size_t, Count>> all(const std::array<const char*, Count>& parts) const {
    std::array<std::size_t, Count> out{};
    std::string missing;
    std::size_t found = 0;
    for (std::size_t i = 0; i < Count; ++i) {
      const auto column = find(parts[i]);
      if (column) out[i] = *column;
      found += column ? 1 : 0;
      if (!column) missing += (missing.empty() ? "" : ", ") + std::string(parts[i]);
    }
    if (found == 0) return std::nullopt;
    if (found < Count)
      fail(table_.header_line, "no column " + missing, "it beside the others of the wrist's pose");
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

using Three = std::optional<std::array<std::size_t, 3>>;

Vec3 vector_at(const MotionTable& table, std::size_t row, const std::array<std::size_t, 3>& columns) {
  return {table.at(row, columns[0]), table.at(row, columns[1]), table.at(row, columns[2])};
}

struct RotationColumns {
  std::optional<std::array<std::size_t, 4>> quaternion;
  Three vector, axis;
  std::optional<std::size_t> angle;
};

Quat rotation_at(const WristColumns& wrist, std::size_t row, const RotationColumns& columns) {
  const MotionTable& table = wrist.table();
  if (columns.quaternion) {
    const auto& c = *columns.quaternion;
    const Quat q(table.at(row, c[0]), table.at(row, c[1]), table.at(row, c[2]), table.at(row, c[3]));
    constexpr double kMostStretch = 0.01;
    if (!(std::abs(q.norm() - 1) < kMostStretch))
      wrist.fail(table.lines[row], fmt::format("a quaternion of length {:.4g}", q.norm()), "one of length 1");
    return q.normalized();
  }
  if (columns.vector) return rotation_quaternion(vector_at(table, row, *columns.vector));
  if (!columns.axis) return Quat::Identity();
  const Vec3 axis = vector_at(table, row, *columns.axis);
  if (!(axis.norm() > 1e-9)) wrist.fail(table.lines[row], "an axis of no length", "a direction");
  return rotation_quaternion(table.at(row, *columns.angle) * axis.normalized());
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
  const Three position = wrist.all<3>({"x", "y", "z"});
  if (!position) wrist.fail(table.header_line, "no columns x[m], y[m], z[m]", "the position of the wrist");
  RotationColumns rotation;
  rotation.quaternion = wrist.all<4>({"qw", "qx", "qy", "qz"});
  rotation.vector = wrist.all<3>({"rx", "ry", "rz"});
  rotation.axis = wrist.all<3>({"axis.x", "axis.y", "axis.z"});
  rotation.angle = wrist.find("angle");
  if (rotation.axis.has_value() != rotation.angle.has_value())
    wrist.fail(table.header_line, rotation.axis ? "an axis without an angle" : "an angle without an axis",
               "both, or a quaternion");
  if (rotation.quaternion.has_value() + rotation.vector.has_value() + rotation.axis.has_value() > 1)
    wrist.fail(table.header_line, "two kinds of rotation",
               "a quaternion, a rotation vector, or axis and angle");
  PoseSamples samples;
  for (std::size_t row = 0; row < table.times.size(); ++row)
    samples.add(table.times[row], {vector_at(table, row, *position), rotation_at(wrist, row, rotation)});
  if (filter && !low_pass_rows(samples.times, samples.values, 7, *filter))
    wrist.fail(table.header_line, fmt::format("a filter at {:g} Hz", *filter),
               "a cut-off below half the rate of the table");
  return splined(std::move(samples));
}

}  // namespace handsim::control
