// Joints as rows: each constraint and each joint coordinate of a model as a value and the directions along
// which the two bodies' velocities change it. Nothing is stored; a state goes in, rows come out.
#pragma once

#include <vector>

#include "handsim/model/state.h"

namespace handsim::engine {

/// A scalar function of two bodies' poses. Its rate is parent_v . v_P + parent_w . w_P + child_v . v_C +
/// child_w . w_C with velocities in world axes, so a multiplier acts on the bodies along the same four.
struct Row {
  int parent = 0;    ///< body of the model
  int child = 0;     ///< body of the model
  double value = 0;  ///< [m], or the cosine of an angle that is to be right
  Vec3 parent_v = Vec3::Zero();
  Vec3 parent_w = Vec3::Zero();
  Vec3 child_v = Vec3::Zero();
  Vec3 child_w = Vec3::Zero();
};

/// Constraint rows of a joint kind: hinge 5, universal 4, ball 3, slider 5.
int constraint_count(model::JointKind kind);

/// Appends the constraint rows of a joint, zero where the joint is whole: coincidence of the anchors (along
/// the world's axes, or across a slider's axis), and axes that must stay perpendicular.
void append_constraints(const model::Joint& joint, const model::State& state, std::vector<Row>& rows);

/// Row whose rate is the rate of one coordinate, without its value.
Row coordinate_row(const model::Joint& joint, int coordinate, const model::State& state);

/// Rate of a row at a state's velocities.
double rate(const Row& row, const model::State& state);

}  // namespace handsim::engine
