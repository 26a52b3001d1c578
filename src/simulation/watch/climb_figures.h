// A climb as it runs: what moves and loads the palm on its rail, and what load the grip carried.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/scene/task/climb.h"
#include "handsim/simulation/watch/hand_parts.h"

namespace handsim::simulation {

/// A grip has failed once the palm has moved by this much under the load [m].
inline constexpr double kFailedTravel = 0.02;
/// A palm that moves slower than this is held: the load it bears then is carried [m/s].
inline constexpr double kHeldSpeed = 0.02;
/// A climb that has failed is looked at for so long: hundreds of newtons throw half a kilogram far [s].
inline constexpr double kAfterFailure = 0.01;
/// Grips are kept at every so many newtons of load.
inline constexpr double kGripEvery = 2;

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

class ClimbWatch {
 public:
  /// The model must outlive the watch. @param step of the engine [s].
  ClimbWatch(const model::Model& model, const scene::ClimbPlan& plan, double step);

  /// What acts on the rail in the step from a state: adds to torques and servos, sizes model.dof_count().
  void command(const model::State& state, std::span<double> torques, std::span<model::Servo> servos) const;
  /// Looks at the engine after a step.
  void look(const engine::Engine& engine);

  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

  ClimbFigures figures() const;
  /// The load of a time [N].
  double load(double time) const;
  /// Failed, and looked at for kAfterFailure since.
  bool over(double time) const;

 private:
  template <class Archive, class Self>
  static void carry(Archive& archive, Self& self);
  LoadedGrip grip(const engine::Engine& engine) const;
  double target(double time) const;

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

}  // namespace handsim::simulation
