// What watches a simulation: a watcher gets each step, measures, and reports what it found. It never changes
// the motion. A simulation has any number of watchers, also none; standard_watchers.h lists those that
// `handsim run` has.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/control/controller.h"
#include "handsim/engine/engine.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// What a watcher watches; all of it outlives the watcher.
struct Watched {
  const scene::Scene& scene;
  const engine::Engine& engine;
  const control::Controller* controller = nullptr;  ///< null where the scene drives no joint
};

/// What the parts of one step took.
struct StepTimes {
  double control = 0;                             ///< sensing joints and working out what drives them [ns]
  double step = 0;                                ///< the engine [ns]
  std::chrono::steady_clock::time_point watched;  ///< when the watchers' turn began
};

/// A step that has been made.
struct Step {
  const engine::Engine& engine;  ///< after the step
  const engine::StepReport& report;
  const StepTimes* times = nullptr;  ///< null where the step was not timed
  /// Set by a watcher that finds the motion unsound: the simulation then fails with it.
  std::optional<PhysicsFault> fault = {};
};

/// A criterion's figure beside its limit.
struct Verdict {
  std::string name;
  std::string unit;
  std::optional<double> measured = 0;  ///< absent: the run had nothing to measure, e.g. no hold of a pose
  std::optional<double> limit = {};    ///< absent: measured, not judged
  double time = 0;                     ///< of the figure [s]
  std::string where = {};              ///< joint or body of the figure
  bool least = false;                  ///< the limit is the least that will do, not the most

  /// A criterion without a measured value is not held.
  bool held() const { return !limit || (measured && (least ? *measured >= *limit : *measured <= *limit)); }
  bool missed() const { return limit && !measured; }  ///< the run did not come to what is judged
  bool failed() const { return !held() && !missed(); }
};

struct SummaryJson;

class Watcher {
 public:
  virtual ~Watcher() = default;

  /// Of its part in a snapshot; different for each watcher of a simulation.
  virtual std::string_view name() const = 0;
  /// Called after each step.
  virtual void update(Step& step) = 0;
  /// Whether it uses Step::times. One step in 16 is timed then: on small scenes the clock costs as much as a
  /// phase of the step.
  virtual bool wants_times() const { return false; }

  /// What it has measured, and back.
  virtual void save(ArchiveWriter& out) const = 0;
  /// @param state that the run goes on from. @throws Error (input) for bytes that do not fit; the watcher
  ///        must then be restored from others.
  virtual void restore(ArchiveReader& in, const model::State& state) = 0;

  /// Figures up to now, beside the limits that the scene sets them.
  virtual void add_verdicts(const scene::Criteria& /*criteria*/, std::vector<Verdict>& /*out*/) const {}
  /// What the user should know of the run, one sentence each.
  virtual void add_warnings(std::vector<std::string>& /*out*/) const {}
  /// Its part of summary.json (summary_json.h).
  virtual void add_summary(SummaryJson& /*out*/) const {}
};

/// Saves fields in turn, or restores them (core/archive.h).
template <class Archive, class... Fields>
void carry_all(Archive& archive, Fields&... fields) {
  (archive(fields), ...);
}

using Watchers = std::vector<std::unique_ptr<Watcher>>;
/// Makes the watchers of a simulation at its start.
using MakeWatchers = std::function<Watchers(const Watched&)>;

/// For a bare simulation.
inline Watchers no_watchers(const Watched& /*watched*/) { return {}; }

/// These watchers alone, e.g. `Simulation simulation(scene, only<Monitor, RunHash>)`.
template <class... Each>
Watchers only(const Watched& watched) {
  Watchers out;
  (out.push_back(std::make_unique<Each>(watched)), ...);
  return out;
}

}  // namespace handsim::simulation
