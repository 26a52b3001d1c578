// Drake behind handsim's interface of engines, through its Python: a child process steps the model that
// drake_steps.py builds, and answers after every step with the bodies and contacts.
#pragma once

#include <memory>
#include <string>

#include "peers/other_engine.h"

namespace handsim::peers {

struct DrakeOptions {
  std::string approximation = "sap";  ///< of discrete contact: sap, similar, lagged, tamsi
  /// Of surfaces that press on each other [Pa]: the pressure at a body's innermost place. 0: one point for
  /// each pair of shapes.
  double modulus = 0;
};

/// The script and where its packages are come from the environment: HANDSIM_DRAKE_STEPS and PYTHONPATH.
/// @throws Error (input) where Python or Drake is not there, or Drake does not take the model.
std::unique_ptr<engine::Engine> make_drake(const model::Model& model, const engine::Settings& settings,
                                           const DrakeOptions& options);

}  // namespace handsim::peers
