// Drake behind handsim's interface of engines, through its Python: a child process steps the model that
// drake_steps.py builds, and answers after every step with the bodies and contacts.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "peers/other_engine.h"

namespace handsim::peers {

/// CPU time of Drake's processes, all engines with this limit together [s].
struct CpuLimit {
  double seconds = 0;
  std::atomic<double> spent = 0;
};

/// What a fault says of an engine whose limit is reached.
inline constexpr const char* kTooSlow = "CPU time [s]";

struct DrakeOptions {
  std::string approximation = "sap";  ///< of discrete contact: sap, similar, lagged, tamsi
  /// Of surfaces that press on each other [Pa]: the pressure at a body's innermost place. 0: one point for
  /// each pair of shapes.
  double modulus = 0;
  std::shared_ptr<CpuLimit> limit = {};  ///< none: no limit
};

/// The script and where its packages are come from the environment: HANDSIM_DRAKE_STEPS and PYTHONPATH.
/// @throws Error (input) where Python or Drake is not there, or Drake does not take the model; Error
/// (physics), from a step too, where the limit of CPU time is reached.
std::unique_ptr<engine::Engine> make_drake(const model::Model& model, const engine::Settings& settings,
                                           const DrakeOptions& options);

}  // namespace handsim::peers
