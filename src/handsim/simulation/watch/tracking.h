// Tracking figures of each driven joint axis: errors over the run; settling time, overshoot and steady error
// of each movement of its program; torques and the share of time at the torque limit.
#pragma once

#include <string>
#include <vector>

#include "handsim/core/units.h"
#include "handsim/simulation/watch/monitor.h"
#include "handsim/simulation/watch/watcher.h"

namespace handsim::simulation {

/// A movement has settled when the error stays within this share of the movement for the rest of the hold.
inline constexpr double kSettledShare = 0.02;

/// The steady error is measured over this time at the end of a hold, or up to twice as much [s].
inline constexpr double kSteadyWindow = 0.05;

/// RMS error over all axes beyond which a hand driven by muscles does not follow its targets [rad].
inline constexpr double kLostTargets = 7 * kDegree;

/// Figures of one axis.
struct AxisTracking {
  std::string name;
  double rms_error = 0;       ///< over all steps [rad]
  Peak largest_error;         ///< [rad]
  Peak steady_error;          ///< largest in the last kSteadyWindow of any hold [rad]
  Peak overshoot;             ///< largest, as a share of its movement
  Peak settling_time;         ///< longest, from the movement's start [s]
  int holds = 0;              ///< holds of poses that the target reached
  int movements = 0;          ///< movements of at least control::kSmallestMovement with a complete hold
  int unsettled = 0;          ///< those that had not settled at the end of their hold
  double largest_torque = 0;  ///< [N m]
  double limit_share = 0;     ///< share of steps with the torque at its limit
};

class Tracking final : public Watcher {
 public:
  /// The scene must have a controller.
  explicit Tracking(const Watched& watched);

  std::string_view name() const override { return "tracking"; }
  void update(Step& step) override;
  void save(ArchiveWriter& out) const override;
  void restore(ArchiveReader& in, const model::State& state) override;
  void add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const override;
  void add_warnings(std::vector<std::string>& out) const override;
  void add_summary(SummaryJson& out) const override;

  /// Figures of each driven axis so far; present holds count as ended.
  std::vector<AxisTracking> figures() const;
  /// Axis with the largest RMS error; null if there is none.
  static const AxisTracking* worst(const std::vector<AxisTracking>& axes);

 private:
  struct Axis {
    double square_sum = 0, largest = 0, largest_time = 0, torque = 0;
    long at_limit = 0;
    // The present movement.
    double from = 0, to = 0;
    double last_outside = 0;  ///< last time outside the settled band [s]
    double beyond = 0;        ///< largest angle beyond the target [rad]
    double error_before = 0;  ///< largest error in the last complete window [rad]
    double error_now = 0;     ///< largest error in the present window [rad]
  };
  struct Hand {
    std::size_t first = 0, last = 0;  ///< its axes
    const control::Trajectory* trajectory = nullptr;
    std::size_t phase = 0;  ///< the next to start
    bool moving = false;    ///< phase - 1 is the present movement
    double window = 0;      ///< start of the present window [s]
  };
  template <class Archive, class Self>
  static void serialize(Archive& archive, Self& self);
  void begin_phase(Hand& hand);
  void follow(Hand& hand, double time);
  void end_phase(Hand& hand, double time);

  const engine::Engine& engine_;
  const control::Controller& controller_;
  bool by_muscles_;
  double step_;
  long steps_ = 0;
  std::vector<Axis> axes_;
  std::vector<Hand> hands_;
  std::vector<AxisTracking> figures_;
};

}  // namespace handsim::simulation
