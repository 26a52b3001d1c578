// Torques that hold the weight of a hand's segments, from Model and State: what gravity compensation feeds
// forward.
#pragma once

#include <span>
#include <vector>

#include "handsim/model/state.h"

namespace handsim::control {

class GravityLoad {
 public:
  /// For all joints that hinge and universal chains hang on. @param gravity [m/s^2]. The model must outlive
  /// this.
  GravityLoad(const model::Model& model, const Vec3& gravity);

  /// Torque of each coordinate that carries the weight beyond its joint [N m], size model.dof_count(), into
  /// `out`:
  ///   tau_j = -a_j . ((S_j - m_j p_j) x g), a_j the joint's axis, p_j its anchor, m_j and S_j the mass and
  ///   first
  /// moment of all that it carries. Valid until the next call.
  std::span<const double> torques(const model::State& state);

 private:
  /// A joint of a chain, children before parents.
  struct Link {
    const model::Joint* joint = nullptr;
    std::size_t parent = 0, child = 0, dof = 0;
    double mass = 0;               ///< of all that it carries [kg]
    bool held = false;             ///< its parent is the child of a joint, too, and gets this moment added
    Vec3 first_axis, second_axis;  ///< in the parent body, in the child body
    bool universal = false;
  };

  const model::Model& model_;
  Vec3 gravity_;
  std::vector<Link> links_;
  std::vector<Vec3> moments_;  ///< by body
  std::vector<double> torques_;
};

}  // namespace handsim::control
