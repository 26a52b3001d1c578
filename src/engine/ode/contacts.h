// Contacts as ODE's contact joints, one for each point that the collider finds. Friction is Coulomb's, as a
// pyramid with one edge along the direction in which the surfaces slide or are about to, so that it is exact
// there. Where quick_step solves, surfaces that stick are pulled back to where they stuck (presliding.h).
#pragma once

#include <vector>

#include "handsim/engine/contact/collider.h"
#include "handsim/engine/contact/penetration.h"
#include "handsim/engine/ode/presliding.h"

namespace handsim::engine::ode {

class Contacts {
 public:
  /// Keeps the contact joints in `ids`. The model and the bodies must outlive this. @throws OdeFault
  Contacts(OdeIds& ids, const model::Model& model, const Settings& settings,
           const std::vector<OdeBody>& bodies);

  /// Puts the shapes of bodies without an ODE body where the state has these.
  void place_immovable(const model::State& state) { collider_.place(state); }
  /// Finds the contacts at a state. @param driven where drives take their bodies in the step. @return pairs
  /// given to the narrow phase
  int collide(const model::State& state, std::span<const Prospect::Driven> driven) {
    return collider_.collide(state, {step_, fall_, driven});
  }
  /// Makes the joints of the contacts found. @param iterative for quick_step: surfaces that stick are pulled
  /// back
  void join(const model::State& state, bool iterative);
  /// Reads the forces of the step just made, where the settings ask for them.
  void read_forces();
  /// Removes the contact joints; the list stays.
  void release();
  /// Takes in how far surfaces slid in the step just made. @param before its start; @param step [s]
  void take_in_slip(const model::State& before, double step);
  const std::vector<Presliding>& presliding() const { return memory_.pairs(); }
  void set_presliding(const std::vector<Presliding>& pairs) { memory_.set(pairs); }
  /// Length of the steps to come [s].
  void set_step(double step);
  const std::vector<Contact>& list() const { return collider_.contacts(); }
  std::span<const Touch> touches() const { return collider_.touches(); }
  /// The list, which steps to come do not depend on.
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

 private:
  /// @param patch of the touch; null: its surfaces are not pulled back
  void add_contact(const Contact& contact, const Touch& touch, const Patch* patch, const model::State& state);
  void aim_friction(dContact& joint, const Contact& contact, const Patch* patch,
                    const model::State& state) const;
  void add_spin_row(const Contact& contact, const Touch& touch, const Patch& patch);
  void soften(dSurfaceParameters& surface, const model::Compliance& pad, int sharing) const;
  dBodyID body_of(int shape) const;
  void come_nearer(dSurfaceParameters& surface, const Contact& contact, const model::Material& between,
                   int sharing, const model::State& state) const;
  Vec3 sliding(const Contact& contact, const model::State& state) const;
  std::size_t body_index(int shape) const;
  /// Of a body's point at the start of the step; as it would be after the step without the contact.
  Vec3 start_velocity(std::size_t body, const Vec3& at, const model::State& state) const;
  Vec3 point_velocity(std::size_t body, const Vec3& at, const model::State& state) const;

  const model::Model& model_;
  const std::vector<OdeBody>& bodies_;
  dWorldID world_;
  dJointGroupID joints_;
  Collider collider_;
  CrossedBodies crossed_;
  PreslidingMemory memory_;
  bool friction_;
  bool remembers_;  ///< how far surfaces have crept
  bool with_forces_;
  double erp_;
  double step_;  ///< [s]
  Vec3 gravity_;
  Vec3 fall_;                             ///< velocity that gravity adds in one step [m/s]
  std::vector<dJointID> contact_joints_;  ///< as the list
  std::vector<dJointFeedback> feedback_;  ///< as the list, where forces are asked for
};

}  // namespace handsim::engine::ode
