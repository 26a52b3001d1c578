// Prepares a draw list for the graphics driver: projection, directions of the lights, which solids shade
// which, and the shadows on the ground. Plain numbers, no OpenGL.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "handsim/output/render/draw_list.h"

namespace handsim::output {

/// What a solid may hide from a point: the key light, the sky about the point, or both.
enum class Hides { key, both, sky };

/// Solids of one form that shade another one, in the row format of the shaders: first those that hide the key
/// light alone, then those that hide light and sky, then those that hide the sky alone.
struct OccluderRows {
  std::vector<Eigen::Vector4f> rows;
  int key_end = 0;    ///< number of solids that hide the key light
  int sky_begin = 0;  ///< index of the first that hides the sky
  int count = 0;
};

/// Solids that shade another one.
struct Occluders {
  /// Two rows each: (one end of the axis, radius), (from there to the other end, 0).
  OccluderRows capsules;
  /// Three rows each: (centre, radius), quaternion q_WS (x, y, z, w), (half extents, 1 for a cylinder).
  OccluderRows solids;

  /// To be added in the order of Hides.
  void add(const Solid& solid, Hides hides);
};

/// A bevelled shape, and the solids that shade it (at most kMaxOccluders of each form). The solid of a piece
/// of skin is a box about it.
struct LitSolid : DrawShape {
  Solid caster;  ///< that shades others, and of a hand with skin also its own skin
  Occluders occluders;
};

/// The part of the ground that a solid can darken.
struct Shade {
  Eigen::Vector4f quad;  ///< x and y of the low corner, width, depth [m]
  Occluders occluder;    ///< that solid alone
};

struct Ground {
  float height = 0;        ///< [m]
  Eigen::Vector4f disc;    ///< centre and the radius at which the ground has faded [m]
  Eigen::Vector4f region;  ///< bounding rectangle of all shades, as Shade::quad
  float spacing = 0.1F;    ///< of the coarse grid lines [m], a power of ten
  float line_width = 0;    ///< of the fine lines, as a share of the spacing
  std::vector<Shade> shades;
};

/// Geometry and light of one picture.
struct LitScene {
  /// @throws Error (input) for a camera without a direction or a field of view.
  LitScene(const DrawList& drawn, const Camera& from, double aspect);

  const DrawList* list;
  Camera camera;
  Eigen::Matrix4f view_projection;
  Eigen::Vector3f eye, to_key, to_fill, sky_up;
  std::vector<LitSolid> solids;  ///< nearest first
  /// Absent if the list has none or the camera is below it.
  std::optional<Ground> ground;
};

}  // namespace handsim::output
