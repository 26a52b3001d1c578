// Pictures of a scene: moments of a run, drawn with one common camera.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/output/render/draw_list.h"
#include "handsim/output/render/image.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// The data of a picture at one time of a run.
struct Moment {
  model::State state;
  std::vector<engine::Contact> contacts;
  std::string caption = {};  ///< on a contact sheet
};

Moment moment_of(const engine::Engine& engine);

/// Scale of the arrows of contact forces [m/N]: a round number for which the largest force of the moments has
/// 40 to 100 mm; nothing if the pictures show no forces or there are none.
std::optional<double> force_scale(const scene::PictureSpec& pictures, std::span<const Moment> moments);

/// What is common to the pictures of a run.
struct Stage {
  output::Camera camera;
  std::optional<double> ground;  ///< height of the ground or floor [m]; absent: none
};
Stage stage_of(const model::Model& model, const scene::PictureSpec& pictures,
               std::span<const Moment> moments);

/// The force that an arrow shows: on the one of the two that is free, or on the object that a hand touches.
Vec3 shown_force(const model::Model& model, const engine::Contact& contact);

/// Draws the moments with one common camera, and passes each picture and its index to `take`; stores no
/// picture. Creates one OpenGL context.
void draw(const model::Model& model, const scene::PictureSpec& pictures, std::span<const Moment> moments,
          const std::function<void(std::size_t, const output::Image&)>& take);
/// One picture of a scene.
output::Image draw(const scene::Scene& scene, const Moment& moment);

}  // namespace handsim::simulation
