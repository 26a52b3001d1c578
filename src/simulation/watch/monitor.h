// Watches a run step by step: how far joints come apart, stops are overshot and shapes penetrate. Costs a
// small share of a step: a joint's coordinates are worked out only when it may have moved far enough since to
// matter.
#pragma once

#include <array>
#include <concepts>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "handsim/core/archive.h"
#include "handsim/engine/engine.h"

namespace handsim::simulation {

/// A largest value and where and when it was met.
struct Peak {
  double value = 0;
  double time = 0;    ///< [s]
  std::string where;  ///< joint, joint axis or pair of shapes
};

template <class Archive, class T>
requires std::same_as<std::remove_const_t<T>, Peak>
void carry(Archive& archive, T& peak) {
  archive(peak.value);
  archive(peak.time);
  archive(peak.where);
}

class Monitor {
 public:
  /// @param step of the engine [s]. @param stops whether joint stops are in force.
  Monitor(const model::Model& model, double step, bool stops);

  /// Looks at the state after a step.
  void look(const model::State& state);
  /// Looks at the contact points of a step. @param time of the state that they were found at [s].
  void look(std::span<const engine::Contact> contacts, double time);

  /// Whether any joint has a stop that is in force.
  bool has_stops() const { return !watched_.empty(); }
  /// Largest depth of any contact point so far [m], `A and B` by the names of the shapes.
  Peak penetration() const;
  /// Whether any joint has been further apart than this [m].
  bool apart(double limit) const { return gap2_ > limit * limit; }
  /// Largest joint gap so far [m].
  Peak joint_gap() const;
  /// Largest overshoot of a stop, less what the step that crossed it explains (rate at the crossing times
  /// step) [rad] or [m], resolved to 1e-6; 0 where no stop was ever overshot by more.
  Peak stop_overshoot() const;
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

  /// Largest overshoot of a stop in a state [rad] or [m].
  Peak stop_rest(const model::State& state) const;

 private:
  /// A joint with a stop.
  struct Watched {
    int joint = 0;
    /// Movement of any coordinate that cannot bring news: what is left to the nearest stop, or the
    /// resolution.
    double leeway = 0;
    std::array<double, 2> overshoot = {0, 0};  ///< of each axis when last worked out, 0 inside the stops
    std::array<double, 2> allowed = {0, 0};    ///< rate at the crossing times step
  };
  template <class Archive, class Self>
  static void carry(Archive& archive, Self& self);
  void look_at_gaps(const model::State& state);
  void look_at_stops(Watched& watched, const model::State& state);
  void book(Watched& watched, std::size_t axis, double over, const model::State& state);

  const model::Model& model_;
  double step_;
  std::vector<Watched> watched_;
  std::vector<Vec3> slider_axes_;  ///< of each joint in its parent; zero where it is no slider
  double gap2_ = 0, gap_time_ = 0;
  std::size_t gap_joint_ = 0;
  Peak excess_;
  double depth_ = 0, depth_time_ = 0;
  int deep_a_ = 0, deep_b_ = 0;  ///< shapes
};

}  // namespace handsim::simulation
