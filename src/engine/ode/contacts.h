// Contact between shapes: a collision space with every shape that a contact rule speaks of, the pairs it
// finds near, their contact points, and a contact joint for each. Friction is Coulomb's, as a pyramid with
// one edge along the direction in which the surfaces slide or are about to, so that it is exact there.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "handsim/engine/ode/bodies.h"
#include "handsim/engine/ode/shapes.h"

namespace handsim::engine::ode {

/// Contact points that one pair of shapes can have.
inline constexpr int kMaxPairContacts = 8;
/// Depth that contacts are allowed to keep, so that resting bodies stay in contact [m].
inline constexpr double kSurfaceLayer = 1e-5;
/// Fastest at which rigid surfaces found inside each other are driven apart [m/s]. ODE gives that speed to
/// the bodies for good: at 1 m/s a ball of restitution 0 that falls 1 m jumps back at a fifth of its speed.
inline constexpr double kMaxCorrectingSpeed = 0.1;
/// Shapes from which on sweep-and-prune is faster than testing all pairs of bounding boxes.
inline constexpr std::size_t kSweepFrom = 24;

/// For each pair of contact groups whether a rule names it, and the material of the pair.
class PairTable {
 public:
  explicit PairTable(const model::Model& model);
  bool meet(int group_a, int group_b) const { return entry(group_a, group_b) != kNever; }
  bool meets_any(int group) const;
  /// Index of a material, or kCombined.
  int material(int group_a, int group_b) const { return entry(group_a, group_b); }

 private:
  static constexpr int kNever = -2;
  int entry(int a, int b) const {
    return table_[static_cast<std::size_t>(a) * groups_ + static_cast<std::size_t>(b)];
  }
  std::size_t groups_;
  std::vector<int> table_;
};

class Contacts {
 public:
  /// Builds the space in `ids`. The model and the bodies must outlive this. @throws OdeFault
  Contacts(OdeIds& ids, const model::Model& model, const Settings& settings,
           const std::vector<OdeBody>& bodies, const std::vector<bool>& immovable);

  /// Puts the shapes of bodies without an ODE body where the state has these.
  void place_immovable(const model::State& state);
  /// Finds the contacts at a state and makes a contact joint for each. @return pairs given to the narrow
  /// phase
  int collide(const model::State& state);
  /// Reads the forces of the step just made, where the settings ask for them.
  void read_forces();
  /// Removes the contact joints; the list stays.
  void release();
  /// Length of the steps to come [s].
  void set_step(double step);
  const std::vector<Contact>& list() const { return contacts_; }

 private:
  static void near(void* self, dGeomID a, dGeomID b);
  void add_geoms(const model::Model& model);
  void collide_pair(std::size_t a, std::size_t b, const model::State& state);
  int narrow_phase(std::size_t a, std::size_t b, const model::State& state);
  void add_contact(const Contact& contact, const model::Material& surface, int sharing,
                   const model::State& state);
  void soften(dSurfaceParameters& surface, const model::Compliance& pad, int sharing) const;
  model::Material surface(std::size_t a, std::size_t b) const;
  dBodyID body_of(int shape) const;
  Vec3 sliding(const Contact& contact, const model::State& state) const;
  Vec3 point_velocity(int body, const Vec3& at, const model::State& state) const;

  const model::Model& model_;
  const std::vector<OdeBody>& bodies_;
  dWorldID world_;
  dSpaceID space_;
  dJointGroupID joints_;
  UntestedPairs untested_;
  PairTable rules_;
  bool friction_;
  bool with_forces_;
  double erp_;
  double step_;  ///< [s]
  Vec3 gravity_;
  Vec3 fall_;                   ///< velocity that gravity adds in one step [m/s]
  std::vector<dGeomID> geoms_;  ///< as Model::shapes; null where no rule speaks of the shape
  std::vector<std::pair<std::size_t, std::size_t>> near_pairs_;
  std::vector<Contact> contacts_;
  std::vector<dJointID> contact_joints_;  ///< as contacts_
  std::vector<dJointFeedback> feedback_;  ///< as contacts_, where forces are asked for
};

/// What keeps contacts of a model from being tested: a plane on a body that moves.
std::vector<Problem> contact_defects(const model::Model& model, const model::Effects& effects);

/// True where a collision space is to be built.
bool needs_contacts(const model::Model& model, const model::Effects& effects);

}  // namespace handsim::engine::ode
