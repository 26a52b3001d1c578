// Derivatives of one step of semi_implicit_euler. With the change of rates x = h du, the step satisfies
//   F = h ID(q, u, x/h) - h forces(q, u) + W x - J^T p = 0,  u' = u + x,  q' = q + h u' (balls and free
//   bodies
// turn by exp(h w')), so that by the implicit function theorem dx = -K^-1 (dF/dq dq + dF/du du + ...), with
// K = dF/dx: inertia, implicit springs and dampers, tendons, contacts. A coordinate on its stop has its bound
// in place of its row.
// Found at the start of the step, with the solution; nothing of the step changes but that contacts are solved
// to rounding first, where a step itself ends with an error of 1e-4 m/s^2.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "handsim/engine/articulated/derivatives/contact_slopes.h"

namespace handsim::engine::articulated {

/// How a controller's drive of each coordinate, torque or servo, changes with the state; by
/// Model::dof_count() or empty. Derivatives of a servo's stiffness x error + feed.
struct Feedback {
  std::vector<double> by_q, by_u;
  std::vector<char> compensated;  ///< coordinates whose drive carries the weight
  Vec3 gravity = Vec3::Zero();    ///< that it carries
};

/// What is asked for, and the answer. Rows and columns are coordinates: those of joints, as
/// Model::dof_count(), then of each free body the turn (3) and the shift (3) in world axes. Turns of balls
/// and free bodies are rotation vectors added before: q' = exp(turn) q, for balls in the parent's axes.
struct StepDerivatives {
  Feedback feedback;
  std::vector<int> forced;  ///< bodies of Model, for `by_force`
  bool step_only = false;   ///< no derivatives: only the step, with contacts solved to rounding

  int coordinates = 0;
  std::vector<int> free_bodies;  ///< of Model
  /// Of (q', u'), 2 n rows. By (q, u); by generalised forces on coordinates [N m] or [N]; by force, then
  /// moment, on each forced body at its mass centre, world axes; by gravity [m/s^2]; by excitations, and by
  /// activations at the start.
  Eigen::MatrixXd by_state, by_torque, by_force, by_gravity, by_excitation, by_activation;
  /// Of activations at the end, by excitations and by activations at the start: each by its own.
  Eigen::VectorXd activation_by_excitation, activation_by_activation;
  std::vector<char> driven;        ///< of each coordinate: no servo of its is at its limit
  std::vector<std::string> notes;  ///< derivatives that hold to one side, or without a part
};

class StepSlopes {
 public:
  /// All must outlive this. @param muscles, contact null: none
  StepSlopes(const model::Model& model, const Settings& settings, Mechanism& mechanism,
             MuscleCoupling* muscles, ContactDynamics* contact);

  /// Solves contacts to rounding. @returns false where that fails
  bool refine();
  /// @param contacts of the step. @param start the state it starts from
  void find(const StepInput& input, const model::State& start, bool contacts, StepDerivatives& out);

 private:
  struct Single {
    int dof = 0;
    std::size_t coordinate = 0;
    AxisView axis;
    const double *q = nullptr, *u = nullptr;
    double stiffness = 0, damping = 0;  ///< of tissue
    bool held() const { return *axis.side != 0; }
    bool in_range() const { return *axis.servo_limit > 0 && *axis.saturated == 0; }
  };
  void order();
  void find_inertia();
  void add_singles(StepDerivatives& out);
  void add_lone(int node);
  void add_forces(const StepInput& input);
  void add_muscles(const StepInput& input, const model::State& start, StepDerivatives& out);
  void differentiate_activations(const StepInput& input, const model::State& start, StepDerivatives& out);
  Eigen::VectorXd tendon_torques(const StepInput& input);
  void hold(const Single& each);
  void solve(StepDerivatives& out);
  Eigen::MatrixXd response(const Eigen::MatrixXd& by) const;
  Eigen::MatrixXd stepped(const Eigen::MatrixXd& x, bool of_state) const;
  void find_turns();

  const model::Model& model_;
  Settings settings_;
  Mechanism& mechanism_;
  MuscleCoupling* muscles_;
  DynamicsSlopes tree_;
  std::optional<ContactSlopes> contacts_;
  std::vector<Single> singles_;
  std::vector<int> dof_of_;         ///< of the tree, of each coordinate
  std::vector<int> free_bodies_;    ///< of Model
  std::vector<std::size_t> rate_;   ///< of each dof, in Mechanism::u()
  std::vector<double> du_, q_, u_;  ///< of each dof; by Model::dof_count()
  Eigen::MatrixXd K_, by_q_, by_u_, inverse_, by_activation_;
  std::vector<std::pair<std::size_t, std::array<Mat3, 2>>> turns_;  ///< exp(h w') and h times its Jacobian
};

}  // namespace handsim::engine::articulated
