// What a step's solver has left unsolved, as velocities: quick_step tells nothing of it, and world_step has a
// residual where its LCP solver gave up. For each joint row J v + (ERP / h) g = 0 was to be reached, with J
// and the constraint error g at the start of the step and v at its end; surfaces of rigid contacts were not
// to come closer. CFM's share, of the order of CFM times the joint's force, counts as residual too.
#pragma once

#include <vector>

#include "handsim/engine/multibody/rows.h"
#include "handsim/engine/ode/bodies.h"
#include "handsim/engine/ode/contacts.h"

namespace handsim::engine::ode {

/// Of quick_step's steps only every so many are measured: it takes an eighth of a small mechanism's step.
inline constexpr long kResidualEvery = 8;

class ResidualMeter {
 public:
  /// The model must outlive this.
  ResidualMeter(const model::Model& model, double erp) : model_(model), erp_(erp) {}

  /// @param before state at the start of the step, whose bodies now have the velocities of its end.
  /// @param step its length [s]. @param contacts null: there are none.
  Residual measure(const model::State& before, const std::vector<OdeBody>& bodies, double step,
                   const Contacts* contacts);

 private:
  const model::Model& model_;
  double erp_;
  model::State moved_;
  std::vector<Row> rows_;
};

}  // namespace handsim::engine::ode
