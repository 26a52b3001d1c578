#include "handsim/engine/multibody/rows.h"

namespace handsim::engine {

namespace {

/// Both frames of a joint in world axes.
struct Sides {
  int parent, child;
  Quat q_WF, q_WM;
  Vec3 r_parent, r_child;  ///< from the centres of mass to the anchors
  Vec3 gap;                ///< from the parent's anchor to the child's

  Sides(const model::Joint& joint, const model::State& state) : parent(joint.parent), child(joint.child) {
    const model::BodyState& p = state.bodies[as_index(parent)];
    const model::BodyState& c = state.bodies[as_index(child)];
    q_WF = p.q * joint.parent_frame.q;
    q_WM = c.q * joint.child_frame.q;
    r_parent = p.q * joint.parent_frame.p;
    r_child = c.q * joint.child_frame.p;
    gap = c.p + r_child - p.p - r_parent;
  }
};

/// The component of the gap along a direction. @param with_parent the direction rotates with the parent
ConstraintRow gap_component(const Sides& sides, const Vec3& direction, bool with_parent) {
  ConstraintRow row{sides.parent, sides.child, direction.dot(sides.gap)};
  const Vec3 arm = with_parent ? Vec3(sides.r_parent + sides.gap) : sides.r_parent;
  row.child_v = direction;
  row.child_w = sides.r_child.cross(direction);
  row.parent_v = -direction;
  row.parent_w = -arm.cross(direction);
  return row;
}

/// The cosine between a direction of the parent and one of the child: d(a.b)/dt = (w_P - w_C).(a x b).
ConstraintRow cosine(const Sides& sides, const Vec3& in_parent, const Vec3& in_child) {
  ConstraintRow row{sides.parent, sides.child, in_parent.dot(in_child)};
  row.parent_w = in_parent.cross(in_child);
  row.child_w = -row.parent_w;
  return row;
}

/// The rotation of the child relative to the parent about a direction.
ConstraintRow relative_rotation(const Sides& sides, const Vec3& direction) {
  ConstraintRow row{sides.parent, sides.child};
  row.child_w = direction;
  row.parent_w = -direction;
  return row;
}

}  // namespace

void append_constraints(const model::Joint& joint, const model::State& state,
                        std::vector<ConstraintRow>& rows) {
  const Sides sides(joint, state);
  const auto slides = as_index(joint.type().slides);
  // The direction of a slide, or any, and two across it.
  const Vec3 r = slides > 0 ? joint.axes[0].axis : Vec3::UnitX();
  const Vec3 s = r.unitOrthogonal(), t = r.cross(s);
  if (slides > 0) {
    rows.push_back(gap_component(sides, sides.q_WF * s, true));
    rows.push_back(gap_component(sides, sides.q_WF * t, true));
  } else {
    for (int i = 0; i < 3; ++i) rows.push_back(gap_component(sides, Vec3::Unit(i), false));
  }
  switch (joint.type().turns) {
    case 0:
      rows.push_back(cosine(sides, sides.q_WF * r, sides.q_WM * s));
      rows.push_back(cosine(sides, sides.q_WF * s, sides.q_WM * t));
      rows.push_back(cosine(sides, sides.q_WF * t, sides.q_WM * r));
      return;
    case 1: {
      const Vec3 axis = joint.axes[slides].axis;
      const Vec3 u = axis.unitOrthogonal();
      rows.push_back(cosine(sides, sides.q_WF * axis, sides.q_WM * u));
      rows.push_back(cosine(sides, sides.q_WF * axis, sides.q_WM * axis.cross(u)));
      return;
    }
    case 2:
      rows.push_back(
          cosine(sides, sides.q_WF * joint.axes[slides].axis, sides.q_WM * joint.axes[slides + 1].axis));
  }
}

ConstraintRow coordinate_row(const model::Joint& joint, int coordinate, const model::State& state) {
  const Sides sides(joint, state);
  const int slides = joint.type().slides;
  if (coordinate < slides) return gap_component(sides, sides.q_WF * joint.axes[0].axis, true);
  if (joint.spherical()) return relative_rotation(sides, sides.q_WF * Vec3::Unit(coordinate - slides));
  return relative_rotation(
      sides, (coordinate == slides ? sides.q_WF : sides.q_WM) * joint.axes[as_index(coordinate)].axis);
}

double rate(const ConstraintRow& row, const model::State& state) {
  const model::BodyState& p = state.bodies[as_index(row.parent)];
  const model::BodyState& c = state.bodies[as_index(row.child)];
  return row.parent_v.dot(p.v) + row.parent_w.dot(p.w) + row.child_v.dot(c.v) + row.child_w.dot(c.w);
}

}  // namespace handsim::engine
