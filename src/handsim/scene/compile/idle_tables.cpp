#include "handsim/scene/compile/idle_tables.h"

#include <algorithm>

#include <fmt/format.h>

namespace handsim::scene {

namespace {

/// True for a motion whose targets change, but not during the run.
bool idles(const control::Trajectory& motion, const SceneSpec& spec) {
  const auto first = motion.knot(0);
  bool changes = false;
  for (std::size_t i = 1; i < motion.knots() && !changes; ++i)
    changes = !std::ranges::equal(motion.knot(i), first);
  std::vector<double> start(motion.width()), now(start);
  motion.at(0, start);
  const auto steps = static_cast<long>(spec.duration / spec.solver.step);
  for (long i = 0; changes && i <= steps; ++i) {
    motion.at(static_cast<double>(i) * spec.solver.step, now);
    if (now != start) return false;
  }
  return changes;
}

}  // namespace

void warn_of_idle_tables(const Scene& scene, Diagnostics& diagnostics) {
  const SceneSpec& spec = scene.spec;
  const auto warn = [&](const std::string& what) {
    diagnostics.warnings.push_back(fmt::format(
        "{}: nothing changes during the run, from 0 to {:g} s: its times are before or after that", what,
        spec.duration));
  };
  const auto outside = [&](double begin, double end) {
    return end > begin && (begin >= spec.duration || end <= 0);
  };
  for (std::size_t i = 0; i < spec.hands.size(); ++i) {
    const auto& keys = spec.hands[i].placement.motion.keys;
    if (!keys.empty() && outside(keys.front().time, keys.back().time))
      warn(fmt::format("wrist.motion of hand {}", scene.model.hands[i].name));
    if (!scene.control || i >= scene.plans.control->programs.size()) continue;
    const std::string& program = scene.plans.control->programs[i].program;
    if (control::is_motion_file(program) && idles(scene.control->hands[i].trajectory, spec))
      warn(fmt::format("{}, angles of hand {}", program, scene.model.hands[i].name));
  }
  if (!scene.muscles || !scene.muscles->table) return;
  const control::MotionTable& table = *scene.muscles->table;
  if (outside(table.times.front(), table.times.back())) warn("excitations " + table.file);
}

}  // namespace handsim::scene
