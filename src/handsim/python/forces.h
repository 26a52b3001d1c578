// Poses and external forces of an action, from arrays.
#pragma once

#include <vector>

#include <pybind11/numpy.h>

#include "handsim/engine/engine.h"
#include "handsim/python/arrays.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::python {

/// Rows of position [m] and quaternion w x y z, normalised here. @throws Error (input) for one of zero length
std::vector<Pose> poses_of(const Numbers& numbers, const char* name = "wrists");

/// Forces by name of the body or the object: each three numbers [N], or six with the moment [N m]; world
/// axes, at the centre of mass. @param size environments, whose rows the arrays have; 0: no rows, for a
/// simulation. @param out a list for each environment; empty without forces.
void read_forces(const py::object& forces, const model::Model& model, std::size_t size,
                 std::vector<std::vector<engine::BodyForce>>& out);

/// The arrays of an action, which keep their numbers, in the order of Simulation.step and Batch.step.
struct ActionArrays {
  /// @param size environments, each a row of every array; 0: no rows. @throws Error (input) for another shape
  ActionArrays(const scene::Scene& scene, std::size_t size, const py::object& torques,
               const py::object& targets, const py::object& excitations, const py::object& wrists,
               const py::object& forces);

  Numbers torques, targets, excitations;
  std::vector<Pose> wrists;
  std::vector<std::vector<engine::BodyForce>> forces;
};

}  // namespace handsim::python
