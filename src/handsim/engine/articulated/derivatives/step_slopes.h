// Derivatives of one step of semi_implicit_euler. With the change of rates x = h du, the step satisfies
//   F = h ID(q, u, x/h) - h forces(q, u) + W x - J^T p = 0,  u' = u + x,  q' = q + h u'
// (balls and free bodies turn by exp(h w')), so that by the implicit function theorem dx = -K^-1 (dF/dq dq +
// dF/du du + ...), with K = dF/dx: inertia, implicit springs and dampers, tendons, contacts. A coordinate on
// its stop has its bound in place of its row.
// Found at the start of the step, with the solution; nothing of the step changes but that contacts are solved
// to rounding first, where a step itself ends with an error of 1e-4 m/s^2.
#pragma once

#include <optional>
#include <vector>

#include "handsim/engine/articulated/derivatives/contact_slopes.h"
#include "handsim/engine/articulated/derivatives/step_derivatives.h"

namespace handsim::engine::articulated {

class StepSlopes {
 public:
  /// All arguments must outlive this object. @param muscles, contact null where the engine has none
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
    const NodeView& view;
    double stiffness = 0, damping = 0;  ///< of tissue
    bool held() const { return *view.side != 0; }
    double room(double at) const {
      return std::min(at - *view.low, *view.high - at);
    }  ///< to the nearer stop
    bool in_range() const { return *view.servo_limit > 0 && *view.saturated == 0; }
  };
  void order();
  void compute_inertia();
  void add_singles(StepDerivatives& out);
  void add_lone(int node);
  void add_forces(const StepInput& input);
  void add_muscles(const StepInput& input, const model::State& start, StepDerivatives& out);
  void differentiate_activations(const StepInput& input, const model::State& start, StepDerivatives& out);
  Eigen::VectorXd tendon_torques(const StepInput& input);
  void hold(const Single& each);
  std::string name_of(const Single& each) const;
  void solve(StepDerivatives& out);
  void collect_groups();
  void compute_loads(StepDerivatives& out);
  void solve_group(const std::vector<int>& group, StepDerivatives& out);
  void move(Eigen::MatrixXd& of, bool of_state) const;
  void compute_turns();

  const model::Model& model_;
  Settings settings_;
  Mechanism& mechanism_;
  MuscleCoupling* muscles_;
  DynamicsSlopes tree_;
  std::optional<ContactSlopes> contacts_;
  std::vector<Single> singles_;
  std::vector<int> dof_of_;                                  ///< of the tree, of each coordinate
  std::vector<int> free_bodies_;                             ///< of Model
  std::vector<std::size_t> rate_;                            ///< of each dof, in Mechanism::u()
  std::vector<double> du_, q_, u_;                           ///< of each dof; by Model::dof_count()
  Eigen::MatrixXd K_, by_q_, by_u_, by_activation_, loads_;  ///< by_u_: later K - dF/du
  std::vector<std::size_t> group_;  ///< of each coordinate: another of its group, or itself
  std::vector<std::vector<int>> groups_;
  std::vector<char> held_;                                          ///< coordinates on their stop
  std::vector<std::pair<std::size_t, std::array<Mat3, 2>>> turns_;  ///< exp(h w') and h times its Jacobian
};

}  // namespace handsim::engine::articulated
