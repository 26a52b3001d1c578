#include "handsim/simulation/monitor.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "handsim/model/kinematics.h"

namespace handsim::simulation {

Monitor::Monitor(const model::Model& model, double step, bool stops) : model_(model), step_(step), stops_(stops) {
  for (std::size_t i = 0; i < model.joints.size(); ++i) {
    bool any = false;
    for (const model::JointAxis& axis : model.joints[i].axes) any = any || axis.stop.has_value();
    if (any && stops) watched_.push_back({static_cast<int>(i), {0, 0}, {0, 0}});
  }
}

void Monitor::look(const model::State& state) {
  last_time_ = state.time;
  for (std::size_t i = 0; i < model_.joints.size(); ++i) {
    const double gap = model::joint_gap(model_.joints[i], state);
    if (!(gap > gap_)) continue;
    gap_ = gap;
    gap_time_ = state.time;
    gap_joint_ = static_cast<int>(i);
  }
  for (Watched& watched : watched_) look_at_stops(watched, state);
}

void Monitor::look_at_stops(Watched& watched, const model::State& state) {
  const model::Joint& joint = model_.joints[static_cast<std::size_t>(watched.joint)];
  std::array<double, 3> q{};
  model::joint_coordinates(joint, state, q);
  for (std::size_t a = 0; a < joint.axes.size(); ++a) {
    const auto& stop = joint.axes[a].stop;
    if (!stop) continue;
    const double over = std::max({0.0, q[a] - stop->high, stop->low - q[a]});
    if (over > 0 && watched.overshoot[a] <= 0) {
      std::array<double, 3> rate{};
      model::joint_rates(joint, state, rate);
      watched.allowed[a] = std::abs(rate[a]) * step_;
    }
    watched.overshoot[a] = over;
    const double excess = over - watched.allowed[a];
    if (over <= 0 || excess <= excess_) continue;
    excess_ = excess;
    excess_time_ = state.time;
    excess_joint_ = watched.joint;
    excess_axis_ = static_cast<int>(a);
  }
}

Peak Monitor::named(double value, double time, int joint, int axis) const {
  if (!(value > 0)) return {0, 0, ""};
  const model::Joint& at = model_.joints[static_cast<std::size_t>(joint)];
  return {value, time, at.name + "." + at.axes[static_cast<std::size_t>(axis)].name};
}

Peak Monitor::joint_gap() const {
  if (model_.joints.empty()) return {};
  return {gap_, gap_time_, model_.joints[static_cast<std::size_t>(gap_joint_)].name};
}

Peak Monitor::stop_overshoot() const { return named(excess_, excess_time_, excess_joint_, excess_axis_); }

Peak Monitor::stop_rest() const {
  Peak worst;
  for (const Watched& watched : watched_)
    for (int a = 0; a < 2; ++a)
      if (watched.overshoot[a] > worst.value) worst = named(watched.overshoot[a], last_time_, watched.joint, a);
  return worst;
}

}  // namespace handsim::simulation
