// Engines of one topology that step side by side, a lane of the vector unit each (an engine alone has lane =
// finger). An engine is loaded, stepped with its joints' controller in the same lanes, and stored; its bits
// are those of steps alone. A lane whose step needs more than the smooth part (contact, fast spin, a motion
// that diverges) leaves: its engine is stored at that step's start and takes it alone.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "handsim/engine/engine.h"

namespace handsim::engine::articulated {

/// A driven axis of control::Controller, with implicit gains.
struct LaneDrive {
  std::size_t dof = 0;
  double proportional = 0, derivative = 0, integral = 0, limit = 0, zone = 0, smoothing = 1;
  double tissue_stiffness = 0, tissue_rest = 0;
  double target = 0;
};
/// What it keeps from step to step, after `observe`.
struct LaneDriveState {
  double angle = 0, rate = 0, target = 0, torque = 0;
  bool at_limit = false;
  double integral = 0, filtered_rate = 0;
};
/// A joint of control::GravityLoad.
struct LaneLink {
  std::size_t parent = 0, child = 0, dof = 0;
  double mass = 0, child_mass = 0;
  bool adds_to_parent = false, turns = false, universal = false;
  Vec3 frame = Vec3::Zero(), first_axis = Vec3::Zero(), second_axis = Vec3::Zero();
};
/// The control of one lane.
struct LaneControlPlan {
  std::vector<LaneDrive> drives;
  std::vector<LaneLink> links;  ///< children before parents; empty: no compensation
  Vec3 gravity = Vec3::Zero();  ///< that is compensated [m/s^2]
};

class LaneGroup {
 public:
  /// Null where the processor has no lanes, for other engines, and for what lanes do not have: loops, balls,
  /// a method for smooth motion. @param widest most lanes: the processor's up to these
  static std::unique_ptr<LaneGroup> make(const Engine& like, int widest);
  virtual ~LaneGroup() = default;

  virtual int width() const = 0;
  /// True where an engine can step in lanes from where it is: its drives stand still, and its bodies do not
  /// spin fast. @param engine of the topology that the group was made for, @param driven by torques
  virtual bool fits(Engine& engine, bool driven) const = 0;
  /// Sets the constants of a lane: those of the engine's model, and of its control. @param plan null: no
  ///        control; all lanes have control, or none. @param key of these numbers, from there on
  virtual void set_constants(int lane, Engine& engine, const LaneControlPlan* plan, std::uint64_t key) = 0;
  /// Key of the lane's constants; nothing before these are set.
  virtual std::optional<std::uint64_t> key(int lane) const = 0;
  /// @param engine that fits, with the lane's constants. @param torques size dof_count() or empty, and
  ///        @param excitations are in force until the lane is stored, and must last as long
  virtual void load(int lane, Engine& engine, std::span<const double> torques,
                    std::span<const double> excitations) = 0;
  virtual void set_drive_state(int lane, std::size_t drive, const LaneDriveState& state) = 0;
  virtual LaneDriveState drive_state(int lane, std::size_t drive) const = 0;
  virtual void set_target(int lane, std::size_t drive, double target) = 0;
  virtual void set_targets(std::size_t drive, double target) = 0;
  /// Fills lanes without an engine, and finds where all bodies are. After the last `load`.
  virtual void start() = 0;
  virtual double time(int lane) const = 0;  ///< [s]
  /// One step of the engines that are in lanes. @returns those that have to leave, one bit each: they are at
  /// the start of the step, to be stored; the others have made it.
  virtual unsigned step() = 0;
  /// Ends the lane's stay. @param leaves in a step that it has to make alone
  virtual void store(int lane, bool leaves) = 0;
};

}  // namespace handsim::engine::articulated
