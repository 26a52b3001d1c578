// The GLSL shaders of the renderer. Light: an extended key light that casts soft shadows, a fill light at the
// camera, and a sky. Shadows and the occlusion of the sky come from distances to the convex solids, not a
// shadow map: no limit of resolution, no shadow acne, sharp shadows at contacts.
#pragma once

#include <string>
#include <string_view>

#include <fmt/format.h>

namespace handsim::output {

/// Most capsules, and most other solids, that can shade one drawn solid; the nearest are used.
inline constexpr int kMaxOccluders = 24;
/// Tangent of half the angle under which the key light appears.
inline constexpr double kLightSize = 0.11;
/// Distance within which a solid hides sky, in units of its thickness.
inline constexpr double kSkyReach = 1.7;

/// GLSL text of the constants above; it comes after light_glsl.
inline std::string shader_constants() {
  return fmt::format("const int kMaxOccluders = {};\nconst float kLightSize = {}, kSkyReach = {};\n",
                     kMaxOccluders, kLightSize, kSkyReach);
}

/// Comes after light_glsl where there are occluders that are not capsules.
inline constexpr std::string_view kWithSolids = "#define WITH_SOLIDS\n";

// The files of shaders/.
namespace shaders {

/// Start of every fragment shader: version, lights, background, conversion to sRGB.
extern const std::string_view light_glsl;
/// Comes next in shaders that compute shadows.
extern const std::string_view occlusion_glsl;

/// Solids: vertices of a Mesh; the point and the normal of the surface at each pixel.
extern const std::string_view solid_vertex_glsl;
extern const std::string_view surface_fragment_glsl;
/// The light of all shapes: a rectangle of the picture, shaded by `capsules` and `solids`.
extern const std::string_view rectangle_vertex_glsl;
extern const std::string_view solid_fragment_glsl;
/// The shade of one solid on the ground: red is the visible share of the key light, alpha that of the sky.
extern const std::string_view shade_vertex_glsl;
extern const std::string_view shade_fragment_glsl;
/// The ground with its grid.
extern const std::string_view ground_vertex_glsl;
extern const std::string_view ground_fragment_glsl;
/// The number of each solid (red, of 255), which every sample of a pixel keeps.
extern const std::string_view id_fragment_glsl;
/// The picture: each sample has the colour that its solid has at this pixel or beside it.
extern const std::string_view resolve_fragment_glsl;
/// The background: a gradient behind everything.
extern const std::string_view background_vertex_glsl;
extern const std::string_view background_fragment_glsl;

}  // namespace shaders

}  // namespace handsim::output
