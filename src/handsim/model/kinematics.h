// Coordinates from poses and back (hinge, universal, slider: `Joint`; ball: rotation vector of R_FM; angles
// in (-pi, pi]), Jacobians, mass matrix; no engine. Torques: newton_euler.h; energy and momentum: energy.h.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "handsim/model/state.h"

namespace handsim::model {

/// Joint coordinates [rad] or [m], size dof_count(joint.kind), into `out`.
void joint_coordinates(const Joint& joint, const State& state, std::span<double> out);
/// Joint rates [rad/s] or [m/s] (ball: angular velocity of the child relative to the parent in F).
void joint_rates(const Joint& joint, const State& state, std::span<double> out);
/// Fills q and u of a state from its bodies.
void update_coordinates(const Model& model, State& state);

/// Position error of the joint's constraint [m]: between the anchor points (slider: across the axis).
double joint_gap(const Joint& joint, const State& state);

/// A joint's unit axis in the world: the first is fixed in `parent`, the second in `child` (q_WB of both).
Vec3 axis_in_world(const Joint& joint, std::size_t axis, const Quat& parent, const Quat& child);

/// X_FM at the given coordinates of this joint.
Pose joint_transform(const Joint& joint, std::span<const double> q);
/// Places the children of joints at coordinates and rates (size model.dof_count()), outward from bodies
/// without a parent joint, which stay; leaves loop-closing joints. Fills q and u, and rests the muscles.
void place_joints(const Model& model, std::span<const double> q, std::span<const double> u, State& state);
/// The poses alone, without velocities, coordinates and muscles.
void place_children(const Model& model, std::span<const double> q, State& state);
/// Fibre lengths and tensions of muscles that rest at the state's coordinates and activations.
void rest_muscles(const Model& model, State& state);
/// State with the given coordinates (size model.dof_count()), at rest. Bodies without a joint to a parent
/// have their zero pose. Loop-closing joints are not solved: State::q has the coordinates that result.
State state_at(const Model& model, std::span<const double> q);
/// State at the start: axes at their `initial` coordinates, drives at time 0, bodies with their velocities.
State initial_state(const Model& model);

/// Bodies that move freely: neither kinematic nor the child of a joint.
std::vector<int> free_bodies(const Model& model);

/// Velocity of a point [m/s] in rows 0 to 2, and angular velocity of its body [rad/s] in rows 3 to 5, in
/// world axes, by the velocities of a model: u, then v and w of each body of `free`, as BodyState has them.
/// Size 6 x (model.dof_count() + 6 free.size()). Columns of loop-closing joints are 0.
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;
/// @param body that the point moves with. @param point in the world [m]. @param free of free_bodies()
Jacobian jacobian(const Model& model, const State& state, int body, const Vec3& point,
                  std::span<const int> free = {});

/// Mass matrix M of some bodies for the velocities x of a Jacobian: their kinetic energy is x^T M x / 2.
/// Symmetric; positive definite for all bodies of a tree whose roots are kinematic or in `free`.
/// M = sum over bodies of m Jv^T Jv + Jw^T I Jw (Featherstone 2008, eq. 6.2 in Jacobian form).
Eigen::MatrixXd mass_matrix(const Model& model, const State& state, std::span<const int> bodies,
                            std::span<const int> free = {});

}  // namespace handsim::model
