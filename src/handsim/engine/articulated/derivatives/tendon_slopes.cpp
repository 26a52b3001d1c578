// Tendons in the derivatives of a step: their torques start - B x at its solution, by differences of fourth
// order of the tendons' own kernel.
#include <algorithm>
#include <cmath>

#include "handsim/engine/articulated/derivatives/step_slopes.h"

namespace handsim::engine::articulated {

namespace {

constexpr double kAngle = 1e-6, kRate = 1e-5, kActivation = 1e-6;  ///< Steps of the differences.
/// Slopes to both sides, or at two steps, that differ by this share tell of a kink of a curve here.
constexpr double kKink = 1e-2;

/// Calls f(offset, weight) for a derivative of fourth order.
template <class F>
void difference(double size, const F& f) {
  f(size, 8 / (12 * size));
  f(-size, -8 / (12 * size));
  f(2 * size, -1 / (12 * size));
  f(-2 * size, 1 / (12 * size));
}

}  // namespace

/// By dof of the tree, from q_ and u_.
Eigen::VectorXd StepSlopes::tendon_torques(const StepInput& input) {
  const std::span<const double> given = muscles_->begin_step(q_, u_, input);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(tree_.size());
  for (const Single& each : singles_) out[each.dof] = given[each.coordinate];
  muscles_->each_slope([&](int i, int j, double slope) {
    out[i] -= slope * settings_.step * du_[as_index(j)];
    if (i != j) out[j] -= slope * settings_.step * du_[as_index(i)];
  });
  return out;
}

void StepSlopes::add_muscles(const StepInput& input, const model::State& start, StepDerivatives& out) {
  for (const Single& each : singles_) {
    q_[each.coordinate] = *each.view.q;
    u_[each.coordinate] = *each.view.u;
  }
  const double h = settings_.step;
  const auto torques = [&] {
    muscles_->reset(start);
    return tendon_torques(input);
  };
  const Eigen::VectorXd here = torques();
  for (const Single& each : singles_) {
    if (!muscles_->pulls(each.coordinate)) continue;
    const auto by = [&](double& value, double size, Eigen::MatrixXd& to) {
      const double kept = value;
      Eigen::VectorXd bend = -2 * here, slope = Eigen::VectorXd::Zero(here.size()), narrow = slope;
      difference(size, [&](double offset, double weight) {
        value = kept + offset;
        const Eigen::VectorXd found = torques();
        if (std::abs(offset) == size) {
          bend += found;
          narrow += found / (2 * offset);
        }
        slope += weight * found;
      });
      value = kept;
      to.col(each.dof) -= h * slope;
      if (std::max(bend.norm(), size * (narrow - slope).norm()) > kKink * size * slope.norm())
        out.notes.push_back(name_of(each) + ": a kink of its tendons' curves: mean of both sides");
    };
    by(q_[each.coordinate], kAngle, by_q_);
    by(u_[each.coordinate], kRate, by_u_);
  }
  differentiate_activations(input, start, out);
  // The step goes on.
  muscles_->reset(start);
  muscles_->begin_step(q_, u_, input);
}

/// Each muscle has an activation of its own: those of all at once, then what each pulls.
void StepSlopes::differentiate_activations(const StepInput& input, const model::State& start,
                                           StepDerivatives& out) {
  const std::size_t count = settings_.effects.has(model::Effect::muscles) ? model_.muscles.size() : 0;
  const auto size = static_cast<Eigen::Index>(count);
  out.activation_by_activation = out.activation_by_excitation = Eigen::VectorXd::Zero(size);
  by_activation_.setZero(tree_.size(), size);
  if (count == 0) return;
  model::State state = start, end = start;
  std::vector<double> excitations(input.excitations.begin(), input.excitations.end());
  excitations.resize(count);
  StepInput changed = input;
  changed.excitations = excitations;
  const auto add_end = [&](double weight, Eigen::VectorXd& to) {
    muscles_->reset(state);
    muscles_->begin_step(q_, u_, changed);
    muscles_->store_state(end);
    for (std::size_t i = 0; i < count; ++i) to[static_cast<Eigen::Index>(i)] += weight * end.activation[i];
  };
  difference(kActivation, [&](double offset, double weight) {
    for (std::size_t i = 0; i < count; ++i) state.activation[i] = start.activation[i] + offset;
    add_end(weight, out.activation_by_activation);
  });
  state.activation = start.activation;
  difference(kActivation, [&](double offset, double weight) {
    for (double& each : excitations) each += offset;
    add_end(weight, out.activation_by_excitation);
    for (double& each : excitations) each -= offset;
  });
  for (std::size_t i = 0; i < count; ++i) {
    const double slope = out.activation_by_activation[static_cast<Eigen::Index>(i)];
    difference(kActivation, [&](double offset, double weight) {
      state.activation[i] = start.activation[i] + offset;
      muscles_->reset(state);
      by_activation_.col(static_cast<Eigen::Index>(i)) -=
          settings_.step * weight / slope * tendon_torques(changed);
    });
    state.activation[i] = start.activation[i];
  }
}

}  // namespace handsim::engine::articulated
