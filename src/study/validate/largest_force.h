// Largest forces that a hand's muscles hold with fingertips at a pose: of one fingertip on a surface, and of
// thumb and finger on what they pinch; private to this folder.
#pragma once

#include "handsim/study/validate/subject.h"

namespace handsim::study {

/// The largest force along a direction that activations of 0 to 1 hold at a fingertip without a moment [N].
/// @param of its `segment`: the force is at that segment's middle; its `friction` lets the force lean from
/// the direction, as on a surface with that friction
double largest_tip_force(const Subject& subject, const Measurement& of);

/// The largest force between the round ends of the thumb and of a finger, along the line of their centres
/// [N]. @throws Error (physics) where the ends do not face each other
double largest_pinch_force(const Subject& subject, const Measurement& of);

}  // namespace handsim::study
