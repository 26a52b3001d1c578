// The tree that a Model is to the recursive algorithms: a node for each degree of freedom of a hinge,
// universal or slider joint, for each ball joint and free body, parents first (Featherstone 2008, Rigid Body
// Dynamics Algorithms, section 4.1, pp. 65-70). Loops are cut at the joints of fewest constraints, however
// they are marked. Depends on no state.
#pragma once

#include <optional>
#include <vector>

#include "handsim/engine/articulated/kernels/lane_tree.h"
#include "handsim/engine/engine.h"

namespace handsim::engine::articulated {

/// One node. Its link frame L has its origin at the centre of mass of the body it carries and the principal
/// axes of that body; a node without a body (the middle of a universal joint) has no mass.
struct Node {
  NodeKind kind = NodeKind::revolute;
  std::optional<int> parent;  ///< node; none: attached to `base`, or free
  int base = model::kWorld;   ///< kinematic body of the model, where there is no parent
  int depth = 0;              ///< nodes between this one and its base
  std::optional<int> body;    ///< body of the model that the node carries
  std::optional<int> joint;   ///< joint of the model that the node belongs to
  int axis_index = 0;         ///< its axis of that joint
  bool reversed = false;      ///< the joint's child is this tree's parent
  int island = 0;

  /// Revolute: q_PL = cos(q/2) before + sin(q/2) turned. Prismatic: q_PL = before. Ball: before * q * after.
  Quat before = Quat::Identity();
  Quat turned = Quat::Identity();
  Quat after = Quat::Identity();
  Vec3 axis = Vec3::UnitZ();    ///< revolute: in L; prismatic: in the parent's link frame; unit
  Vec3 anchor = Vec3::Zero();   ///< joint's origin from the parent's centre of mass, in its link frame [m]
  Vec3 arm = Vec3::Zero();      ///< centre of mass from the joint's origin, in L [m]
  double mass = 0;              ///< [kg]
  Vec3 inertia = Vec3::Zero();  ///< principal moments [kg m^2]
  Quat q_LB = Quat::Identity();
};

/// A side of a cut joint: the node or the immovable base that it is fixed to.
struct CutSide {
  std::optional<int> node;
  int base = model::kWorld;  ///< where there is no node
  Pose frame;                ///< X_LF, or X_BF of a base
};

/// A joint that is held by constraints.
struct Cut {
  int joint = 0;
  CutSide parent, child;
  int island = 0;
};

struct Topology {
  std::vector<Node> nodes;  ///< by depth, then kind
  std::vector<Cut> cuts;
  std::vector<int> node_of_body;  ///< as Model::bodies; kNoNode for kinematic ones
  int islands = 0;
  std::vector<int> reference;  ///< of each island: the node next to a base, or free, that its origin goes by
};

inline constexpr int kNoNode = -1;

/// @param model without defects.
Topology make_topology(const model::Model& model);

}  // namespace handsim::engine::articulated
