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

/// In this order, each only if the scene needs it: Monitor, Convergence, Tunnelling (contacts), Grasps,
/// Climbs, Tracking (control), ContactSums (record.contacts), Ledger, RunHash.
Watchers standard_watchers(const Watched& watched);

}  // namespace handsim::simulation
