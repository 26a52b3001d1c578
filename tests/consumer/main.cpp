// Simulates the scene of the command line and prints joint angles and the largest joint gap.
#include <cstdio>

#include <handsim/core/error.h>
#include <handsim/simulation/simulation.h>

int main(int, char** argv) try {
  handsim::simulation::Simulation simulation(handsim::scene::load_scene(argv[1], {"solver.step=2 ms"}));
  for (long i = 0; i < simulation.step_count(); ++i) simulation.step();

  const std::vector<double>& q = simulation.state().q;
  for (const handsim::model::Joint& joint : simulation.model().joints)
    std::printf("%-20s %6.3f rad\n", joint.name.c_str(), q[static_cast<std::size_t>(joint.first_dof)]);
  std::printf("largest joint gap %.3g m\n", simulation.get<handsim::simulation::Monitor>().joint_gap().value);
  return 0;
} catch (const handsim::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
