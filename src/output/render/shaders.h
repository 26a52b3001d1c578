// The GLSL of the renderer. Light: a key light of some size that casts soft shadows, a fill light at the
// camera, and a sky. Shadows and the sky's occlusion are computed from the solids themselves (distance from
// a convex solid), not from a depth map: no acne, no resolution, and contacts stay crisp.
#pragma once

#include <string>

namespace handsim::output {

/// Most capsules, and most other solids, that one drawn solid can be shaded by; the nearest are kept.
inline constexpr int kMaxOccluders = 24;
/// Tangent of the angle of half the key light.
inline constexpr double kLightSize = 0.11;
/// How far a solid darkens the sky, in its thicknesses.
inline constexpr double kSkyReach = 1.7;

/// Text of the constants above for the shaders; follows kLightFunctions.
std::string shader_constants();

/// Start of every fragment shader: version, lights, background, conversion to sRGB.
extern const char* const kLightFunctions;
/// Follows it where other solids than capsules are among the occluders.
inline constexpr const char* kWithSolids = "#define WITH_SOLIDS\n";
/// Follows where solids take light from each other.
extern const char* const kOcclusionFunctions;

/// Solids: vertices of a Mesh, lit and shaded by `capsules` and `solids`.
extern const char* const kSolidVertex;
extern const char* const kSolidFragment;
/// One solid's shade on the ground: red the key light, alpha the sky, 1 where it is open.
extern const char* const kShadeVertex;
extern const char* const kShadeFragment;
/// The ground with its grid.
extern const char* const kGroundVertex;
extern const char* const kGroundFragment;
/// The background: a gradient behind everything.
extern const char* const kBackgroundVertex;
extern const char* const kBackgroundFragment;

}  // namespace handsim::output
