// The hand that engines are timed with, and a model of handsim's in MuJoCo.
#pragma once

#ifdef HANDSIM_WITH_MUJOCO
#include "peers/mujoco_model.h"
#endif

#include <cmath>
#include <string>
#include <vector>

#include "handsim/model/actuation.h"
#include "handsim/scene/compile/scene.h"
#include "scene_files.h"
#include "support/written.h"

namespace handsim::bench {

/// One anatomical hand on a still palm under gravity, with stops, tissue and a servo on every
/// coordinate, its error changing as a controller's does.
struct Load {
  scene::Scene scene;
  std::vector<std::vector<model::Servo>> servos;  ///< taken in turns
};

inline constexpr int kTurns = 64;

/// @param self_contact tested; the palm is down then, so that the thumb does not come to rest on it
/// @param more effects, each after ", "
inline Load one_hand(bool self_contact = false, const std::string& more = "") {
  Load out;
  std::vector<std::string> changes = {"effects=[gravity, joint_stops, passive_tissue" + more + "]"};
  if (self_contact)
    changes = {"effects=[gravity, joint_stops, passive_tissue, self_contact, friction]",
               "hands.0.wrist.rotation.angle=0"};
  out.scene = test::shipped_scene("two_hands", changes);
  YamlNode root = out.scene.resolved;
  root.find("hands")->items.pop_back();
  out.scene = scene::compile_scene(std::move(root));
  out.scene.spec.solver.effects.add(model::Effect::actuation);
  const auto dofs = static_cast<std::size_t>(out.scene.model.dof_count());
  for (int turn = 0; turn < kTurns; ++turn) {
    out.servos.emplace_back(dofs);
    for (std::size_t i = 0; i < dofs; ++i)
      out.servos.back()[i] = {0.05, 1e-3, 0.02 * std::sin(0.1 * turn + static_cast<double>(i)), 0, 0.5};
  }
  return out;
}

#ifdef HANDSIM_WITH_MUJOCO
/// A model in MuJoCo, with its Euler method.
struct Other {
  std::unique_ptr<mjModel, mujoco::Free> model;
  std::unique_ptr<mjData, mujoco::Free> data;
};

inline Other in_mujoco(const model::Model& model, const engine::Settings& settings) {
  Other out;
  out.model = mujoco::compile(test::written("mjcf", model, settings));
  out.data.reset(mj_makeData(out.model.get()));
  return out;
}
#endif

}  // namespace handsim::bench
