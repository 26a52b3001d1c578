// Columns of the tables that a run records beside its trajectory and contacts.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// Columns of control.sto after the time: `.target[deg]`, `.angle[deg]`, `.torque[N_m]` of each driven axis,
/// then
/// `.activation`, `.tendon[N]`, `.fibre[mm]` of each muscle.
std::vector<std::string> control_columns(const scene::Scene& scene);
/// Head of monitor.csv. A residual that was not measured is `nan`.
inline constexpr std::string_view kMonitorHead =
    "time[s],kinetic[J],potential[J],sum[J],joints[m/s],joints[rad/s],contacts[m/s]\n";

}  // namespace handsim::simulation
