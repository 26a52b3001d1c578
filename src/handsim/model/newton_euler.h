// Inverse dynamics by the recursive Newton-Euler method (Featherstone 2008, chapter 5), in world axes: joint
// torques and joint reactions that a given motion needs. For models without loops.
#pragma once

#include <span>
#include <vector>

#include "handsim/model/state.h"

namespace handsim::model {

/// Motion of a body with its accelerations.
struct BodyMotion : BodyState {
  Vec3 a = Vec3::Zero();      ///< of the centre of mass [m/s^2]
  Vec3 alpha = Vec3::Zero();  ///< world axes [rad/s^2]
};

/// A force [N] and moment [N m] in world axes: a load at the mass centre, a reaction at the child frame.
struct Wrench {
  Vec3 force = Vec3::Zero();
  Vec3 moment = Vec3::Zero();
};

class NewtonEuler {
 public:
  /// The model must outlive this object. @param gravity [m/s^2]. @throws Error (input) for a model with loops
  NewtonEuler(const Model& model, const Vec3& gravity);

  /// Bodies without a parent joint move as in the state, unaccelerated; driven ones as at `time` [s].
  void set_roots(const State& state, double time);
  /// Places all other bodies by coordinates, rates and accelerations, each of size model.dof_count().
  void place(std::span<const double> q, std::span<const double> u, std::span<const double> change);
  /// Sets poses and velocities to those of the later of two states, accelerations to the mean between both.
  void place(const State& from, const State& to);

  /// Torques along all coordinates for the motion of place() [N m] or [N], size model.dof_count(): what acts
  /// beside gravity and loads. @param loads on bodies from outside, as Model::bodies, or empty
  std::span<const double> torques(std::span<const Wrench> loads = {});
  /// The wrench of the parent on the child in each joint, as Model::joints, found by the last torques().
  std::span<const Wrench> reactions() const { return reactions_; }
  std::span<const BodyMotion> bodies() const { return bodies_; }

 private:
  void place_child(const Joint& joint, std::span<const double> q, std::span<const double> u,
                   std::span<const double> change);

  const Model& model_;
  Vec3 gravity_;
  std::vector<BodyMotion> bodies_;
  std::vector<Wrench> sums_;  ///< by body: of it and all bodies beyond, at its centre of mass
  std::vector<Wrench> reactions_;
  std::vector<double> torques_;
};

/// Torques [N m] or [N] that accelerate a state's motion, size model.dof_count(): NewtonEuler::torques().
/// @param change of the rates [rad/s^2] or [m/s^2], size model.dof_count(). @throws as NewtonEuler
std::vector<double> inverse_dynamics(const Model& model, const State& state, std::span<const double> change,
                                     const Vec3& gravity);

}  // namespace handsim::model
