#include "handsim/study/inverse/undone.h"

#include <algorithm>
#include <cmath>

#include "handsim/model/muscle.h"

namespace handsim::study {

namespace {

constexpr double kFull = 0.999, kReached = 0.01;  ///< of activations

}  // namespace

UndoneCauses::UndoneCauses(const model::Model& model, std::span<const std::size_t> axes)
    : model_(model),
      pull_(model.muscles.size() * as_index(model.dof_count())),
      waits_(as_index(model.dof_count())) {
  std::vector<bool> fused(as_index(model.dof_count()));
  for (const model::Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      fused[as_index(joint.first_dof) + a] = model::fused(joint.axes[a]);
  for (const std::size_t dof : axes) (fused[dof] ? fused_ : asked_).push_back(dof);
}

void UndoneCauses::beyond(std::size_t dof, double missing, double square) {
  double all = 0;
  const auto pull = [&](std::size_t m) {
    const double value = pull_[m * waits_.size() + dof];
    return value * missing > 0 ? std::abs(value) : 0.0;
  };
  for (std::size_t m = 0; m < model_.muscles.size(); ++m) all += pull(m);
  if (all == 0) sums_.no_balance += square;
  for (std::size_t m = 0; m < model_.muscles.size() && all > 0; ++m)
    if (pull(m) > 0) sums_.beyond[model_.muscles[m].name] += square * pull(m) / all;
}

void UndoneCauses::add(std::span<const double> q, std::span<const double> missing,
                       std::span<const double> best, std::span<const double> reached,
                       std::span<const double> reserve) {
  std::ranges::fill(pull_, 0.0);
  std::ranges::fill(waits_, static_cast<unsigned char>(0));
  for (std::size_t m = 0; m < model_.muscles.size(); ++m) {
    const model::Muscle& muscle = model_.muscles[m];
    const bool late = std::abs(best[m] - reached[m]) > kReached;
    if (!late && best[m] < kFull) continue;
    const model::PathState path = model::path_state(muscle.path, q);
    for (std::size_t i = 0; i < muscle.path.arms.size(); ++i) {
      const std::size_t dof = as_index(muscle.path.arms[i].dof);
      if (late) waits_[dof] = 1;
      if (best[m] >= kFull) pull_[m * waits_.size() + dof] = path.arm[i] * muscle.force * muscle.excitable;
    }
  }
  for (std::size_t i = 0; i < asked_.size(); ++i) {
    const double own = reserve[asked_[i]];
    all_ += own * own;
    beyond(asked_[i], missing[i], missing[i] * own);
    (waits_[asked_[i]] ? sums_.late : sums_.other) += (own - missing[i]) * own;
  }
  for (const std::size_t dof : fused_) {
    all_ += reserve[dof] * reserve[dof];
    sums_.other += reserve[dof] * reserve[dof];
  }
}

Undone UndoneCauses::shares() const {
  Undone out = sums_;
  if (all_ == 0) return out;
  for (auto& [name, share] : out.beyond) share /= all_;
  for (double* share : {&out.no_balance, &out.late, &out.other}) *share /= all_;
  return out;
}

}  // namespace handsim::study
