// How a scene is run: solver and pictures.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "handsim/core/yaml_reader.h"
#include "handsim/engine/settings.h"
#include "handsim/model/view.h"

namespace handsim::scene {

using model::View;

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

struct SceneSpec;

/// Engine, step and the engine's own settings; keys of other engines are refused. Where the command line
/// names the engine, such keys of the file are left out, with a warning.
void read_settings(MapReader& reader, engine::Settings& solver);
/// Takes keys out of a `solver` block whose `engine` the command line names and which the file states; given
/// on the command line, or beside the file's own engine, they are problems.
/// @param need what is needed in a key's place; nothing: the key may stand. @param why they are left out
void refuse_keys(MapReader& reader, const std::function<std::optional<std::string>(const YamlEntry&)>& need,
                 const std::string& why);
std::optional<engine::GuardLimits> read_guard(MapReader& reader);
bool read_speculative(MapReader& reader);
std::uint64_t read_seed(MapReader& reader);
/// The `solver` block. Effects, mechanism and control have to be read.
void read_solver(MapReader& reader, SceneSpec& scene);

PictureSpec read_pictures(MapReader reader);

}  // namespace handsim::scene
