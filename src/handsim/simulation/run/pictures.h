// Pictures of a scene: moments of a run, with one camera or one that follows the hand.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/output/render/draw_list.h"
#include "handsim/output/render/image.h"
#include "handsim/scene/read/scene_file.h"

namespace handsim::simulation {

/// The data of a picture at one time of a run.
struct PictureState {
  model::State state;
  std::vector<engine::Contact> contacts;
  std::string caption = {};    ///< on a contact sheet
  Vec3 shaken = Vec3::Zero();  ///< displacement of the first hand by a shake, drawn as an arrow [m]
};

PictureState picture_state(const engine::Engine& engine);

/// The subject of pictures, and what they show of it. Both must outlive this.
struct Pictured {
  const model::Model& model;
  const scene::PictureSpec& pictures;
};

/// Settings of the drawing that are not the scene's.
struct Drawing {
  std::optional<output::Gl> gl;  ///< absent: the default of this build
  int threads = 1;               ///< that draw, see output/video/video.h
  /// A camera that follows the hand moves as smoothly as a mean over so many pictures before and after; its
  /// picture holds what all of them hold. 0 for pictures that stand alone.
  std::size_t smooth = 0;
};

struct Picture {
  output::Image image;
  double scale = 0;  ///< of what is as far from the camera as the middle of the hand [pixels/m]
};

/// Scale of the arrows of contact forces [m/N]: a round number for which the largest force of the moments has
/// 40 to 100 mm; nothing if the pictures show no forces or there are none.
std::optional<double> force_scale(const scene::PictureSpec& pictures, std::span<const PictureState> moments);

/// Cameras of the moments, one each. They follow the hand and what it touches where `pictures.follow` says
/// so; otherwise one camera shows the whole motion.
std::vector<output::Camera> cameras(const Pictured& of, std::span<const PictureState> moments,
                                    std::size_t smooth = 0);
/// The shapes and arrows that a picture of the moment shows: without lost bodies, further than 1 m from every
/// hand.
output::DrawList shown(const Pictured& of, const PictureState& moment, std::optional<double> force_scale);
/// The part of `shown` that a camera follows: hands and the shapes that they touch.
output::DrawList followed(const Pictured& of, const PictureState& moment, const output::DrawList& shown);

/// Camera, ground and light, which are common to all pictures of a run.
struct Stage {
  output::Camera camera;         ///< shows what the cameras of all moments follow
  std::optional<double> ground;  ///< height of the ground or floor [m]; absent: none
};
Stage stage_of(const Pictured& of, std::span<const PictureState> moments);

/// The force that an arrow shows: on the one of the two that is free, or on the object that a hand touches.
Vec3 shown_force(const model::Model& model, const engine::Contact& contact);

/// Draws the moments; passes each picture and its index to `take` in order. Creates an OpenGL context in each
/// thread. @param store called before in the thread that draws: to write a file, for example
void draw(const Pictured& of, std::span<const PictureState> moments, const Drawing& drawing,
          const std::function<void(std::size_t, const output::Image&)>& store,
          const std::function<void(std::size_t, const Picture&)>& take);
/// One picture of a scene.
output::Image draw(const Pictured& of, const PictureState& moment, std::optional<output::Gl> gl = {});

}  // namespace handsim::simulation
