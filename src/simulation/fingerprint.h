// Which scene and which mathematics library a simulation is of, so that no other restores its snapshots.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// What the motion of a scene depends on, part by part, so that a difference can be named: each part's name
/// (`solver.step`, `hands.0`) and the hash of its value. Title, duration, recording, pictures and criteria
/// are no part of it.
using Fingerprint = std::vector<std::pair<std::string, std::uint64_t>>;

Fingerprint fingerprint(const scene::Scene& scene, const engine::Engine& engine);

/// Names of parts that differ or that only one has; empty where none does.
std::vector<std::string> differences(const Fingerprint& a, const Fingerprint& b);

/// The library that rounds a run's sines and powers, and a hash of what its functions give at fixed
/// arguments, e.g. `glibc 2.36, results 1f2e3d4c`: runs of one build repeat to the bit where this is the
/// same. glibc has several of each function: on processors without fused multiply-add last bits differ, and
/// with them a run.
const std::string& mathematics();

}  // namespace handsim::simulation
