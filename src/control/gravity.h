// Joint torques that balance the weight of a hand's segments, for gravity compensation.
#pragma once

#include <span>
#include <vector>

#include "handsim/model/state.h"

namespace handsim::control {

class GravityLoad {
 public:
  /// For all hinges and universal joints of the model, which must outlive this. @param gravity [m/s^2].
  GravityLoad(const model::Model& model, const Vec3& gravity);

  /// Torque of each coordinate that balances the weight distal to its joint [N m], size model.dof_count():
  ///   tau_j = -a_j . ((S_j - m_j p_j) x g)
  /// with the joint's axis a_j and anchor p_j, and mass m_j and first moment S_j of all bodies distal to it.
  /// Valid until the next call.
  std::span<const double> torques(const model::State& state);

  /// A joint of a chain, children before parents.
  struct Link {
    const model::Joint* joint = nullptr;
    std::size_t parent = 0, child = 0, dof = 0;
    double mass = 0;               ///< of all bodies distal to it [kg]
    bool adds_to_parent = false;   ///< its parent is the child of another joint
    Vec3 first_axis, second_axis;  ///< in the parent body, in the child body
    bool universal = false;
  };
  std::span<const Link> links() const { return links_; }
  const Vec3& gravity() const { return gravity_; }

 private:
  const model::Model& model_;
  Vec3 gravity_;
  std::vector<Link> links_;
  std::vector<Vec3> moments_;  ///< by body
  std::vector<double> torques_;
};

}  // namespace handsim::control
