// What a step's solver has left unsolved, as velocities: quick_step tells nothing of it, and world_step has a
// residual where its LCP solver gave up. For each joint J v + (ERP / h) g = 0 was to be reached, with J
// and the constraint error g at the start of the step and v at its end; surfaces of rigid contacts were not
// to come closer. CFM's share, of the order of CFM times the joint's force, counts as residual too.
#pragma once

#include <span>
#include <vector>

#include "handsim/engine/ode/bodies.h"
#include "handsim/engine/ode/contacts.h"

namespace handsim::engine::ode {

class ResidualMeter {
 public:
  /// The model must outlive this object.
  ResidualMeter(const model::Model& model, double erp);

  /// Largest of all joints, as vectors' lengths, and of all contacts. @param before the step. @param bodies
  /// with velocities after it, as Model::bodies. @param step [s]. @param contacts null: none
  Residual measure(const model::State& before, std::span<const OdeBody> bodies, double step,
                   const Contacts* contacts) const;

 private:
  /// Points and axes of a joint's rows, in its bodies' axes.
  struct Sides {
    Vec3 slide = Vec3::Zero();  ///< in the parent
    /// Axes of turns: the first in the parent, the last in the child.
    Vec3 in_parent = Vec3::Zero(), in_child = Vec3::Zero();
    Quat turned = Quat::Identity();  ///< the child in the parent's axes where the joint is at 0
  };
  /// Squares of lengths.
  struct Found {
    double linear2 = 0, angular2 = 0;
  };
  Found of_joint(std::size_t joint, const model::State& before, std::span<const OdeBody> bodies,
                 double rate) const;

  const model::Model& model_;
  double erp_;
  std::vector<Sides> sides_;  ///< as Model::joints
};

}  // namespace handsim::engine::ode
