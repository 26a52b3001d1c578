// Columns of the tables that a run records beside its trajectory and contacts.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// Columns of control.sto after the time: `.target[deg]`, `.angle[deg]`, `.torque[N_m]` of each driven axis.
std::vector<std::string> control_columns(const scene::Scene& scene);
/// Columns of muscles.sto after the time, of each muscle: excitation of the last step, activation, tension,
/// length of the fibres and the rate at which they lengthen.
inline constexpr std::array<const char*, 5> kMuscleColumns = {".excitation[]", ".activation[]", ".tendon[N]",
                                                              ".fibre[mm]", ".speed[mm/s]"};
std::vector<std::string> muscle_columns(const scene::Scene& scene);
/// Head of monitor.csv. A residual that was not measured is `nan`.
inline constexpr std::string_view kMonitorHead =
    "time[s],kinetic[J],potential[J],sum[J],joints[m/s],joints[rad/s],contacts[m/s]\n";

}  // namespace handsim::simulation
