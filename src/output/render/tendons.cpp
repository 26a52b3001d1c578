#include <algorithm>

#include "handsim/core/index.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/render/draw_list.h"

namespace handsim::output {

namespace {

/// Of a resting and of a fully active muscle.
constexpr Colour kAtRest = {0.82F, 0.77F, 0.62F}, kActive = {0.85F, 0.02F, 0.02F};
constexpr double kThin = 0.0006, kThick = 0.0013;  // radius at rest and fully active [m]
/// The last segment that a path crosses a joint to is followed to this share of its length.
constexpr double kInsertion = 0.4;
constexpr double kLift = 0.0005;  ///< of a path's middle over the skin [m]

/// Along the child of a joint that a path crosses, on the side that its arms demand: a pull towards the body
/// at an offset n from the axes turns the child by n x (-along).
struct Segment {
  Vec3 joint = Vec3::Zero(), along = Vec3::Zero(), out = Vec3::Zero();  ///< out: from bone to skin [m]
  double length = 0;                                                    ///< [m]
  std::ptrdiff_t shape = 0;                                             ///< of the child

  Vec3 point(double share) const { return joint + share * length * along + out; }
};

std::optional<Segment> segment(const model::Model& model, const model::State& state,
                               const model::Joint& joint, const model::TendonPath& path,
                               const model::PathState& now) {
  const auto shape = std::find_if(model.shapes.begin(), model.shapes.end(),
                                  [&](const model::Shape& each) { return each.body == joint.child; });
  // A palm is several shapes, and its tendons lie between them.
  if (shape == model.shapes.end() || shape->part == model::Part::palm) return std::nullopt;
  const Pose parent = state.bodies[at(joint.parent)].pose(), child = state.bodies[at(joint.child)].pose();
  const Vec3 o = (parent * joint.parent_frame).p, to_centre = child.p - o, along = to_centre.normalized();
  Vec3 n = Vec3::Zero();
  for (std::size_t k = 0; k < path.arms.size(); ++k) {
    const int axis = path.arms[k].dof - joint.first_dof;
    if (axis >= 0 && axis < static_cast<int>(joint.axes.size()))
      n += now.arm[k] * model::axis_in_world(joint, at(axis), parent.q, child.q).cross(along);
  }
  if (!(n.norm() > 1e-6)) return std::nullopt;
  n.normalize();
  const double depth = support(solid(*shape, child * shape->pose), n) - n.dot(o) + kLift;
  return Segment{o, along, depth * n, 2 * to_centre.norm(), shape - model.shapes.begin()};
}

/// Corners of a path along the segments.
std::vector<Vec3> corners(const std::vector<Segment>& segments) {
  std::vector<Vec3> out;
  for (const Segment& each : segments) {
    out.push_back(each.point(0));
    out.push_back(each.point(&each == &segments.back() ? kInsertion : 1));
  }
  return out;
}

}  // namespace

void add_tendons(const model::Model& model, const model::State& state, DrawList& list) {
  for (std::size_t m = 0; m < model.muscles.size(); ++m) {
    const model::TendonPath& path = model.muscles[m].path;
    const model::PathState now = model::path_state(path, state.q);
    std::vector<Segment> segments;
    for (const model::Joint& joint : model.joints)
      if (const auto found = segment(model, state, joint, path, now)) segments.push_back(*found);
    if (segments.empty()) continue;
    const std::vector<Vec3> points = corners(segments);
    const double active = state.activation[m];
    DrawShape drawn;
    drawn.colour = mixed(kAtRest, kActive, static_cast<float>(active));
    drawn.shape = static_cast<int>(segments.back().shape);
    drawn.mark = true;
    drawn.shades = false;
    drawn.solid.core = Core::cylinder;
    drawn.solid.round = kThin + active * (kThick - kThin);
    for (std::size_t i = 1; i < points.size(); ++i) {
      const Vec3 way = points[i] - points[i - 1];
      drawn.solid.half = {0, 0, 0.5 * way.norm()};
      drawn.solid.pose = {0.5 * (points[i] + points[i - 1]), Quat::FromTwoVectors(Vec3::UnitZ(), way)};
      list.shapes.push_back(drawn);
    }
  }
}

}  // namespace handsim::output
