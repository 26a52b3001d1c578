#include "handsim/output/render/draw_list.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>

#include "handsim/model/kinematics.h"
#include "handsim/model/shape_extent.h"

namespace handsim::output {

namespace {

/// Colours in the order of model::Part. The fingers have the palette of Okabe & Ito (2008), which
/// colour-blind people can distinguish; neighbouring fingers also differ in lightness.
constexpr std::uint32_t kPartColours[] = {0xE9D3BB, 0xD9552B, 0xF0AE2E, 0x159C76, 0x2274BD,
                                          0xB86BB4, 0x66737F, 0xDDDDDA, 0x9DB0BF};
static_assert(std::size(kPartColours) == static_cast<std::size_t>(model::Part::mechanism) + 1);

Colour colour(model::Part part) { return from_srgb(kPartColours[static_cast<std::size_t>(part)]); }

Colour colour(const model::Shape& shape) {
  return shape.colour ? from_srgb(*shape.colour) : colour(shape.part);
}

Colour axis_colour(std::size_t axis) { return from_srgb(axis == 0 ? 0x22282E : 0xC4123F); }

Pose pose_of(const model::State& state, int body) { return state.bodies[as_index(body)].pose(); }

/// A nail is a light tint of its finger, a stump a darker skin than the palm.
Colour colour(const HandMark& mark, model::Part part) {
  if (!mark.nail) return from_srgb(0xC9AC90);
  constexpr float kTint = 0.62F;
  return mixed(colour(part), from_srgb(0xFFF4EC), kTint);
}

void add_mark(const model::Model& model, const model::State& state, const HandMark& mark, DrawList& list) {
  DrawShape out;
  out.solid = mark.solid;
  out.solid.pose = pose_of(state, mark.body) * mark.solid.pose;
  out.colour = colour(mark, model.shapes[as_index(mark.shape)].part);
  out.shape = mark.shape;
  out.mark = true;
  out.shades = !mark.nail;
  out.fine = mark.nail;
  for (DrawShape& drawn : list.shapes) drawn.fine = drawn.fine || (mark.nail && drawn.shape == mark.shape);
  list.shapes.push_back(out);
}

void add_shape(const model::Model& model, std::size_t index, const model::State& state, DrawList& list) {
  const model::Shape& shape = model.shapes[index];
  const Pose x_WS = pose_of(state, shape.body) * shape.pose;
  if (shape.kind == model::ShapeKind::plane)
    // Only the highest plane is drawn as the ground.
    list.ground_height = std::max(list.ground_height.value_or(x_WS.p.z()), x_WS.p.z());
  else
    list.shapes.push_back({solid(shape, x_WS), colour(shape), static_cast<int>(index)});
}

/// Distance from `point` along the unit `n` to the surface of the solid's bounding box [m]; 0 from outside.
double exit_distance(const Solid& solid, const Vec3& point, const Vec3& n) {
  const Vec3 o = solid.pose.inverse() * point;
  const Vec3 d = solid.pose.q.conjugate() * n;
  const Vec3 half = solid.half + Vec3::Constant(solid.round);
  double enter = 0;
  double leave = 2 * half.norm();
  for (int i = 0; i < 3; ++i) {
    const double slope = std::max(std::abs(d[i]), 1e-9), middle = -std::copysign(o[i], o[i] * d[i]);
    enter = std::max(enter, (middle - half[i]) / slope);
    leave = std::min(leave, (middle + half[i]) / slope);
  }
  const double slack = 1e-6 * half.norm();
  return enter > slack || leave < 0 ? 0 : leave;
}

/// An arrow along the axis, through the joint; its ends project from the two bodies, its head at the + end.
DrawArrow axis_arrow(const model::Model& model, const model::State& state, const model::Joint& joint,
                     std::size_t axis) {
  const Pose x_WF = pose_of(state, joint.parent) * joint.parent_frame;
  const Pose x_WM = pose_of(state, joint.child) * joint.child_frame;
  const Vec3 n = (axis == 0 ? x_WF : x_WM).q * joint.axes[axis].axis;
  double ahead = 0;
  double behind = 0;
  double thickness = 0;
  for (const model::Shape& shape : model.shapes) {
    if (shape.kind == model::ShapeKind::plane) continue;
    if (shape.body != joint.child && (shape.body != joint.parent || joint.parent == model::kWorld)) continue;
    const Solid hull = solid(shape, pose_of(state, shape.body) * shape.pose);
    ahead = std::max(ahead, exit_distance(hull, x_WM.p, n));
    behind = std::max(behind, exit_distance(hull, x_WM.p, -n));
    if (shape.body == joint.child) thickness = std::max(thickness, hull.thickness());
  }
  if (thickness <= 0) thickness = 0.008;
  return {x_WM.p - (behind + 0.5 * thickness) * n, x_WM.p + (ahead + 1.6 * thickness) * n, 0.13 * thickness,
          axis_colour(axis), false};
}

/// A nail is the part of a capsule that stands out of the fingertip's capsule; its sizes over the
/// fingertip's radius: it is 1.1 radii wide, and stands out by 0.1.
constexpr double kNailRadius = 0.72, kNailOffset = 0.38, kNailFrom = -0.5, kNailTo = 0.15;
/// Width and length of a stump over the palm's width; its thickness over the palm's thickness.
constexpr double kStumpWidth = 0.64, kStumpLength = 0.2, kStumpThickness = 0.86;

bool is_last(const model::Model& model, int body) {
  return std::ranges::none_of(model.joints, [&](const model::Joint& joint) { return joint.parent == body; });
}

/// The nail of a fingertip: opposite to where its flexion moves it.
std::optional<HandMark> nail(const model::Model& model, const model::Joint& joint) {
  const auto capsule = std::ranges::find_if(model.shapes, [&](const model::Shape& shape) {
    return shape.body == joint.child && shape.kind == model::ShapeKind::capsule;
  });
  const auto flexion =
      std::ranges::find_if(joint.axes, [](const model::JointAxis& axis) { return axis.name == "flexion"; });
  if (capsule == model.shapes.end() || flexion == joint.axes.end()) return std::nullopt;
  Vec3 distal = capsule->pose.q * Vec3::UnitZ();
  if (distal.dot(capsule->pose.p - joint.child_frame.p) < 0) distal = -distal;
  const Vec3 across = joint.child_frame.q * flexion->axis;
  const Vec3 dorsal = -across.cross(distal);
  if (dorsal.norm() < 0.5) return std::nullopt;
  const double r = capsule->radius, tip = capsule->length / 2;
  const double from = std::max(tip + kNailFrom * r, -tip), to = tip + kNailTo * r;
  HandMark mark;
  mark.solid = {Core::box, {0, 0, (to - from) / 2}, kNailRadius * r, {}, {}};
  mark.solid.pose.p = capsule->pose.p + (from + to) / 2 * distal + kNailOffset * r * dorsal.normalized();
  mark.solid.pose.q = capsule->pose.q;
  mark.body = joint.child;
  mark.shape = static_cast<int>(capsule - model.shapes.begin());
  mark.nail = true;
  return mark;
}

/// Behind the palm, as thick and two thirds as wide.
std::optional<HandMark> stump(const model::Model& model, const model::HandIndex& hand) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Vec3 low = Vec3::Constant(kInfinity), high = -low;
  std::optional<int> on;
  const Pose x_HP = hand.wrist_frame.inverse();
  for (std::size_t i = 0; i < model.shapes.size(); ++i) {
    const model::Shape& shape = model.shapes[i];
    if (shape.body != hand.palm || shape.part != model::Part::palm) continue;
    if (!on) on = static_cast<int>(i);
    const Solid drawn = solid(shape, x_HP * shape.pose);
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], -support(drawn, -Vec3::Unit(k)));
      high[k] = std::max(high[k], support(drawn, Vec3::Unit(k)));
    }
  }
  if (!on) return std::nullopt;
  const Vec3 size = high - low;
  HandMark mark;
  const double round = kStumpThickness * size.z() / 2;
  mark.solid.half = {std::max(kStumpWidth * size.x() / 2 - round, 0.0), kStumpLength * size.x() / 2, 0};
  mark.solid.round = round;
  const Vec3 centre = {(low.x() + high.x()) / 2, low.y(), (low.z() + high.z()) / 2};
  mark.solid.pose = hand.wrist_frame * Pose{centre, Quat::Identity()};
  mark.body = hand.palm;
  mark.shape = *on;
  return mark;
}

/// Colours of a resting and of a fully active muscle.
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
  const auto shape =
      std::ranges::find_if(model.shapes, [&](const model::Shape& each) { return each.body == joint.child; });
  // A palm is several shapes, and its tendons lie between them.
  if (shape == model.shapes.end() || shape->part == model::Part::palm) return std::nullopt;
  const Pose parent = state.bodies[as_index(joint.parent)].pose(),
             child = state.bodies[as_index(joint.child)].pose();
  const Vec3 o = (parent * joint.parent_frame).p, to_centre = child.p - o, along = to_centre.normalized();
  Vec3 n = Vec3::Zero();
  for (std::size_t k = 0; k < path.arms.size(); ++k) {
    const int axis = path.arms[k].dof - joint.first_dof;
    if (axis >= 0 && axis < static_cast<int>(joint.axes.size()))
      n += now.arm[k] * model::axis_in_world(joint, as_index(axis), parent.q, child.q).cross(along);
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

Colour from_srgb(std::uint32_t hex) {
  const auto linear = [hex](unsigned shift) {
    const double c = static_cast<double>((hex >> shift) & 0xFFU) / 255.0;
    return static_cast<float>(c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4));
  };
  return {linear(16), linear(8), linear(0)};
}

Colour mixed(const Colour& a, const Colour& b, float share) {
  const auto mix = [share](float from, float to) { return from + share * (to - from); };
  return {mix(a.r, b.r), mix(a.g, b.g), mix(a.b, b.b)};
}

Solid solid(const model::Shape& shape, const Pose& x_WS) {
  if (shape.kind == model::ShapeKind::convex_mesh) {
    Vec3 half = Vec3::Zero();
    for (const Vec3& vertex : shape.mesh->vertices) half = half.cwiseMax(vertex.cwiseAbs());
    return {Core::hull, half, 0, x_WS, shape.mesh};
  }
  const model::Extent extent = model::extent(shape);
  const Core core = shape.kind == model::ShapeKind::cylinder ? Core::cylinder : Core::box;
  return {core, extent.half, extent.round, x_WS};
}

Solid bevelled(Solid exact) {
  if (exact.core == Core::hull) return exact;
  const double bevel = 0.12 * exact.half.minCoeff();
  exact.half -= Vec3::Constant(bevel);
  exact.round += bevel;
  return exact;
}

bool is_capsule(const Solid& solid) { return solid.half.x() <= 0 && solid.half.y() <= 0; }

double support(const Solid& solid, const Vec3& n) {
  const Vec3 m = solid.pose.q.conjugate() * n;
  if (solid.core == Core::hull) return n.dot(solid.pose.p) + solid.mesh->support(m);
  const double core = solid.core == Core::box
                          ? solid.half.dot(m.cwiseAbs())
                          : solid.half.x() * m.head<2>().norm() + solid.half.z() * std::abs(m.z());
  return n.dot(solid.pose.p) + core + solid.round * n.norm();
}

DrawList draw_list(const model::Model& model, const model::State& state, const DrawOptions& options) {
  DrawList list;
  for (std::size_t i = 0; i < model.shapes.size(); ++i) add_shape(model, i, state, list);
  for (const HandMark& mark : hand_marks(model)) add_mark(model, state, mark, list);
  if (!options.joint_axes) return list;
  for (const model::Joint& joint : model.joints)
    for (std::size_t axis = 0; axis < joint.axes.size(); ++axis)
      list.arrows.push_back(axis_arrow(model, state, joint, axis));
  return list;
}

double support(const DrawList& list, const Vec3& n) {
  double most = -std::numeric_limits<double>::infinity();
  for (const DrawShape& shape : list.shapes) most = std::max(most, support(shape.solid, n));
  for (const DrawArrow& arrow : list.arrows)
    most =
        std::max(most, std::max(n.dot(arrow.from), n.dot(arrow.to)) + kHeadWidth * arrow.radius * n.norm());
  for (const DrawPoint& point : list.points)
    most = std::max(most, n.dot(point.position) + point.radius * n.norm());
  return most;
}

Bounds bounds(const DrawList& list) {
  if (list.shapes.empty() && list.arrows.empty() && list.points.empty()) return {};
  Bounds box;
  for (int i = 0; i < 3; ++i) {
    box.low[i] = -support(list, -Vec3::Unit(i));
    box.high[i] = support(list, Vec3::Unit(i));
  }
  return box;
}

std::vector<HandMark> hand_marks(const model::Model& model) {
  std::vector<HandMark> out;
  for (const model::HandIndex& hand : model.hands) {
    if (const auto mark = stump(model, hand)) out.push_back(*mark);
    for (const int index : hand.joints) {
      const model::Joint& joint = model.joints[as_index(index)];
      if (joint.child == hand.palm || !is_last(model, joint.child)) continue;
      if (const auto mark = nail(model, joint)) out.push_back(*mark);
    }
  }
  return out;
}

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
      drawn.solid.pose = {0.5 * (points[i] + points[i - 1]), rotation_between(Vec3::UnitZ(), way)};
      list.shapes.push_back(drawn);
    }
  }
}

}  // namespace handsim::output
