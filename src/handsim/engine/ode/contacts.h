// Contacts as ODE's contact joints, one for each point that the collider finds. Friction is Coulomb's, as a
// pyramid with one edge along the direction of the force to come, so that it is exact there. Where the direct
// solver works, its limits are of the normal forces of the step (friction.h); where quick_step solves,
// surfaces that stick are pulled back to where they stuck.
#pragma once

#include <vector>

#include "handsim/engine/collision/pad_memory.h"
#include "handsim/engine/collision/penetration.h"
#include "handsim/engine/ode/friction.h"

namespace handsim::engine::ode {

class Contacts {
 public:
  /// Keeps the contact joints in `ids`. The model and the bodies must outlive this object. @throws OdeFault
  Contacts(OdeIds& ids, const model::Model& model, const Settings& settings,
           const std::vector<OdeBody>& bodies);

  /// Puts the shapes of bodies without an ODE body where the state has these.
  void place_immovable(const model::State& state) { collider_.place(state); }
  /// Finds the contacts at a state. @param driven where drives take bodies. @return pairs to test closely
  int collide(const model::State& state, std::span<const StepForecast::Driven> driven) {
    return collider_.collide(state, {step_, fall_, driven});
  }
  /// Recalls the last step's friction at the contacts found.
  void recall(const model::State& state);
  /// Makes the joints of the contacts. @param rigid_limits friction limits of rigid contacts are set, too
  void join(const model::State& state, bool rigid_limits);
  /// Takes pads to do in the solutions to come what their last forces show.
  /// @param state at which they were found
  void guess(const model::State& state);
  /// Ends that for all.
  void guess_nothing() { guesses_.assign(guesses_.size(), {}); }
  /// Mends the guesses that the step just made does not bear out, or ends them for these. @param before the
  /// step's start
  /// @return whether there was one
  bool refutes(const model::State& before, bool mend);
  /// Reads the forces of the step just made.
  void read_forces();
  /// After a step by the direct solver: takes new friction limits from its forces. @return true if friction
  /// was not exact; the contacts, joined again, have these limits
  bool update_limits() { return friction_ && limits_.update(collider_, forces_); }
  /// Removes the contact joints; the list stays.
  void release();
  /// Adds how far surfaces slid and pads were pressed in the step just made to what is remembered of them.
  /// @param before the step's start
  void update_memory(const model::State& before);
  /// Forgets how far surfaces have slid, and the forces of the last step; what is left of the pressing of
  /// pads is that of the state.
  void reset(const model::State& state);
  void store_state(model::State& state) const {
    if (pads_) state.pads = pads_->pairs();
  }
  void set_gravity(const Vec3& gravity);  ///< [m/s^2]
  const std::vector<Contact>& list() const { return collider_.contacts(); }
  std::span<const Touch> touches() const { return collider_.touches(); }
  /// The list, which steps to come do not depend on.
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

 private:
  /// Friction and stiffness of a contact, beside its geometry.
  struct Known {
    bool pad = false;              ///< compliant surfaces
    double share = 1;              ///< of the pair's stiffness
    double spinning = 0;           ///< largest moment about the normal per normal force [m]
    PadStep step;                  ///< of the pair's law
    const Patch* patch = nullptr;  ///< null: its surfaces are not pulled back
    const Vec3* force = nullptr;   ///< of the last step or pass; null: ODE finds friction's limits
    Guess guess = Guess::limited;  ///< of this solution
  };
  void add_contact(std::size_t index, const Touch& touch, const Known& known, const model::State& state);
  void join_guessed(const dContact& joint, std::size_t index);
  void add_row(std::size_t index, const Vec3& axis, double speed, double cfm);
  void set_friction(dContact& joint, const Contact& contact, const model::Material& between,
                    const Known& known, bool spins_by_motor);
  void set_friction_direction(dContact& joint, const Contact& contact, const Known& known,
                              const model::State& state) const;
  void add_spin_row(const Contact& contact, const Touch& touch, const Known& known);
  double shared_mass(const Contact& contact, const model::State& state) const;
  void set_compliance(dSurfaceParameters& surface, const model::Compliance& pad, double share) const;
  void set_law(dSurfaceParameters& surface, const Contact& contact, const model::Compliance& pad,
               const Known& known, double rate) const;
  double parting_rate(const Contact& contact, const model::State& state) const;
  double depth_after(const Contact& contact, const model::State& before) const;
  Vec3 given_way(std::size_t index, const Vec3& velocity, const Vec3& force) const;
  Vec3 slip_after(const Contact& contact, const model::State& before) const;
  dBodyID body_of(int shape) const;
  /// -1 where ODE turns the contact: it makes body b the first of a joint whose body a is not there.
  double side(const Contact& contact) const;
  void limit_approach(dSurfaceParameters& surface, const Contact& contact, const model::Material& between,
                      double share, const model::State& state) const;
  Vec3 sliding(const Contact& contact, const model::State& state) const;
  std::size_t body_index(int shape) const;

  const model::Model& model_;
  const std::vector<OdeBody>& bodies_;
  dWorldID world_;
  dJointGroupID joints_;
  Collider collider_;
  CrossedBodies crossed_;
  PreslidingMemory memory_;
  FrictionLimits limits_;
  std::optional<PadMemory> pads_;  ///< with surfaces that need it only
  bool friction_;
  bool iterative_;  ///< quick_step solves
  bool with_forces_;
  bool measures_forces_;  ///< for friction's limits or because the settings ask for them
  double erp_;
  double step_;  ///< [s]
  Vec3 fall_;    ///< velocity that gravity adds in one step [m/s]
  /// ODE's joint of a contact, or one of its joints.
  struct ContactJoint {
    dJointID id = nullptr;
    std::size_t contact = 0;  ///< in the list
  };
  std::vector<ContactJoint> contact_joints_;
  std::vector<dJointFeedback> feedback_;  ///< as contact_joints_
  std::vector<Guessed> guesses_;          ///< as the list
  std::vector<Vec3> applied_;             ///< friction of those that slide, as the list, on a's bodies [N]
  std::vector<Vec3> forces_;              ///< of the last pass, on a's bodies, as the list [N]
};

}  // namespace handsim::engine::ode
