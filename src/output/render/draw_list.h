// What a picture shows, free of OpenGL: shapes, arrows and points in the world, and a camera. Made from a
// Model and a State; the renderer turns it into an Image.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "handsim/model/model.h"
#include "handsim/model/state.h"
#include "handsim/model/view.h"

namespace handsim::output {

// The convex solid behind a drawn shape: a core (box or cylinder, possibly flat to a line or a point) grown
// by a radius. One form for all kinds serves meshes, shadows, bounds and the framing of cameras.
enum class Core { box, cylinder, hull };

/// All points within `round` of the core, which lies about the origin of `pose`. A hull is that of its mesh,
/// with no rounding; where only size counts, the box about it stands for it.
struct Solid {
  Core core = Core::box;
  Vec3 half = Vec3::Zero();  ///< half edges of the core [m]; cylinder: (radius, radius, half height);
                             ///< hull: of the box about it, as far as it reaches from the centroid
  double round = 0;          ///< [m]
  Pose pose;                 ///< X_WS
  std::shared_ptr<const model::ConvexMesh> mesh = {};  ///< of a hull

  /// Half its smallest full extent [m].
  double thickness() const { return round + half.minCoeff(); }
  /// Radius about its origin that holds all of it [m].
  double reach() const { return half.norm() + round; }
};

/// The exact solid of a shape that stands at x_WS.
Solid solid(const model::Shape& shape, const Pose& x_WS);
/// The same with its edges rounded by 6% of its thickness, so that edges show. It lies
/// inside the exact one.
Solid bevelled(Solid exact);

/// Is its core a line or a point (a capsule or a sphere)?
bool is_capsule(const Solid& solid);

/// Largest n . x over the solid, x in the world (support function; n need not be unit) [m].
double support(const Solid& solid, const Vec3& n);

/// Linear colour components 0..1.
struct Colour {
  float r = 0.8F, g = 0.8F, b = 0.8F;
};

struct DrawShape {
  Solid solid;
  Colour colour;
};

/// A shaft with a head, e.g. a joint axis or a contact force.
struct DrawArrow {
  Vec3 from = Vec3::Zero();
  Vec3 to = Vec3::Zero();
  double radius = 0.001;  ///< of the shaft [m]
  Colour colour;
  bool on_top = false;  ///< visible through whatever stands before it
};

struct DrawPoint {
  Vec3 position = Vec3::Zero();
  double radius = 0.002;  ///< [m]
  Colour colour;
};

struct DrawList {
  std::vector<DrawShape> shapes;
  std::vector<DrawArrow> arrows;
  std::vector<DrawPoint> points;
  std::optional<double> ground_height;  ///< z of the ground with its grid [m]; absent: no ground
};

using model::View;

/// A pinhole camera.
struct Camera {
  Vec3 position = {0.4, -0.6, 0.4};
  Vec3 target = Vec3::Zero();
  Vec3 up = Vec3::UnitZ();
  double field_of_view = 0.6;  ///< vertical [rad]
};

struct DrawOptions {
  bool joint_axes = false;
};

/// Shapes of the model at the state, coloured by part; planes become the ground.
DrawList draw_list(const model::Model& model, const model::State& state, const DrawOptions& options);

/// Radius of an arrow's head over that of its shaft, and length of the head over its radius.
inline constexpr double kHeadWidth = 2.4;
inline constexpr double kHeadLength = 2.6;

/// Largest n . x over all shapes, arrows and points of the list; -infinity for an empty one [m].
double support(const DrawList& list, const Vec3& n);
/// The axis-aligned box of all shapes, arrows and points (not the ground), as two corners [m]; both at the
/// origin for an empty list.
struct Bounds {
  Vec3 low = Vec3::Zero();
  Vec3 high = Vec3::Zero();
};
Bounds bounds(const DrawList& list);

/// A camera on the named side of `hand_frame` (X_WH; x ulnar, y distal, z dorsal on a right hand) that
/// sees all lists that are added (not the ground) with a margin of 7% of the half picture, as close as that
/// allows. `side` turns radial to the thumb's side. Up is distal (dorsal, palmar), dorsal (radial) or the
/// world's z (three_quarter, from the fingertips onto the back of the hand, never from below the
/// horizon).
class Framing {
 public:
  /// @throws Error (input) for an aspect (width over height) that is not above 0.
  Framing(View view, const Pose& hand_frame, model::Side side, double aspect);
  void add(const DrawList& list);
  Camera camera() const;

 private:
  Pose hand_frame_;
  Vec3 x_, y_, z_;               ///< right, up and back of the picture
  double rise_, run_;            ///< slopes of its upper and right edge
  std::array<Vec3, 6> out_;      ///< directions in which the lists reach farthest
  std::array<double, 6> reach_;  ///< and how far [m]
};

}  // namespace handsim::output
