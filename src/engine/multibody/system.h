// One island of a model (bodies that joints connect; bodies with prescribed motion do not count) as a
// differential-algebraic system in maximal coordinates:
//   x' = T(x) u,  M u' = f(x, u, t) - G(x, t)^T lambda,  g(x, t) = 0,  G u + g_t = 0.
// x holds p (world) and q (unit quaternion x, y, z, w) of each body, u its v in world axes and w in body
// axes, so that M is constant. World, kinematic and driven bodies enter as functions of time.
// Knows no integration method.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Dense>

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
  Row row;               ///< its rate is the coordinate's
  double deviation = 0;  ///< coordinate less the rest position
  model::Tissue tissue;
};

class System {
 public:
  /// @param bodies indices of the island's bodies; @param joints its joints, to each other and to bodies with
  /// prescribed motion.
  System(const model::Model& model, const Settings& settings, std::vector<int> bodies,
         std::vector<const model::Joint*> joints);

  Index body_count() const { return static_cast<Index>(bodies_.size()); }
  Index constraint_count() const { return constraint_count_; }
  const model::Model& model() const { return model_; }

  /// Puts driven bodies where their drives have them at a time; everything else is left alone.
  void place_driven(double time, model::KeySide side, model::State& state) const;
  /// Gives driven bodies the constant velocities that bring them from where they are to where their drives
  /// have them `step` later, at `end`.
  void set_driven_velocities(double end, double step, model::State& state) const;
  /// The first keyframe of a drive after a time [s]; infinite where there is none.
  double next_key(double time) const;

  Vector positions(const model::State& state) const;
  Vector velocities(const model::State& state) const;
  void set_positions(const Vector& x, model::State& state) const;  ///< q is made unit
  /// Needs the poses set first: w comes in body axes.
  void set_velocities(const Vector& u, model::State& state) const;
  /// Moves the bodies by a displacement: p += d, q turned by the rotation vector d (body axes).
  void displace(const Vector& displacement, model::State& state) const;
  /// Moves the bodies by a displacement in the body axes of `before`, and changes their velocities by what
  /// makes it in `step` [s].
  void push(const Vector& displacement, const model::State& before, double step, model::State& after) const;
  /// Copies the island's bodies, and nothing else.
  void copy_bodies(const model::State& from, model::State& to) const;
  /// T(x) u, size 7 per body; x need not be unit.
  Vector position_rates(const Vector& x, const Vector& u) const;

  /// Constraint rows in the order of the joints.
  void constraints(const model::State& state, std::vector<Row>& rows) const;
  /// G, constraint rows by velocities.
  Matrix jacobian(const std::vector<Row>& rows, const model::State& state) const;
  /// out += scale * row^T.
  void add_transposed(const Row& row, double scale, const model::State& state, Vector& out) const;
  /// The part of a row's rate that the island's own bodies make, at velocities u.
  double own_rate(const Row& row, const Vector& u, const model::State& state) const;
  /// The joint of a constraint row.
  const model::Joint& joint_of_row(Index row) const { return *joint_of_row_[static_cast<std::size_t>(row)]; }
  const std::string& body_name(Index slot) const;

  /// Gravity, joint torques (size model.dof_count() or empty) and exact gyroscopic torques; no tissue.
  Vector forces(const model::State& state, std::span<const double> torques) const;
  /// Spring-dampers in force; empty without the passive_tissue effect.
  std::vector<TissueRow> tissue(const model::State& state) const;
  /// `forces` with the tissue's.
  Vector all_forces(const model::State& state, std::span<const double> torques) const;

  /// Block of the mass matrix of one body: inertia in body axes.
  const Mat3& inertia(Index slot) const { return inertia_[static_cast<std::size_t>(slot)]; }
  Matrix mass_matrix() const;
  Vector times_mass(const Vector& u) const;
  Vector over_mass(const Vector& force) const;
  /// L^-T z and L^-1 f with M = L L^T.
  Vector from_scaled(const Vector& z) const;
  /// G L^-T: the Jacobian in velocities scaled so that their square is twice the kinetic energy.
  Matrix scaled(const Matrix& jacobian) const;

 private:
  const model::BodyState& body(const model::State& state, Index slot) const;
  model::BodyState& body(model::State& state, Index slot) const;

  const model::Model& model_;
  Settings settings_;
  std::vector<int> bodies_;     ///< model body of each slot
  std::vector<Index> slot_of_;  ///< slot of each model body, or kNoSlot
  std::vector<const model::Joint*> joints_;
  std::vector<const model::Joint*> joint_of_row_;
  std::vector<double> mass_;
  std::vector<Mat3> inertia_, inverse_inertia_, root_;  ///< root: L^-T of the inertia
  Index constraint_count_ = 0;
};

/// Islands of a model, each to be integrated on its own.
std::vector<System> islands(const model::Model& model, const Settings& settings);

}  // namespace handsim::engine
