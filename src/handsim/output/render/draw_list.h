// The content of a picture without OpenGL: shapes, arrows and points in the world, and a camera.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "handsim/model/model.h"
#include "handsim/model/state.h"
#include "handsim/model/view.h"

namespace handsim::output {

// The convex solid of a drawn shape: a core (a box or a cylinder, possibly of zero size, or the hull of a
// mesh) dilated by a radius. Meshes, shadows, bounds and the framing of cameras use this one form.
enum class Core { box, cylinder, hull };

/// All points within `round` of the core, centred on the origin of `pose`. A hull's sizes are its box's.
struct Solid {
  Core core = Core::box;
  Vec3 half = Vec3::Zero();  ///< half edges of the core [m]; cylinder: (radius, radius, half height);
                             ///< hull: largest distances from the centroid along the axes
  double round = 0;          ///< [m]
  Pose pose;                 ///< X_WS
  std::shared_ptr<const model::ConvexMesh> mesh = {};  ///< set for a hull

  /// Half its smallest full extent [m].
  double thickness() const { return round + half.minCoeff(); }
  /// Radius of a bounding sphere about its origin [m].
  double reach() const { return half.norm() + round; }
};

/// The exact solid of a shape at pose x_WS.
Solid solid(const model::Shape& shape, const Pose& x_WS);
/// A solid with its edges rounded by 12% of its smallest half extent, to be visible; inside `exact`.
Solid bevelled(Solid exact);

/// True if the core is a line or a point (a capsule or a sphere).
bool is_capsule(const Solid& solid);

/// Largest n . x over the solid, x in the world (support function; n need not be unit) [m].
double support(const Solid& solid, const Vec3& n);

/// Linear colour components 0..1.
struct Colour {
  float r = 0.8F, g = 0.8F, b = 0.8F;
};

/// Linear components of an sRGB color 0xRRGGBB (IEC 61966-2-1).
Colour from_srgb(std::uint32_t hex);
/// From `a` to `b` by a share.
Colour mixed(const Colour& a, const Colour& b, float share);

struct Mesh;

struct DrawShape {
  Solid solid;
  Colour colour;
  int shape = 0;       ///< index into Model::shapes; of a mark: that of the shape that it is on
  bool mark = false;   ///< of pictures alone (HandMark)
  bool shades = true;  ///< others; a nail lies on its fingertip and does not
  bool fine = false;   ///< with more triangles: a nail and its fingertip, for the edge between them
  std::shared_ptr<const Mesh> skin = {};  ///< drawn in place of the solid: a piece of skin, in the world
  Colour finger = {};                     ///< of skin where it is a finger's
};

/// A shaft with a head, e.g. a joint axis or a contact force.
struct DrawArrow {
  Vec3 from = Vec3::Zero();
  Vec3 to = Vec3::Zero();
  double radius = 0.001;  ///< of the shaft [m]
  Colour colour;
  bool on_top = false;  ///< drawn over everything in front of it
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

/// Adds the paths of muscles along the hands, thicker and redder the more a muscle is active. The model has
/// moment arms, not places: a path passes each joint on the side, and on the surface, where its arms would
/// be.
void add_tendons(const model::Model& model, const model::State& state, DrawList& list);

/// Radius of an arrow's head over that of its shaft, and length of the head over its radius.
inline constexpr double kHeadWidth = 2.4;
inline constexpr double kHeadLength = 2.6;

/// Largest n . x over all shapes, arrows and points of the list; -infinity for an empty one [m].
double support(const DrawList& list, const Vec3& n);
/// The box of all shapes, arrows and points (not the ground), as two corners [m]; the origin if empty.
struct Bounds {
  Vec3 low = Vec3::Zero();
  Vec3 high = Vec3::Zero();
};
Bounds bounds(const DrawList& list);

/// Computes the camera on the named side of `hand_frame` (X_WH; x ulnar, y distal, z dorsal on a right hand)
/// that is as close as possible while all added lists (not the ground) are in the picture, with a margin of
/// 7% of the half picture. View `radial` is on the thumb's side of a hand of this `side`. Up is distal in the
/// views dorsal and palmar, dorsal in radial, and the world's z in three_quarter, which shows the back of the
/// hand from the fingertips and at least 25 degrees above the horizon.
class Framing {
 public:
  /// @throws Error (input) unless the aspect (width over height) is above 0.
  Framing(View view, const Pose& hand_frame, model::Side side, double aspect);
  /// What the added lists need: their largest extents in six directions [m]. Extents of one Framing or of
  /// several of the same view can be moved, mixed and given to camera().
  using Extents = std::array<double, 6>;

  void add(const DrawList& list);
  Camera camera() const { return camera(extents_); }
  const Extents& extents() const { return extents_; }
  Camera camera(const Extents& extents) const;

 private:
  Pose hand_frame_;
  Vec3 x_, y_, z_;                  ///< right, up and back of the picture
  double slope_y_, slope_x_;        ///< tangents of the angles to its upper and right edge, less the margin
  std::array<Vec3, 6> directions_;  ///< directions of the support function
  Extents extents_;                 ///< largest value of the support in each direction so far
};

/// What a hand is drawn with beyond its shapes, so that one sees which side is the back and where the arm
/// would be: nails and a stump of the wrist. They belong to pictures alone and touch nothing.
struct HandMark {
  Solid solid;        ///< in the frame of its body, X_BS
  int body = 0;       ///< index into Model::bodies
  int shape = 0;      ///< the shape that it is on: index into Model::shapes
  bool nail = false;  ///< else a stump
};

/// Marks of all hands. Only fingertips that are capsules have nails, only palms with shapes a stump.
std::vector<HandMark> hand_marks(const model::Model& model);

}  // namespace handsim::output
