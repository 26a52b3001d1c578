// One island of a model (bodies that joints connect; bodies with prescribed motion do not count) as a
// differential-algebraic system in maximal coordinates:
//   x' = T(x) u,  M u' = f(x, u, t) - G(x, t)^T lambda,  g(x, t) = 0,  G u + g_t = 0.
// x holds p (world) and q (unit quaternion x, y, z, w) of each body, u its v in world axes, w in body axes: M
// is constant. World, kinematic and driven bodies are functions of time. Contains no integration method.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "handsim/engine/engine.h"
#include "handsim/engine/multibody/rows.h"

namespace handsim::engine {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;
using Index = Eigen::Index;

inline constexpr Index kPoseSize = 7;
inline constexpr Index kTwistSize = 6;

/// A spring-damper on one joint coordinate.
struct TissueRow {
  ConstraintRow row;     ///< the row of the coordinate
  double deviation = 0;  ///< coordinate minus rest position
  model::Tissue tissue;
};

class System {
 public:
  /// @param bodies the island's bodies; @param joints those between them and to bodies of prescribed motion.
  System(const model::Model& model, const Settings& settings, std::vector<int> bodies,
         std::vector<const model::Joint*> joints);

  Index body_count() const { return static_cast<Index>(bodies_.size()); }
  Index constraint_count() const { return constraint_count_; }
  const model::Model& model() const { return model_; }

  /// Sets pose and velocity of driven bodies to those of their drives at a time [s]; changes nothing else.
  void place_driven(double time, model::KeySide side, model::State& state) const;
  /// Gives driven bodies constant velocities that reach the poses of their drives at `end`, after `step` [s].
  void set_driven_velocities(double end, double step, model::State& state) const;
  /// Time of the first keyframe of a drive after a time [s]; infinite if there is none.
  double next_key(double time) const;

  Vector positions(const model::State& state) const;
  Vector velocities(const model::State& state) const;
  void set_positions(const Vector& x, model::State& state) const;  ///< normalises q
  /// Uses the poses of the state, because w is in body axes.
  void set_velocities(const Vector& u, model::State& state) const;
  /// Moves the bodies by a displacement d: p += d, and q is rotated by the rotation vector of d (body axes).
  void displace(const Vector& displacement, model::State& state) const;
  /// Moves the bodies of `after` by a displacement in the body axes of `before`, and adds displacement / step
  /// to their velocities: the result of an impulse at the start of a step [s].
  void displace_by_impulse(const Vector& displacement, const model::State& before, double step,
                           model::State& after) const;
  /// Copies only the island's bodies.
  void copy_bodies(const model::State& from, model::State& to) const;
  /// T(x) u, size 7 per body; x need not be unit.
  Vector position_rates(const Vector& x, const Vector& u) const;

  /// Constraint rows in the order of the joints.
  void constraints(const model::State& state, std::vector<ConstraintRow>& rows) const;
  /// G, constraint rows by velocities.
  Matrix jacobian(const std::vector<ConstraintRow>& rows, const model::State& state) const;
  /// out += scale * row^T.
  void add_transposed(const ConstraintRow& row, double scale, const model::State& state, Vector& out) const;
  /// The part of a row's rate that is due to the island's bodies, at velocities u.
  double own_rate(const ConstraintRow& row, const Vector& u, const model::State& state) const;
  /// The joint of a constraint row.
  const model::Joint& joint_of_row(Index row) const { return *joint_of_row_[as_index(row)]; }
  const std::string& body_name(Index slot) const;

  /// Gravity, joint torques (size model.dof_count() or empty) and exact gyroscopic torques; no tissue.
  Vector forces(const model::State& state, std::span<const double> torques) const;
  /// Damping of coordinates beside that of tissue, by Model::dof_count() [N m s/rad]; must outlive this
  /// object.
  void set_drag(std::span<const double> damping) { drag_ = damping; }
  /// Active spring-dampers: passive tissue in effect, and drag.
  std::vector<TissueRow> tissue(const model::State& state) const;
  /// `forces` plus those of tissue.
  Vector all_forces(const model::State& state, std::span<const double> torques) const;

  /// Inertia of one body in body axes, a block of the mass matrix.
  const Mat3& inertia(Index slot) const { return inertia_[as_index(slot)]; }
  Matrix mass_matrix() const;
  Vector times_mass(const Vector& u) const;     ///< M u
  Vector over_mass(const Vector& force) const;  ///< M^-1 force
  /// L^-T z, with M = L L^T.
  Vector from_scaled(const Vector& z) const;
  /// G L^-T: the Jacobian by the velocities z = L^T u, for which z . z is twice the kinetic energy.
  Matrix scaled(const Matrix& jacobian) const;

 private:
  const model::BodyState& body(const model::State& state, Index slot) const;
  model::BodyState& body(model::State& state, Index slot) const;

  const model::Model& model_;
  Settings settings_;
  std::vector<int> bodies_;                    ///< model body of each slot
  std::vector<std::optional<Index>> slot_of_;  ///< slot of each model body, if it has one
  std::vector<const model::Joint*> joints_;
  std::vector<const model::Joint*> joint_of_row_;
  std::vector<double> mass_;
  std::vector<Mat3> inertia_, inverse_inertia_, root_;  ///< root_: L^-T of the inertia
  Index constraint_count_ = 0;
  std::span<const double> drag_;
};

/// The islands of a model, which can be integrated separately.
std::vector<System> islands(const model::Model& model, const Settings& settings);

}  // namespace handsim::engine
