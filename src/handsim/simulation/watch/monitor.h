// Measures joint gaps and angles beyond stops at every step.
#pragma once

#include <concepts>
#include <string>
#include <type_traits>
#include <vector>

#include "handsim/core/archive.h"
#include "handsim/simulation/watch/watcher.h"

namespace handsim::simulation {

/// A largest value with its place and time.
struct Peak {
  double value = 0;
  double time = 0;         ///< [s]
  std::string where = {};  ///< joint, joint axis or pair of shapes

  void raise(double other, double at, const std::string& place) {
    if (other > value) *this = {other, at, place};
  }
};

template <class Archive, class T>
requires std::same_as<std::remove_const_t<T>, Peak>
void serialize(Archive& archive, T& peak) { archive(peak.value, peak.time, peak.where); }

/// A larger joint gap ends a run [m]; segments of a hand are shorter than this.
inline constexpr double kLargestGap = 0.1;

class Monitor final : public Watcher {
 public:
  explicit Monitor(const Watched& watched);
  /// Without an engine. The model must outlive this object. @param step of the engine [s]. @param stops in
  /// effect
  Monitor(const model::Model& model, double step, bool stops);

  std::string_view name() const override { return "monitor"; }
  void update(Step& step) override;
  /// Measures the state after a step.
  void update(const model::State& state);
  void save(ArchiveWriter& out) const override;
  void restore(ArchiveReader& in, const model::State& state) override;
  void add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const override;

  /// True if a joint has an active stop.
  bool has_stops() const { return !stopped_.empty(); }
  /// Largest joint gap so far [m].
  Peak joint_gap() const;
  /// Overshoot of a stop less the step that crossed it (rate times step, plus 1e-6), >= 0 [rad] or [m].
  const Peak& stop_overshoot() const { return excess_; }
  /// Largest overshoot of a stop in a state [rad] or [m].
  Peak stop_rest(const model::State& state) const;

 private:
  struct StoppedAxis {
    const model::Joint* joint = nullptr;
    std::size_t axis = 0;
    double overshoot = 0;  ///< present value; 0 inside the stops
    double allowed = 0;    ///< rate at the crossing times step

    std::size_t dof() const;
    double overshoot_in(const model::State& state) const;
    std::string name() const { return joint->name + "." + joint->axes[axis].name; }
  };
  template <class Archive, class Self>
  static void serialize(Archive& archive, Self& self);
  void update_gaps(const model::State& state);
  void update_stops(const model::State& state);

  const model::Model& model_;
  const engine::Engine* engine_ = nullptr;  ///< null for states from other sources
  double step_;
  std::vector<StoppedAxis> stopped_;
  std::vector<Vec3> slider_axes_;  ///< of each joint in its parent; zero for other joints
  double gap2_ = 0, gap_time_ = 0;
  std::size_t gap_joint_ = 0;
  Peak excess_;
};

}  // namespace handsim::simulation
