// Derivatives of a step as arrays.
#pragma once

#include "handsim/environment/derivatives.h"
#include "handsim/python/bindings.h"

namespace handsim::python {

/// Arrays by the names of Derivatives in _derivatives.py, and what it makes the rest from.
py::dict arrays_of(const environment::Derivatives& found, const model::Model& model);
/// A state after a change of (q, u), as StepDerivatives has them, or none; joints' children are still to be
/// placed.
model::State moved(const model::Model& model, model::State state, std::span<const double> by);

}  // namespace handsim::python
