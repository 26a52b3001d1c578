// Derivatives of a step as arrays.
#pragma once

#include "handsim/environment/derivatives.h"
#include "handsim/python/bindings.h"

namespace handsim::python {

/// By the names of Derivatives in _gradients.py, and what it makes the rest from.
py::dict arrays_of(const environment::Derivatives& found, const model::Model& model);

}  // namespace handsim::python
