// Scenes of every engine and method, which the tests of snapshots save and continue.
#pragma once

#include <string>
#include <vector>

#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::simulation::test_cases {

/// A scene, and after how many steps it is saved and how many follow.
struct Case {
  std::string name;
  std::string scene;
  std::vector<std::string> overrides;
  int before = 700;
  int after = 10'000;
};

inline void PrintTo(const Case& each, std::ostream* out) { *out << each.name; }

inline std::string controller(const std::string& name) {
  return "control.controller=" + test::source("controllers/" + name + ".yaml").string();
}

inline std::vector<Case> cases() {
  std::vector<Case> out;
  for (const std::string method : {"world_step", "quick_step"})
    out.push_back({"contact_" + method, "dropped_hand", {"solver.method=" + method}, 150});
  out.push_back({"projection", "two_hands", {"solver.projection=true"}, 200});
  out.push_back({"controlled", "pose_tracking", {}, 1100});
  out.push_back({"controlled_explicit", "pose_tracking", {controller("explicit")}, 1100});
  out.push_back({"integral", "pose_tracking", {controller("integral")}, 1100});
  for (const std::string method :
       {"stabilised_gear", "lagrange_penalty", "euler_linearised", "euler_projected"})
    out.push_back({method,
                   "slider_crank_iftomm",
                   {"solver={engine: dae, method: " + method + ", step: 0.2 ms}", "duration=3"},
                   4100});
  for (const std::string method : {"semi_implicit_euler", "rk4", "dormand_prince"})
    out.push_back({"loop_" + method,
                   "slider_crank_iftomm",
                   {"solver={engine: articulated, method: " + method + ", step: 1 ms}"},
                   700});
  out.push_back({"articulated_stops",
                 "two_hands",
                 {"solver.engine=articulated", "solver.method=semi_implicit_euler"},
                 200});
  // Solved by sweeps that start from the impulses of the step before.
  out.push_back({"articulated_contact",
                 "dropped_hand",
                 {"solver.engine=articulated", "solver.method=semi_implicit_euler"},
                 150});
  out.push_back({"articulated_grasp",
                 "grasp_pinch",
                 {"solver.engine=articulated", "solver.method=semi_implicit_euler",
                  "effects=[gravity, object_contact, friction, joint_stops, passive_tissue, actuation, "
                  "wrist_motion]"},
                 3000});
  out.push_back({"articulated_controlled",
                 "pose_tracking",
                 {"solver.engine=articulated", "solver.method=semi_implicit_euler"},
                 1100});
  out.push_back({"grasp", "grasp_pinch", {}, 3000});
  // Its test of the grip is over then, and what has lost its hold falls ever faster.
  out.push_back({"climb", "climb_half_crimp", {"solver.step=2 ms"}, 1500, 2000});
  out.push_back({"contact_record", "dropped_hand", {"record.contacts=true"}, 150});
  // A driven wrist: the integrator starts anew at keyframes, one of them within a step.
  out.push_back(
      {"dae_driven",
       "dropped_hand",
       {"hands.0.wrist={mount: driven, motion: {keyframes: [{time: 0, position: [0, 0, 0.2]}, {time: 0.1, "
        "position: [0, 0, 0.3]}, {time: 0.2001, position: [0.1, 0, 0.2]}]}}",
        "effects=[gravity, passive_tissue, wrist_motion]",
        "solver={engine: dae, method: stabilised_gear, step: 0.9 ms, tolerance: 1e-5}"},
       150});
  return out;
}

inline void steps(Simulation& simulation, int count) {
  for (int i = 0; i < count; ++i) simulation.step();
}

}  // namespace handsim::simulation::test_cases
