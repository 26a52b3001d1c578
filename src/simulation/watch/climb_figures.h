// Figures of climbs: what load the grip carried, and through which parts of the hand.
#pragma once

#include <string>
#include <vector>

#include "handsim/scene/task/climb.h"
#include "handsim/simulation/watch/hand_parts.h"
#include "handsim/simulation/watch/watcher.h"

namespace handsim::simulation {

/// A grip has failed once the palm has moved by this much under the load [m].
inline constexpr double kFailedTravel = 0.02;
/// A palm that moves slower than this is held: the load it bears then is carried [m/s].
inline constexpr double kHeldSpeed = 0.02;
/// A climb that has failed is measured for so long: hundreds of newtons throw half a kilogram far [s].
inline constexpr double kAfterFailure = 0.01;
/// Grips are kept at every so many newtons of load.
inline constexpr double kGripEvery = 2;

/// The load of a climb at a time [N].
double load_at(const scene::ClimbPlan& plan, double time);

/// The grip under one load.
struct LoadedGrip {
  double time = 0;               ///< [s]
  double load = 0;               ///< [N]
  double travel = 0;             ///< of the palm since the load began [m]
  std::vector<PartForce> parts;  ///< what touches the hold
  int contacts = 0;
};

struct ClimbFigures {
  std::string name;             ///< HAND.HOLD
  bool failed = false;          ///< the palm has moved by kFailedTravel
  double carried = 0;           ///< largest load with the palm slower than kHeldSpeed [N]
  double carried_time = 0;      ///< [s]
  double failure_time = 0;      ///< [s]
  double travel = 0;            ///< of the palm under the load, now [m]
  bool complete = false;        ///< failed, or the load has grown to its end
  hand::GripStrength strength;  ///< of the person
  LoadedGrip before;            ///< closed, without load
  LoadedGrip half;              ///< at half the load carried
  LoadedGrip last;              ///< at the load carried, within kGripEvery

  /// The load has begun to grow.
  bool begun() const { return before.time > 0; }
  /// Load carried over the norm of people alike.
  double share() const { return carried / strength.norm; }
};

/// One climb of the scene.
class ClimbWatch {
 public:
  /// The model must outlive the watch. @param step of the engine [s].
  ClimbWatch(const model::Model& model, const scene::ClimbPlan& plan, double step);

  void update(const engine::Engine& engine);
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

  ClimbFigures figures() const;
  /// Failed, and measured for kAfterFailure since.
  bool over(double time) const;

 private:
  template <class Archive, class Self>
  static void carry(Archive& archive, Self& self);
  LoadedGrip grip(const engine::Engine& engine) const;

  scene::ClimbPlan plan_;
  double half_step_;
  std::size_t dof_ = 0;
  std::vector<int> part_of_shape_;  ///< by shape: -1 no part of the hand, else index into kHandParts
  std::vector<bool> of_hold_;       ///< by shape
  double start_ = 0;                ///< coordinate at which the load began [m]
  bool loading_ = false;
  ClimbFigures figures_;
  std::vector<LoadedGrip> grips_;  ///< while the palm is held
};

/// The climbs of a scene.
class Climbs final : public Watcher {
 public:
  explicit Climbs(const Watched& watched);

  std::string_view name() const override { return "climbs"; }
  void update(Step& step) override;
  void save(ArchiveWriter& out) const override;
  void restore(ArchiveReader& in, const model::State& state) override;
  void add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const override;
  void add_summary(SummaryJson& out) const override;

  /// Up to now, in the order of the scene.
  std::vector<ClimbFigures> figures() const;
  const std::vector<ClimbWatch>& each() const { return climbs_; }
  /// Every climb has failed, and has been measured for kAfterFailure since.
  bool over() const;

 private:
  const engine::Engine& engine_;
  std::vector<ClimbWatch> climbs_;
};

}  // namespace handsim::simulation
