// Which scene, engine and mathematics library a simulation is of.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// Identifies a simulation's scene and mathematics library, so that no other restores its snapshots: name and
/// hash of each part that motion depends on. Not title, duration, recording, pictures, criteria.
using Fingerprint = std::vector<std::pair<std::string, std::uint64_t>>;

Fingerprint fingerprint(const scene::Scene& scene, const engine::Engine& engine);

/// Names of parts that differ or that only one has; empty if there are none.
std::vector<std::string> differences(const Fingerprint& a, const Fingerprint& b);

/// The mathematics library and a hash of results of its functions at fixed arguments, e.g. `glibc 2.36,
/// results 1f2e3d4c`: runs of one build have the same bits if this is the same. glibc has several versions of
/// each function: without fused multiply-add, the last bits of results differ.
const std::string& mathematics();

}  // namespace handsim::simulation
