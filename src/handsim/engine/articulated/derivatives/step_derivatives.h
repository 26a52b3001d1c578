// The derivatives of a step of the articulated engine, as a caller asks for them and gets them.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "handsim/engine/engine.h"

namespace handsim::engine::articulated {

/// Derivatives by the state of what a controller drives each coordinate with: of a torque, or of a servo's
/// stiffness x error + feed. Vectors have the size Model::dof_count(), or are empty.
struct Feedback {
  std::vector<double> by_q;
  std::vector<char> compensated;  ///< coordinates whose drive carries the weight
  Vec3 gravity = Vec3::Zero();    ///< that it carries
};

/// A request for the derivatives of a step, and its answer. Rows and columns are coordinates: those of
/// joints, as Model::dof_count(), then of each free body the turn (3) and the shift (3) in world axes. Turns
/// of balls and free bodies are rotation vectors added before: q' = exp(turn) q, for balls in the parent's
/// axes.
struct StepDerivatives {
  Feedback feedback;
  std::vector<int> forced;  ///< bodies of Model, for `by_force`
  bool step_only = false;   ///< no derivatives: only the step, with contacts solved to rounding

  int coordinates = 0;
  std::vector<int> free_bodies;  ///< of Model
  /// Derivatives of (q', u') at the step's end, 2 n rows: by (q, u); by generalised forces [N m] or [N]; by
  /// force, then moment, on each forced body at its mass centre, world axes; by gravity [m/s^2]; by
  /// excitations; by activations at the start.
  Eigen::MatrixXd by_state, by_torque, by_force, by_gravity, by_excitation, by_activation;
  /// Derivatives of each muscle's activation at the end by its own excitation and activation at the start.
  Eigen::VectorXd activation_by_excitation, activation_by_activation;
  std::vector<char> driven;        ///< of each coordinate: no servo of its is at its limit
  std::vector<std::string> notes;  ///< derivatives that hold to one side, or without a part
};

}  // namespace handsim::engine::articulated
