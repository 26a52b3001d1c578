#include "handsim/engine/packed_arms.h"

#include <experimental/simd>

#include "handsim/core/index.h"

namespace handsim::engine {

namespace {

namespace stdx = std::experimental;
using Lanes = stdx::simd<double, stdx::simd_abi::deduce_t<double, 2>>;

Lanes load(const double* from) { return {from, stdx::element_aligned}; }

double power(double x, int n) {
  double out = 1;
  for (; n > 0; --n) out *= x;
  return out;
}

}  // namespace

std::size_t PackedArms::add(const model::TendonPath& path) {
  const std::size_t first = dof_.size();
  for (const model::MomentArm& arm : path.arms) {
    const std::size_t lane = dof_.size() % 4;
    if (lane == 0) blocks_.emplace_back();
    Block& block = blocks_.back();
    block.low[lane] = arm.low;
    block.high[lane] = arm.high;
    for (std::size_t t = 0; t < arm.c.size(); ++t) {
      block.c[t][lane] = arm.c[t];
      block.integral[t][lane] = arm.c[t] * (1.0 / static_cast<double>(t + 1));
    }
    dof_.push_back(arm.dof);
  }
  for (auto* each : {&angle_, &within_, &arm_, &bend_, &part_}) each->resize(4 * blocks_.size());
  paths_.push_back({&path, first, dof_.size()});
  excursion_.push_back(0);
  return first;
}

void PackedArms::evaluate(std::span<const double> q) {
  static_assert(model::kArmTerms == 5);
  for (std::size_t k = 0; k < dof_.size(); ++k) angle_[k] = q[at(dof_[k])];
  std::size_t k = 0;
  for (const Block& block : blocks_)
    for (std::size_t lane = 0; lane < 4; lane += Lanes::size(), k += Lanes::size()) {
      const Lanes angle = load(&angle_[k]);
      const Lanes x = stdx::min(stdx::max(angle, load(&block.low[lane])), load(&block.high[lane]));
      Lanes r = load(&block.c[4][lane]), slope = 0, sum = load(&block.integral[4][lane]);
      const auto next = [&](std::size_t t) {
        slope = slope * x + r;
        r = r * x + load(&block.c[t][lane]);
        sum = sum * x + load(&block.integral[t][lane]);
      };
      next(3), next(2), next(1), next(0);
      stdx::where(x != angle, slope) = 0;
      x.copy_to(&within_[k], stdx::element_aligned);
      r.copy_to(&arm_[k], stdx::element_aligned);
      slope.copy_to(&bend_[k], stdx::element_aligned);
      (sum * x + r * (angle - x)).copy_to(&part_[k], stdx::element_aligned);
    }
  for (std::size_t n = 0; n < paths_.size(); ++n) {
    const auto& [path, first, end] = paths_[n];
    double excursion = 0;
    for (std::size_t i = first; i < end; ++i) excursion += part_[i];
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
      const auto change = [&](std::size_t i, int order, double other) {
        if (within_[i] != angle_[i]) return;
        arm_[i] += each.factor * other * order * power(within_[i], order - 1);
        if (order > 1) bend_[i] += each.factor * other * order * (order - 1) * power(within_[i], order - 2);
      };
      change(a, each.power_a, pb);
      change(b, each.power_b, pa);
    }
    excursion_[n] = excursion;
  }
}

}  // namespace handsim::engine
