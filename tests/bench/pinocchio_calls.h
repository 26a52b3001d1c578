// A tree of bodies in plain numbers, and Pinocchio's algorithms on it. Its file is compiled for this
// processor, where Eigen's types are laid out otherwise: none may pass.
#pragma once

#include <array>
#include <functional>
#include <vector>

namespace handsim::bench {

using Numbers3 = std::array<double, 3>;
using Numbers9 = std::array<double, 9>;  ///< column by column

struct Placement {
  Numbers9 rotation;
  Numbers3 translation;
};

/// A joint and the body that hangs on it. Bodies stand in the frames of their joints.
struct TreeJoint {
  int parent = -1;  ///< index of a joint before it; -1: the still base
  int axes = 1;     ///< hinge or universal
  std::array<Numbers3, 2> axis;
  Placement in_parent, body;  ///< of the joint in the parent's frame, of the body in the joint's
  double mass = 0;
  Numbers9 inertia;
};

/// So many calls, of ABA and of RNEA.
struct PinocchioCalls {
  std::function<void()> aba, rnea;
};

__attribute__((visibility("default"))) PinocchioCalls pinocchio_calls(const std::vector<TreeJoint>& tree,
                                                                      const Numbers3& gravity, int calls);

}  // namespace handsim::bench
