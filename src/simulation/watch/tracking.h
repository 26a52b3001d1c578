// How well each driven joint axis follows its target, step by step: errors over the run; settling, overshoot
// and steady error over each movement of its program; torques and how long they stood at their limit.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/simulation/watch/monitor.h"
#include "handsim/simulation/watch/watcher.h"

namespace handsim::simulation {

/// Settled: within this share of the movement for the rest of its hold.
inline constexpr double kSettledShare = 0.02;

/// The steady error is taken over this much of the end of a hold, up to twice as much [s].
inline constexpr double kSteadyWindow = 0.05;

/// Figures of one axis.
struct AxisTracking {
  std::string name;
  double rms_error = 0;       ///< over all steps [rad]
  Peak largest_error;         ///< [rad]
  Peak steady_error;          ///< largest in the last kSteadyWindow of any hold [rad]
  Peak overshoot;             ///< largest, as a share of its movement
  Peak settling_time;         ///< longest, from the movement's start [s]
  int holds = 0;              ///< of poses that the target reached
  int movements = 0;          ///< of at least control::kSmallestMovement that were held to their end
  int unsettled = 0;          ///< of those, that had not settled when their hold ended
  double largest_torque = 0;  ///< [N m]
  double limit_share = 0;     ///< of the steps with the torque at its limit
};

class Tracking final : public Watcher {
 public:
  /// Of a scene with a controller.
  explicit Tracking(const Watched& watched);

  std::string_view name() const override { return "tracking"; }
  void update(Step& step) override;
  void save(ArchiveWriter& out) const override;
  void restore(ArchiveReader& in, const model::State& state) override;
  void add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const override;
  void add_summary(SummaryJson& out) const override;

  /// By driven axis, up to now, holds that are under way closed.
  std::vector<AxisTracking> figures() const;
  /// Axis with the largest RMS error; null where none is driven.
  static const AxisTracking* worst(const std::vector<AxisTracking>& axes);

 private:
  struct Axis {
    double square_sum = 0, largest = 0, largest_time = 0, torque = 0;
    long at_limit = 0;
    // Of the movement under way.
    double from = 0, to = 0;
    double last_outside = 0;  ///< time at which it last was outside the settled band [s]
    double beyond = 0;        ///< farthest beyond the target [rad]
    double error_before = 0;  ///< largest error to the pose in the last whole window [rad]
    double error_now = 0;     ///< and in the one under way [rad]
  };
  struct Hand {
    std::size_t first = 0, last = 0;  ///< its axes
    const control::Trajectory* trajectory = nullptr;
    std::size_t phase = 0;  ///< the next to start
    bool moving = false;    ///< phase - 1 is under way
    double window = 0;      ///< start of the window under way [s]
  };
  template <class Archive, class Self>
  static void carry(Archive& archive, Self& self);
  void begin(Hand& hand);
  void follow(Hand& hand, double time);
  void end(Hand& hand, double time);

  const engine::Engine& engine_;
  const control::Controller& controller_;
  double step_;
  long steps_ = 0;
  std::vector<Axis> axes_;
  std::vector<Hand> hands_;
  std::vector<AxisTracking> figures_;
};

}  // namespace handsim::simulation
