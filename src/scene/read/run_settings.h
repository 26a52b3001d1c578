// How a scene is run: solver and pictures.
#pragma once

#include <array>
#include <optional>

#include "handsim/core/yaml_reader.h"
#include "handsim/model/solver.h"

namespace handsim::scene {

enum class View { dorsal, palmar, radial, three_quarter };

struct CameraSpec {
  Vec3 position = {0.5, -0.7, 0.5};  ///< [m]
  Vec3 target = Vec3::Zero();        ///< [m]
  double field_of_view = 0.6;        ///< vertical [rad]
};

struct PictureSpec {
  std::array<int, 2> size = {1280, 960};  ///< pixels
  View view = View::three_quarter;        ///< framed to all that moves
  std::optional<CameraSpec> camera;       ///< in place of the view
  bool floor = true;                      ///< a floor to cast shadows on where the scene has no ground
  bool joint_axes = false;
  bool contact_points = false;
  bool contact_forces = false;  ///< arrows, through whatever hides them
};

/// Engine, method, step and what goes with them. @param or_auto `auto` is one of the engines that are named
void read_settings(MapReader& reader, model::SolverSettings& solver, bool or_auto = false);

void read_solver(MapReader reader, model::SolverSettings& solver);

PictureSpec read_pictures(MapReader reader);

}  // namespace handsim::scene
