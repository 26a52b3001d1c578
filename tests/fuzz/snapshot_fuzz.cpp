#include <memory>
#include <vector>

#include "fuzz/fuzz.h"
#include "handsim/core/archive.h"
#include "handsim/simulation/run/snapshot_file.h"
#include "handsim/simulation/simulation.h"

namespace {

using namespace handsim;

/// One simulation of each engine with memory of its own, a little way on.
struct Target {
  explicit Target(const std::string& text)
      : scene(scene::compile_scene(parse_yaml(text, fuzz::kPlace))),
        simulation(std::make_unique<simulation::Simulation>(scene)) {
    for (int i = 0; i < 20; ++i) simulation->step();
    good = simulation->snapshot();
  }
  scene::Scene scene;
  std::unique_ptr<simulation::Simulation> simulation;
  simulation::RunSnapshot good;
};

const std::string kScene =
    "title: t, duration: 1, objects: [{name: ball, shape: sphere, radius: 0.03, mass: 0.1, position: [0, 0, "
    "0.03]}], ground: {height: 0}, effects: [gravity, ground_contact, friction]";
const std::string kBall = "{" + kScene + "}";
const std::string kArticulatedBall =
    "{" + kScene + ", solver: {engine: articulated, method: semi_implicit_euler}}";
const std::string kPendulum =
    "{title: t, duration: 1, effects: [gravity], bodies: [{name: bob, mass: 0.1, inertia: [1e-4, 1e-4, "
    "1e-4], "
    "position: [0.1, 0, 0]}], joints: [{name: pivot, type: hinge, parent: world, child: bob, position: [0, "
    "0, "
    "0], axes: [{name: swing, axis: [0, 1, 0]}]}], solver: {engine: ";

std::vector<std::unique_ptr<Target>>& targets() {
  static std::vector<std::unique_ptr<Target>> out = [] {
    std::vector<std::unique_ptr<Target>> made;
    made.push_back(std::make_unique<Target>(kBall));
    for (const char* solver : {"dae, method: stabilised_gear, tolerance: 1e-4",
                               "dae, method: lagrange_penalty", "articulated, method: semi_implicit_euler"})
      made.push_back(std::make_unique<Target>(kPendulum + solver + "}}"));
    made.push_back(std::make_unique<Target>(kArticulatedBall));
    return made;
  }();
  return out;
}

/// The file as it stands, and with the sum put right, so that more than the sum is tried.
void parse(std::string_view text) {
  fuzz::read([&] { simulation::parse_snapshot(text, "fuzz"); });
  ArchiveWriter sum;
  sum.word(hash_bytes(text));
  fuzz::read([&] { simulation::parse_snapshot(std::string(text) + sum.bytes(), "fuzz"); });
}

/// Bytes of the fuzzer's laid over those of a good snapshot from a place on; a short tail cuts it off.
void restore(Target& target, std::string_view bytes) {
  if (bytes.size() < 3) return;
  simulation::RunSnapshot bad = target.good;
  const std::size_t at =
      (static_cast<unsigned char>(bytes[0]) * 256U + static_cast<unsigned char>(bytes[1])) % bad.bytes.size();
  const bool cut = (bytes[2] & 1) != 0;
  bytes.remove_prefix(3);
  const std::size_t size = cut ? bytes.size() : std::min(bytes.size(), bad.bytes.size() - at);
  bad.bytes.replace(at, cut ? std::string::npos : size, bytes.substr(0, size));
  try {
    target.simulation->restore(bad);
    for (int i = 0; i < 2; ++i) target.simulation->step();
  } catch (const Error& error) {
    // A simulation that has come to grief stays there.
    if (error.fault()) target.simulation = std::make_unique<simulation::Simulation>(target.scene);
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view bytes = handsim::fuzz::text_of(data + 1, size - 1);
  const std::size_t choice = data[0] % (targets().size() + 1);
  if (choice == 0)
    parse(bytes);
  else
    restore(*targets()[choice - 1], bytes);
  return 0;
}
