// Reads the solver settings and the pictures of a scene.
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

struct SceneSpec;

using model::View;

struct CameraSpec {
  Vec3 position = {0.5, -0.7, 0.5};  ///< [m]
  Vec3 target = Vec3::Zero();        ///< [m]
  double field_of_view = 0.6;        ///< vertical [rad]
};

/// What pictures show of a hand: skin, the shapes that touch, or shapes under skin like glass.
enum class HandLook { skin, shapes, both };

struct PictureSpec {
  std::array<int, 2> size = {1280, 960};  ///< pixels
  View view = View::three_quarter;        ///< from this side, framing all moving bodies
  std::optional<CameraSpec> camera;       ///< replaces the view
  bool floor = true;                      ///< draws a floor for shadows if the scene has no ground
  HandLook hands = HandLook::skin;        ///< with drawn tendons, skin is like glass
  bool finger_colours = false;            ///< of skin: each finger has the colour that its shapes have
  std::uint32_t skin_colour = 0xD9AC94;   ///< sRGB
  bool joint_axes = false;
  bool contact_points = false;
  bool contact_forces = false;  ///< arrows, in front of everything
  bool muscles = false;         ///< paths coloured by activation
  bool follow = false;          ///< the camera follows the hands and what they touch
};

/// Reads engine, step and the engine's own settings; keys of other engines are refused. If the command line
/// names the engine, such keys of the file are left out, with a warning.
void read_settings(MapReader& reader, engine::Settings& solver);
/// Handles keys of a `solver` block that the engine does not have. If the command line names `engine`, such
/// keys of the file are removed, with a warning; otherwise they are problems.
/// @param need what is needed in place of a key; nothing for allowed keys. @param why for the warning.
void refuse_keys(MapReader& reader, const std::function<std::optional<std::string>(const YamlEntry&)>& need,
                 const std::string& why);
/// True for a value from `--set`.
bool of_command_line(const YamlNode& node);
/// Reads the `solver` block. Call after effects, mechanism and control are read.
void read_solver(MapReader& reader, SceneSpec& scene);

/// @param out what holds for keys that are absent.
PictureSpec read_pictures(MapReader reader, PictureSpec out);

}  // namespace handsim::scene
