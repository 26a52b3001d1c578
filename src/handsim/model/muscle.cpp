#include "handsim/model/muscle.h"

#include <algorithm>

#include "handsim/core/index.h"

namespace handsim::model {

namespace {

/// 1 / (k + 1), of an integral's terms.
constexpr std::array<double, kArmTerms> kIntegral = {1, 1.0 / 2, 1.0 / 3, 1.0 / 4, 1.0 / 5};

double power(double x, int n) {
  double out = 1;
  for (; n > 0; --n) out *= x;
  return out;
}

}  // namespace

PathState path_state(const TendonPath& path, std::span<const double> q) {
  PathState out;
  // Filled up to the path's arms.
  std::array<double, kMostArms> within;
  std::array<bool, kMostArms> inside;
  for (std::size_t i = 0; i < path.arms.size(); ++i) {
    const MomentArm& arm = path.arms[i];
    const double angle = q[as_index(arm.dof)];
    const double x = within[i] = std::clamp(angle, arm.low, arm.high);
    inside[i] = x == angle;
    // Most polynomials have fewer terms than there is room for.
    std::size_t terms = kArmTerms;
    while (terms > 0 && arm.c[terms - 1] == 0) --terms;
    double sum = 0, r = 0, slope = 0;
    for (std::size_t k = terms; k-- > 0;) {
      slope = slope * x + r;
      r = r * x + arm.c[k];
      sum = sum * x + arm.c[k] * kIntegral[k];
    }
    out.arm[i] = r;
    out.bend[i] = inside[i] ? slope : 0;
    out.excursion += sum * x + r * (angle - x);
  }
  for (const ArmProduct& each : path.products) {
    const auto a = as_index(each.a), b = as_index(each.b);
    const double pa = power(within[a], each.power_a), pb = power(within[b], each.power_b);
    out.excursion += each.factor * pa * pb;
    const auto add = [&](std::size_t i, int n, double other) {
      if (!inside[i]) return;
      out.arm[i] += each.factor * other * n * power(within[i], n - 1);
      if (n > 1) out.bend[i] += each.factor * other * n * (n - 1) * power(within[i], n - 2);
    };
    add(a, each.power_a, pb);
    add(b, each.power_b, pa);
  }
  return out;
}

double hold(TendonPath& path, int dof, double angle) {
  const auto arm = std::ranges::find_if(path.arms, [&](const MomentArm& each) { return each.dof == dof; });
  if (arm == path.arms.end()) return 0;
  const int held = static_cast<int>(arm - path.arms.begin());
  std::vector<double> q(as_index(dof) + 1);
  q.back() = angle;
  MomentArm alone = *arm;
  const double out = path_state({{alone}, {}}, q).excursion, x = std::clamp(angle, arm->low, arm->high);
  std::erase_if(path.products, [&](ArmProduct& each) {
    if (each.b == held) std::swap(each.a, each.b), std::swap(each.power_a, each.power_b);
    const bool with = each.a == held;
    // factor x^n y^m is an arm m factor x^n y^(m-1) of y.
    if (with)
      path.arms[as_index(each.b)].c[as_index(each.power_b) - 1] +=
          each.power_b * each.factor * power(x, each.power_a);
    each.a -= each.a > held ? 1 : 0;
    each.b -= each.b > held ? 1 : 0;
    return with;
  });
  path.arms.erase(arm);
  return out;
}

bool any_elastic(std::span<const Muscle> muscles) {
  return std::ranges::any_of(muscles, [](const Muscle& each) { return each.tendon_strain.has_value(); });
}

bool any_short_range(std::span<const Muscle> muscles) {
  return std::ranges::any_of(muscles, [](const Muscle& each) { return each.short_range.has_value(); });
}

}  // namespace handsim::model
