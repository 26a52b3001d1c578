// Joint coordinates from body poses and back, without any engine. Coordinates of a joint: hinge,
// universal, slider as in `Joint`; ball: the rotation vector of R_FM. Angles are in (-pi, pi].
#pragma once

#include <span>
#include <vector>

#include "handsim/model/state.h"

namespace handsim::model {

/// Joint coordinates [rad] or [m], size dof_count(joint.kind), into `out`.
void joint_coordinates(const Joint& joint, const State& state, std::span<double> out);
/// Joint rates [rad/s] or [m/s] (ball: angular velocity of the child relative to the parent in F).
void joint_rates(const Joint& joint, const State& state, std::span<double> out);
/// Fills q and u of a state from its bodies.
void update_coordinates(const Model& model, State& state);

/// Position error of the joint's constraint [m]: distance between the two anchor points (slider: its
/// component perpendicular to the axis).
double joint_gap(const Joint& joint, const State& state);

/// X_FM at the given coordinates of this joint.
Pose joint_transform(const Joint& joint, std::span<const double> q);
/// Places the children of joints at the given coordinates and rates (each of size model.dof_count()),
/// outward from the bodies without a parent joint, which keep their pose and velocity. Loop-closing joints
/// are not solved. Fills q and u, and rests the muscles there.
void place_joints(const Model& model, std::span<const double> q, std::span<const double> u, State& state);
/// Fibre lengths and tensions of muscles that rest at the state's coordinates and activations.
void rest_muscles(const Model& model, State& state);
/// State with the given coordinates (size model.dof_count()), at rest. Bodies without a joint to a parent
/// have their zero pose. Loop-closing joints are not solved: State::q has the coordinates that result.
State state_at(const Model& model, std::span<const double> q);
/// State at the start: every axis at its `initial` coordinate, drives at time 0, bodies at their initial
/// velocities.
State initial_state(const Model& model);

}  // namespace handsim::model
