// Joints of a Model as ODE joints: stops, passive tissue and torques on their coordinates. Body 1 of every
// ODE joint is our child and body 2 our parent, so that angles and rates have our signs and no joint is
// reversed; ODE's axis 1 of a universal joint is therefore our axis 1 (in the child), its axis 2 our axis 0.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/engine/ode/bodies.h"
#include "handsim/engine/ode/joint_kinds.h"
#include "handsim/model/angle_sensor.h"

namespace handsim::engine::ode {

/// A stop nearer to zero than this is moved outward by as much: a stop of exactly 0 is in force from the
/// first step of a joint that starts at 0, and one of 1e-9 after the first rounding.
inline constexpr double kStopMargin = 1e-5;        ///< hinge and universal [rad]
inline constexpr double kSliderStopMargin = 1e-5;  ///< slider [m]

class Joints {
 public:
  /// Creates all joints between bodies that may move against each other, in zero configuration, and leaves
  /// bodies there. The model must outlive this object. @param start poses of immovable parents. @throws
  /// OdeFault
  Joints(dWorldID world, const model::Model& model, const Settings& settings,
         const std::vector<OdeBody>& bodies, const model::State& start);

  /// Creates anew joints whose parent has no ODE body, with the parent as in the state; leaves the children.
  void reanchor(const model::State& state);
  bool has_tissue() const { return has_tissue_; }
  /// Adds torques, size model.dof_count(), to the bodies for the next step.
  void add_torques(std::span<const double> torques, const model::State& state) const;
  /// Sets the servo drives of the next step, size model.dof_count() or empty. They exist with actuation only.
  void set_servos(std::span<const model::Servo> servos) { servos_.set(servos); }
  /// @param tau the servos' torques of the step before, or empty: see Servos::relax
  void relax_servos(std::span<const double> tau) { servos_.relax(tau); }
  bool servos_beyond_limits(std::span<const double> tau) const { return servos_.beyond_limits(tau); }
  /// Damping of coordinates beside tissue [N m s/rad], by dof_count(); none where no tendon acts.
  void set_drag(std::span<const double> damping);
  /// Updates tissue, makes stops catch what would pass them in the next step, counts stops in force.
  int prepare(const model::State& state);
  /// Fills q and u of a state from its bodies.
  void read_coordinates(model::State& state) { sensors_.read(state); }
  /// Torques that acted in the step that was just solved from the state last read, by the solver's own
  /// impulses; sizes model.dof_count(). @param given torques of the step, or empty
  void read_torques(std::span<const double> given, std::vector<double>& tau, std::vector<double>& tau_servo);
  /// The stops that were widened, one sentence each.
  const std::vector<std::string>& notes() const { return notes_; }
  /// ODE's joint of a joint of the model; null where neither side can move.
  dJointID id(std::size_t joint) const { return links_[joint].id; }

 private:
  /// A motor that drives axes of a joint: those that slide, or those that turn.
  struct ServoMotor {
    dJointID id = nullptr;
    std::vector<std::size_t> axes;
    std::unique_ptr<dJointFeedback> feedback;
  };
  struct Link {
    const model::Joint* joint = nullptr;
    dJointID id = nullptr;  ///< null: neither side can move
    OdeBody child;
    OdeBody parent;                       ///< without id: the world or a body that has no ODE body
    dJointID motor = nullptr;             ///< tissue: AMotor, or LMotor of a slider
    std::vector<std::size_t> motor_axes;  ///< our axis of each of the motor's axes
    std::vector<model::Tissue> tissue;    ///< of each of these; zero where only tendons act
    // Where ODE writes what the motor did. An address that stays.
    std::unique_ptr<dJointFeedback> by_motor;
    std::vector<ServoMotor> servos;  ///< drive every axis; with actuation only
  };
  /// A joint with tissue, stops or both.
  struct Watch {
    std::size_t link = 0;
    std::array<std::optional<StopArc>, 2> stops;
    std::array<bool, 2> caught = {false, false};
    double pull = 0;  ///< slider: speed towards the tissue's rest per distance [1/s]
  };
  /// A coordinate before a step, and its stop.
  struct Approach {
    std::size_t axis = 0;
    double low = 0, high = 0;  ///< [rad] or [m]
    double q = 0, rate = 0;    ///< [rad], [rad/s] or [m], [m/s]
  };

  Link make_link(dWorldID world, const model::Joint& joint, const std::vector<OdeBody>& bodies,
                 std::vector<std::size_t>& copies_used) const;
  void place(const Link& link, const model::State& state) const;
  void add_stops(const Link& link, const Settings& settings);
  void add_tissue(dWorldID world, Link& link, bool with_tissue);
  void set_tissue(const Link& link) const;
  double slider_pull(const Link& link) const;
  void add_servo(dWorldID world, Link& link);
  void watch(std::size_t link, const Settings& settings);
  void set_stop(const Link& link, std::size_t axis, double low, double high, double erp, double bounce) const;
  bool catch_approach(const Link& link, const Approach& approach, bool& caught) const;
  void let_go(const Link& link, const Approach& approach, bool& caught) const;
  int prepare_stops(Watch& watched, const model::State& state) const;
  void prepare_tissue(const Watch& watched, const model::State& state) const;
  model::Stop widened(const model::Joint& joint, std::size_t axis, bool note);

  std::vector<Link> links_;  ///< as Model::joints
  std::vector<Watch> watches_;
  model::JointSensors sensors_;
  Servos servos_;
  double step_;  ///< [s]
  double erp_;   ///< of the stops
  std::vector<std::string> notes_;
  bool has_tissue_ = false;
  std::vector<bool> dragged_;  ///< by dof: a tendon crosses it
  std::vector<double> drag_;   ///< by dof
};

}  // namespace handsim::engine::ode
