#include "handsim/engine/packed_arms.h"

#include <Eigen/Core>

#include "handsim/core/index.h"

namespace handsim::engine {

namespace {

using Four = Eigen::Array4d;

auto four(std::vector<double>& of, std::size_t k) { return Four::Map(of.data() + k); }

double power(double x, int n) {
  double out = 1;
  for (; n > 0; --n) out *= x;
  return out;
}

}  // namespace

std::size_t PackedArms::add(const model::TendonPath& path) {
  const std::size_t first = dof_.size(), count = first + path.arms.size(), room = (count + 3) / 4 * 4;
  for (auto* each : {&low_, &high_, &angle_, &within_, &arm_, &bend_, &part_}) each->resize(room);
  for (std::size_t t = 0; t < c_.size(); ++t) {
    c_[t].resize(room);
    integral_[t].resize(room);
  }
  for (std::size_t i = 0; i < path.arms.size(); ++i) {
    const model::MomentArm& arm = path.arms[i];
    dof_.push_back(arm.dof);
    low_[first + i] = arm.low;
    high_[first + i] = arm.high;
    for (std::size_t t = 0; t < c_.size(); ++t) {
      c_[t][first + i] = arm.c[t];
      integral_[t][first + i] = arm.c[t] * (1.0 / static_cast<double>(t + 1));
    }
  }
  paths_.push_back({&path, first});
  excursion_.push_back(0);
  return first;
}

void PackedArms::evaluate(std::span<const double> q) {
  for (std::size_t k = 0; k < dof_.size(); ++k) angle_[k] = q[at(dof_[k])];
  for (std::size_t k = 0; k < angle_.size(); k += 4) {
    const Four angle = four(angle_, k), x = angle.max(four(low_, k)).min(four(high_, k));
    Four r = four(c_.back(), k), slope = Four::Zero(), sum = four(integral_.back(), k);
    for (std::size_t t = c_.size() - 1; t-- > 0;) {
      slope = slope * x + r;
      r = r * x + four(c_[t], k);
      sum = sum * x + four(integral_[t], k);
    }
    four(within_, k) = x;
    four(arm_, k) = r;
    four(bend_, k) = (x == angle).select(slope, Four::Zero());
    four(part_, k) = sum * x + r * (angle - x);
  }
  for (std::size_t n = 0; n < paths_.size(); ++n) {
    const auto& [path, first] = paths_[n];
    double excursion = 0;
    for (std::size_t i = 0; i < path->arms.size(); ++i) excursion += part_[first + i];
    for (const model::ArmProduct& each : path->products) {
      const std::size_t a = first + at(each.a), b = first + at(each.b);
      if (each.power_a == 1 && each.power_b == 1) {
        excursion += each.factor * within_[a] * within_[b];
        if (within_[a] == angle_[a]) arm_[a] += each.factor * within_[b];
        if (within_[b] == angle_[b]) arm_[b] += each.factor * within_[a];
        continue;
      }
      const double pa = power(within_[a], each.power_a), pb = power(within_[b], each.power_b);
      excursion += each.factor * pa * pb;
      const auto change = [&](std::size_t k, int order, double other) {
        if (within_[k] != angle_[k]) return;
        arm_[k] += each.factor * other * order * power(within_[k], order - 1);
        if (order > 1) bend_[k] += each.factor * other * order * (order - 1) * power(within_[k], order - 2);
      };
      change(a, each.power_a, pb);
      change(b, each.power_b, pa);
    }
    excursion_[n] = excursion;
  }
}

}  // namespace handsim::engine
