// A hundred hands at once: torques in, joint angles out, and a new start for those that fail.
#include <cstdio>

#include <handsim/core/error.h>
#include <handsim/environment/batch.h>

int main(int, char** argv) try {
  namespace hs = handsim;
  const hs::scene::Scene scene = hs::scene::load_scene(argv[1], {"solver={engine: articulated, step: 1 ms}"});
  hs::environment::BatchSetup setup;
  setup.environment.observe = {"q", "u", "fingertips"};
  setup.environment.randomise = {{"q", hs::environment::Distribution::uniform, 0, 0.1}};
  hs::environment::Batch batch(scene, 100, setup);

  std::vector<std::uint64_t> seeds(batch.size());
  for (std::size_t i = 0; i < seeds.size(); ++i) seeds[i] = i;
  batch.reset(seeds);
  const auto coordinates = static_cast<std::size_t>(scene.model.dof_count());
  std::vector<double> torques(batch.size() * coordinates, 0.002);
  for (int step = 0; step < 20; ++step) {
    batch.step({.torques = torques}, 10);  // 10 steps of 1 ms
    batch.reset(seeds, batch.failed());
  }
  double mean = 0;
  for (std::size_t i = 0; i < batch.size(); ++i)
    mean += batch.observations()[i * batch.observation_size()] / static_cast<double>(batch.size());
  std::printf("%zu hands, %s: %.3f rad\n", batch.size(), batch[0].observation().parts()[0].columns[0].c_str(),
              mean);
  return 0;
} catch (const handsim::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
