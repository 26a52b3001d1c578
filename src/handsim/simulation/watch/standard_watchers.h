// The watchers of `handsim run`, with their headers.
#pragma once

#include "handsim/simulation/watch/climb_figures.h"
#include "handsim/simulation/watch/contact_sums.h"
#include "handsim/simulation/watch/convergence.h"
#include "handsim/simulation/watch/grasp_figures.h"
#include "handsim/simulation/watch/ledger.h"
#include "handsim/simulation/watch/monitor.h"
#include "handsim/simulation/watch/state_hash.h"
#include "handsim/simulation/watch/tracking.h"
#include "handsim/simulation/watch/tunnelling.h"

namespace handsim::simulation {

/// The watchers of every run, in this order, each only if the scene needs it: Monitor, Convergence,
/// Tunnelling (contacts), Grasps, Climbs, Tracking (control), ContactSums (record.contacts), Ledger, RunHash.
inline Watchers standard_watchers(const Watched& watched) {
  const scene::SceneSpec& spec = watched.scene.spec;
  Watchers out;
  const auto add = [&]<class W>(bool wanted) {
    if (wanted) out.push_back(std::make_unique<W>(watched));
  };
  add.operator()<Monitor>(true);
  add.operator()<Convergence>(true);
  add.operator()<Tunnelling>(watched.engine.tests_contacts() || spec.criteria.penetration ||
                             spec.criteria.tunnelling);
  add.operator()<Grasps>(!watched.scene.plans.grasps.empty());
  // Without actuation nothing pulls.
  add.operator()<Climbs>(!watched.scene.plans.climbs.empty() &&
                         spec.solver.effects.has(model::Effect::actuation));
  add.operator()<Tracking>(watched.controller != nullptr);
  add.operator()<ContactSums>(spec.record_contacts);
  add.operator()<Ledger>(true);
  // Last, so that a hash costs no phase of the ledger's.
  add.operator()<RunHash>(true);
  return out;
}

}  // namespace handsim::simulation
