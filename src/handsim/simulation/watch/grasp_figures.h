// Figures of grasps: motion of the object in the hand, contact forces and grasp quality. Motion is measured
// at every step of the plan's hold and shake, contacts at the end of the hold and after the shake.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/engine/collision/pair_table.h"
#include "handsim/scene/task/grasp.h"
#include "handsim/simulation/watch/hand_parts.h"
#include "handsim/simulation/watch/watcher.h"
#include "handsim/simulation/watch/wrench_space.h"

namespace handsim::simulation {

/// Limits of a held grasp for the motion of the object relative to the palm.
inline constexpr double kHeldShift = 2e-3;                     ///< after the shake [m]
inline constexpr double kHeldTurn = 2 * 0.017453292519943295;  ///< after the shake [rad]
inline constexpr double kShakenShift = 5e-3;                   ///< at any time of the shake [m]
/// Time span at the end of the hold over which the slip speed is measured [s].
inline constexpr double kSlipSpan = 4;
/// An object that no part of the hand has touched for so long is lost [s]: it has fallen 0.3 m.
inline constexpr double kLostSpan = 0.25;
/// Time for which an object that has moved too far is watched further [s]: the hand may let go of it.
inline constexpr double kMovedSpan = 0.5;

/// The grip at one time.
struct Grip {
  double time = 0;               ///< [s]
  std::vector<PartForce> parts;  ///< parts in contact, palm first
  int contacts = 0;
  int others = 0;     ///< contacts of the object with other things than the hand
  double normal = 0;  ///< sum over the hand [N]
  /// Largest friction over friction limit of a part, among parts with a thousandth of the sum of normal
  /// forces. Can exceed 1 with quick_step, which has a friction pyramid (1.41 on its diagonal).
  double friction_used = 0;
  WrenchSpace wrenches;
};

/// The result of a grasp.
enum class Outcome {
  cut_off,  ///< the run ended before the plan
  held,
  moved,  ///< the object moved beyond the limits, or it touches something else
  lost,   ///< the object left the hand
};

struct GraspFigures {
  std::string name;         ///< HAND.OBJECT
  bool complete = false;    ///< the run reached the end of the plan
  Grip hold;                ///< at the end of the hold
  Grip after;               ///< at the end of the plan
  double slip = 0;          ///< mean drift of the object's centre in the palm over the end of the hold [m/s]
  double spin = 0;          ///< the same of its orientation [rad/s]
  double shaken_shift = 0;  ///< largest movement from the end of the hold, during the shake [m]
  double shaken_time = 0;   ///< of it [s]
  double shift = 0;         ///< movement from the end of the hold to the end of the plan [m]
  double turn = 0;          ///< the same [rad]
  bool held = false;        ///< within the limits, with contacts of the hand and no others
  std::optional<double> left_time = {};  ///< time of the last contact [s], while the hand has none
  std::string last_part;                 ///< part of the last contact; empty if there was none after the lift
  std::optional<double> moved_time = {};  ///< first time beyond the limit of motion in the shake [s]
  double watched_time = 0;                ///< of the latest step [s]

  /// True if the run reached the end of the hold.
  bool hold_measured() const { return hold.time > 0; }
  /// True if the object has moved beyond the limit of the shake, so that the grasp cannot be held any more.
  bool failed() const { return shaken_shift > kShakenShift; }
  /// The hand has let go of the object. @param now time of the run [s]
  bool lost(double now) const { return left_time && now - *left_time >= kLostSpan; }
  /// The object is lost, or it has moved too far for kMovedSpan. @param now time of the run [s]
  bool decided(double now) const {
    return lost(now) || (failed() && now - moved_time.value_or(0) >= kMovedSpan);
  }
  Outcome outcome() const;
  /// True if there is a margin: a lost object has none, wherever it lies.
  bool margin_measured() const { return outcome() == Outcome::held || outcome() == Outcome::moved; }
  /// Smallest distance to a limit, as a share of the limit; negative beyond it.
  double margin() const;
  /// Text of the outcome, with time and contact of a loss: `held`, `LOST at 4.21 s, last by the thumb`.
  std::string told() const;
  /// True if force closure and the verdict `held` disagree.
  bool disagree() const { return complete && held != after.wrenches.force_closure; }
};

/// `held`, `MOVED`, `LOST`, `cut off`.
inline const char* word(Outcome outcome) {
  constexpr const char* kWords[] = {"cut off", "held", "MOVED", "LOST"};
  return kWords[static_cast<std::size_t>(outcome)];
}

class GraspWatch {
 public:
  /// The model must outlive the watch. @param step of the engine [s].
  GraspWatch(const model::Model& model, const scene::GraspPlan& plan, double step);

  void update(const engine::Engine& engine);
  void save(ArchiveWriter& out) const;
  /// @param time of the state [s]
  void restore(ArchiveReader& in, double time);
  const GraspFigures& figures() const { return figures_; }

 private:
  Pose object_in_palm(const model::State& state) const;
  Grip grip(const engine::Engine& engine) const;
  void watch_touch(const engine::Engine& engine);
  void finish(const engine::Engine& engine, const Pose& now);

  const model::Model& model_;
  engine::PairTable rules_;
  double half_step_;
  std::size_t palm_ = 0, object_ = 0;
  double length_ = 0;  ///< largest radius of the object about its centre of mass [m]
  double lift_start_ = 0, slip_start_ = 0, hold_end_ = 0, end_ = 0;
  std::vector<std::optional<std::size_t>> part_of_shape_;  ///< in kHandParts, of shapes of the hand
  std::optional<Pose> at_slip_start_, at_hold_end_;
  GraspFigures figures_;
};

class Grasps final : public EachTask<GraspWatch> {
 public:
  explicit Grasps(const Watched& watched);

  std::string_view name() const override { return "grasps"; }
  void add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const override;
  void add_summary(SummaryJson& out) const override;

  /// True if an object has already moved too far.
  bool failed() const;
  /// A grasp is decided: the rest of the run cannot mend it. @param now its time [s]
  bool decided(double now) const;
};

}  // namespace handsim::simulation
