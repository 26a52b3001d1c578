// Pictures of a scene: moments of a run drawn with one camera for all of them.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/output/render/image.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// What a picture needs of one time of a run.
struct Moment {
  model::State state;
  std::vector<engine::Contact> contacts;
  std::string caption = {};  ///< on a contact sheet
};

Moment moment_of(const engine::Engine& engine);

/// Length of the arrow of a contact force [m/N]: a round figure with which the largest force of the moments
/// has 40 to 100 mm; nothing where the pictures show none or there is none.
std::optional<double> force_scale(const scene::PictureSpec& pictures, std::span<const Moment> moments);

/// Draws the moments with one camera for all of them, and hands each picture to `take` with its place
/// among them; keeps no picture. Creates one OpenGL context.
void draw(const model::Model& model, const scene::PictureSpec& pictures, std::span<const Moment> moments,
          const std::function<void(std::size_t, const output::Image&)>& take);
/// One picture of a scene.
output::Image draw(const scene::Scene& scene, const Moment& moment);

}  // namespace handsim::simulation
