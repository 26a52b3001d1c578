// Poses and external forces of an action, from arrays.
#pragma once

#include <vector>

#include <pybind11/numpy.h>

#include "handsim/engine/engine.h"
#include "handsim/python/arrays.h"

namespace handsim::python {

/// Rows of position [m] and quaternion w x y z, normalised here. @throws Error (input) for one of zero length
std::vector<Pose> poses_of(const Numbers& numbers, const char* name = "wrists");

/// Forces by name of the body or the object: each three numbers [N], or six with the moment [N m]; world
/// axes, at the centre of mass. @param size environments, whose rows the arrays have; 0: no rows, for a
/// simulation. @param out a list for each environment; empty without forces.
void read_forces(const py::object& forces, const model::Model& model, std::size_t size,
                 std::vector<std::vector<engine::BodyForce>>& out);

}  // namespace handsim::python
