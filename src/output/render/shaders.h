// The GLSL shaders of the renderer. Light: an extended key light that casts soft shadows, a fill light at the
// camera, and a sky. Shadows and the occlusion of the sky are computed from distances to the convex solids,
// not from a shadow map: there is no limit of resolution and no shadow acne, and shadows at contacts are
// sharp.
#pragma once

#include <string>

namespace handsim::output {

/// Most capsules, and most other solids, that can shade one drawn solid; the nearest are used.
inline constexpr int kMaxOccluders = 24;
/// Tangent of half the angle under which the key light appears.
inline constexpr double kLightSize = 0.11;
/// Distance within which a solid hides sky, in units of its thickness.
inline constexpr double kSkyReach = 1.7;

/// GLSL text of the constants above; it comes after kLightFunctions.
std::string shader_constants();

/// Start of every fragment shader: version, lights, background, conversion to sRGB.
extern const char* const kLightFunctions;
/// Comes after it if there are occluders that are not capsules.
inline constexpr const char* kWithSolids = "#define WITH_SOLIDS\n";
/// Comes next in shaders that compute shadows.
extern const char* const kOcclusionFunctions;

/// Solids: vertices of a Mesh; the point and the normal of the surface at each pixel.
extern const char* const kSolidVertex;
extern const char* const kSurfaceFragment;
/// Their light: a rectangle of the picture, shaded by `capsules` and `solids`.
extern const char* const kRectangleVertex;
extern const char* const kSolidFragment;
/// The shade of one solid on the ground: red is the visible share of the key light, alpha that of the sky.
extern const char* const kShadeVertex;
extern const char* const kShadeFragment;
/// The ground with its grid.
extern const char* const kGroundVertex;
extern const char* const kGroundFragment;
/// The number of each solid (red, of 255), which every sample of a pixel keeps.
extern const char* const kIdFragment;
/// The picture: each sample has the colour that its solid has at this pixel or beside it.
extern const char* const kResolveFragment;
/// The background: a gradient behind everything.
extern const char* const kBackgroundVertex;
extern const char* const kBackgroundFragment;

}  // namespace handsim::output
