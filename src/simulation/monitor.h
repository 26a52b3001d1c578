// Watches a run step by step: how far joints come apart and stops are overshot. Costs a small share of a step.
#pragma once

#include <string>
#include <vector>

#include "handsim/model/state.h"

namespace handsim::simulation {

/// A largest value and where and when it was met.
struct Peak {
  double value = 0;
  double time = 0;    ///< [s]
  std::string where;  ///< joint or joint axis
};

class Monitor {
 public:
  /// @param stops whether joint stops are in force.
  Monitor(const model::Model& model, double step, bool stops);

  /// Looks at the state after a step.
  void look(const model::State& state);

  /// Largest joint gap so far [m].
  Peak joint_gap() const;
  /// Largest overshoot of a stop, less what the step that crossed it explains (rate at the crossing times step)
  /// [rad] or [m]; 0 where no stop was ever overshot by more.
  Peak stop_overshoot() const;
  /// Largest overshoot of a stop in the last state seen [rad] or [m].
  Peak stop_rest() const;

 private:
  struct Watched {
    int joint = 0;
    double overshoot[2] = {0, 0};  ///< of each axis in the last state, 0 inside the stops
    double allowed[2] = {0, 0};    ///< rate at the crossing times step
  };
  void look_at_stops(Watched& watched, const model::State& state);
  Peak named(double value, double time, int joint, int axis) const;

  const model::Model& model_;
  double step_;
  bool stops_;
  std::vector<Watched> watched_;
  double gap_ = 0, gap_time_ = 0;
  int gap_joint_ = 0;
  double excess_ = 0, excess_time_ = 0;
  int excess_joint_ = 0, excess_axis_ = 0;
  double last_time_ = 0;
};

}  // namespace handsim::simulation
