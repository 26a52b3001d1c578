// Rows of joints: values of constraints and coordinates, and their derivatives by the two bodies' velocities.
#pragma once

#include <vector>

#include "handsim/model/state.h"

namespace handsim::engine {

/// A scalar function of two bodies' poses. Its rate is parent_v . v_P + parent_w . w_P + child_v . v_C +
/// child_w . w_C, velocities in world axes; a multiplier's forces and torques have these directions.
struct ConstraintRow {
  int parent = 0;    ///< body of the model
  int child = 0;     ///< body of the model
  double value = 0;  ///< [m], or the cosine of an angle that the constraint keeps at 90 degrees
  Vec3 parent_v = Vec3::Zero();
  Vec3 parent_w = Vec3::Zero();
  Vec3 child_v = Vec3::Zero();
  Vec3 child_w = Vec3::Zero();
};

/// Constraint rows of a joint kind: hinge 5, universal 4, ball 3, slider 5.
inline int constraint_count(model::JointKind kind) { return 6 - model::dof_count(kind); }

/// Appends the constraint rows of a joint; their values are zero if it is closed. They make the anchors
/// coincide (along the world axes, or perpendicular to a slider's axis) and keep axes perpendicular.
void append_constraints(const model::Joint& joint, const model::State& state,
                        std::vector<ConstraintRow>& rows);

/// The row of one joint coordinate: its rate is that of the coordinate, its value is not set.
ConstraintRow coordinate_row(const model::Joint& joint, int coordinate, const model::State& state);

/// Rate of a row at a state's velocities.
double rate(const ConstraintRow& row, const model::State& state);

}  // namespace handsim::engine
