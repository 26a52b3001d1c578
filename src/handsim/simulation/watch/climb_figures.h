// Figures of climbs: the load that the grip carried, and the forces on the parts of the hand.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/scene/task/climb.h"
#include "handsim/simulation/watch/hand_parts.h"
#include "handsim/simulation/watch/watcher.h"

namespace handsim::simulation {

/// Travel of the palm under the load at which a grip fails [m].
inline constexpr double kFailedTravel = 0.02;
/// While the palm is slower than this, the load counts as carried [m/s].
inline constexpr double kHeldSpeed = 0.02;
/// Time for which a failed climb is still measured; after that the load accelerates the hand strongly [s].
inline constexpr double kAfterFailure = 0.01;
inline constexpr double kGripEvery = 2;  ///< Interval of the load at which grips are stored [N].

/// The load of a climb at a time [N].
double load_at(const scene::ClimbPlan& plan, double time);

/// Tensions of a finger's flexors and what they load the pulleys with (model/pulleys.h) [N].
struct FingerLoad {
  std::string finger;
  double deep = 0, superficial = 0;
  double a2 = 0, a4 = 0;
  double ligaments = 0;  ///< share of the hold's moment about the DIP that the deep flexor leaves to the stop
};

/// The grip under one load.
struct LoadedGrip {
  double time = 0;               ///< [s]
  double load = 0;               ///< [N]
  double travel = 0;             ///< of the palm since the start of the load [m]
  std::vector<PartForce> parts;  ///< parts in contact with the hold
  int contacts = 0;
  /// With flexors FDP2 to FDP5 and FDS2 to FDS5: muscle tensions, or those that give DIP and PIP torques.
  std::vector<FingerLoad> fingers;
};

struct ClimbFigures {
  std::string name;             ///< HAND.HOLD
  bool failed = false;          ///< the palm has moved by kFailedTravel
  double carried = 0;           ///< largest load with the palm slower than kHeldSpeed [N]
  double carried_time = 0;      ///< [s]
  double failure_time = 0;      ///< [s]
  double travel = 0;            ///< present travel of the palm under the load [m]
  bool complete = false;        ///< failed, or the load has reached its maximum
  hand::GripStrength strength;  ///< of the person
  LoadedGrip before;            ///< closed, without load
  LoadedGrip half;              ///< at half the load carried
  LoadedGrip last;              ///< at the load carried, within kGripEvery

  /// True if the load has started to grow.
  bool begun() const { return before.time > 0; }
  /// Load carried over the norm of grip strength.
  double share() const { return carried / strength.norm; }
};

class ClimbWatch {
 public:
  /// The model must outlive the watch. @param step of the engine [s].
  ClimbWatch(const model::Model& model, const scene::ClimbPlan& plan, const hand::BuiltHand& hand,
             double step);

  void update(const engine::Engine& engine);
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in, double time);

  ClimbFigures figures() const;
  /// True if the climb failed at least kAfterFailure ago.
  bool over(double time) const;

 private:
  template <class Archive, class Self>
  static void serialize(Archive& archive, Self& self);
  LoadedGrip grip(const engine::Engine& engine) const;
  void collect_flexors(const model::Model& model, const hand::BuiltHand& hand);

  /// The flexors of a finger, with arms by the model's coordinates.
  struct Flexors {
    std::string finger;
    model::TendonPath deep, superficial;
    std::size_t dip = 0, pip = 0;                                ///< coordinates
    std::optional<std::size_t> deep_muscle, superficial_muscle;  ///< in Model::muscles
    /// @param held moments of the hold's forces on the finger, by coordinate [N m]
    FingerLoad load(const model::State& state, const Eigen::VectorXd& held) const;
  };
  const model::Model* model_;
  std::vector<Flexors> flexors_;
  scene::ClimbPlan plan_;
  double half_step_;
  std::size_t dof_ = 0;
  std::vector<std::optional<std::size_t>> part_of_shape_;  ///< in kHandParts, of shapes of the hand
  std::vector<bool> of_hold_;                              ///< by shape
  double start_ = 0;                                       ///< coordinate at the start of the load [m]
  bool loading_ = false;
  ClimbFigures figures_;
  std::vector<LoadedGrip> grips_;  ///< while the palm is held
};

class Climbs final : public EachTask<ClimbWatch> {
 public:
  explicit Climbs(const Watched& watched);

  std::string_view name() const override { return "climbs"; }
  void add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const override;
  void add_summary(SummaryJson& out) const override;

  /// True if every climb failed at least kAfterFailure ago.
  bool over() const;

 private:
  const engine::Engine& engine_;
};

}  // namespace handsim::simulation
