// The interface of watchers: each measures every step of a simulation and reports figures, never changing the
// motion. A simulation may have none; standard_watchers.h lists those of `handsim run`.
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

/// The objects that a watcher observes; all of them outlive the watcher.
struct Watched {
  const scene::Scene& scene;
  const engine::Engine& engine;
  const control::Controller* controller = nullptr;  ///< null without control
};

/// Times of the parts of one step.
struct StepTimes {
  double control = 0;                             ///< controller and other commands [ns]
  double step = 0;                                ///< engine [ns]
  std::chrono::steady_clock::time_point watched;  ///< start of the watchers
};

/// A finished step.
struct Step {
  const engine::Engine& engine;  ///< after the step
  const engine::StepReport& report;
  const StepTimes* times = nullptr;  ///< null if the step was not timed
  /// A watcher sets a fault if the motion is invalid; the simulation then fails with it.
  std::optional<PhysicsFault> fault = {};
};

/// A figure and its limit.
struct Verdict {
  std::string name;
  std::string unit;
  std::optional<double> measured = 0;  ///< absent: the run had nothing to measure, e.g. no hold of a pose
  std::optional<double> limit = {};    ///< absent: measured, not judged
  double time = 0;                     ///< of the figure [s]
  std::string where = {};              ///< joint or body of the figure
  bool least = false;                  ///< true for a lower limit

  /// A criterion without a measured value is not held.
  bool held() const { return !limit || (measured && (least ? *measured >= *limit : *measured <= *limit)); }
  bool missed() const { return limit && !measured; }  ///< the run ended before the measurement
  bool failed() const { return !held() && !missed(); }
};

struct SummaryJson;

class Watcher {
 public:
  virtual ~Watcher() = default;

  /// Name of its part in a snapshot; different for each watcher of a simulation.
  virtual std::string_view name() const = 0;
  virtual void update(Step& step) = 0;
  /// True if it uses Step::times. One step in 16 is timed: on small scenes the clock costs as a phase.
  virtual bool wants_times() const { return false; }

  virtual void save(ArchiveWriter& out) const = 0;
  /// Restores its measurements; the run goes on from `state`. @throws Error (input) for data that do not fit.
  virtual void restore(ArchiveReader& in, const model::State& state) = 0;

  /// Adds its figures so far, with the limits of the scene.
  virtual void add_verdicts(const scene::Criteria& /*criteria*/, std::vector<Verdict>& /*out*/) const {}
  /// Adds warnings for the user, one sentence each.
  virtual void add_warnings(std::vector<std::string>& /*out*/) const {}
  /// Adds its part of summary.json (summary_json.h).
  virtual void add_summary(SummaryJson& /*out*/) const {}
};

/// A watch of each of the scene's tasks of one kind.
template <class Watch>
class EachTask : public Watcher {
 public:
  void update(Step& step) final {
    for (Watch& watch : each_) watch.update(step.engine);
  }
  void save(ArchiveWriter& out) const final {
    for (const Watch& watch : each_) watch.save(out);
  }
  void restore(ArchiveReader& in, const model::State& state) final {
    for (Watch& watch : each_) watch.restore(in, state.time);
  }
  const std::vector<Watch>& each() const { return each_; }
  /// Figures so far, in the order of the scene.
  auto figures() const {
    std::vector<std::decay_t<decltype(each_.front().figures())>> out;
    for (const Watch& watch : each_) out.push_back(watch.figures());
    return out;
  }

 protected:
  std::vector<Watch> each_;
};

using Watchers = std::vector<std::unique_ptr<Watcher>>;
/// Makes the watchers of a simulation at its start.
using MakeWatchers = std::function<Watchers(const Watched&)>;

inline Watchers no_watchers(const Watched& /*watched*/) { return {}; }

/// Only these watchers, e.g. `Simulation simulation(scene, only<Monitor, RunHash>)`.
template <class... Each>
Watchers only(const Watched& watched) {
  Watchers out;
  (out.push_back(std::make_unique<Each>(watched)), ...);
  return out;
}

}  // namespace handsim::simulation
