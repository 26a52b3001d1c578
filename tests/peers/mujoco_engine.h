// MuJoCo behind handsim's interface of engines: the model as `handsim export` writes it, with the options
// that MuJoCo's users choose from.
#pragma once

#include <memory>
#include <string>

#include "peers/other_engine.h"

namespace handsim::peers {

struct MujocoOptions {
  std::string integrator = "Euler";  ///< as MJCF has it
  bool elliptic = false;
  double impratio = 1;
  int noslip = 0;
  /// Contacts, limits and loops as stiff as MuJoCo allows: a time constant of two steps, impedance 0.99.
  bool stiff = false;
  bool speculative = false;
};

/// @throws Error (input) for what MJCF does not say.
std::unique_ptr<engine::Engine> make_mujoco(const model::Model& model, const engine::Settings& settings,
                                            const MujocoOptions& options);

}  // namespace handsim::peers
