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
/// Fastest separation that ODE gives to bodies found inside each other [m/s].
inline constexpr double kMaxCorrectingSpeed = 1.0;
/// Shapes from which on sweep-and-prune is faster than testing all pairs of bounding boxes.
inline constexpr std::size_t kSweepFrom = 24;

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
  /// Removes the contact joints; the list stays.
  void release();
  const std::vector<Contact>& list() const { return contacts_; }

 private:
  struct Surface {
    double friction = 0;           ///< sqrt(mu_a mu_b); 0 without the friction effect
    double restitution = 0;        ///< the greater of the two
    double restitution_speed = 0;  ///< the greater of the two [m/s]
  };

  static void near(void* self, dGeomID a, dGeomID b);
  void add_geoms(const model::Model& model);
  void collide_pair(std::size_t a, std::size_t b, const model::State& state);
  void add_contact(const Contact& contact, const dContactGeom& point, const model::State& state);
  Surface surface(int shape_a, int shape_b) const;
  Vec3 sliding(const Contact& contact, const model::State& state) const;
  Vec3 point_velocity(int body, const Vec3& at, const model::State& state) const;

  const model::Model& model_;
  const std::vector<OdeBody>& bodies_;
  dWorldID world_;
  dSpaceID space_;
  dJointGroupID joints_;
  UntestedPairs untested_;
  bool friction_;
  Vec3 fall_;                   ///< velocity that gravity adds in one step [m/s]
  std::vector<dGeomID> geoms_;  ///< as Model::shapes; null where no rule speaks of the shape
  std::vector<std::pair<std::size_t, std::size_t>> near_pairs_;
  std::vector<Contact> contacts_;
};

/// What keeps contacts of a model from being tested: too many groups, a plane on a body that moves.
std::vector<Problem> contact_defects(const model::Model& model, const model::Effects& effects);

/// True where a collision space is to be built.
bool needs_contacts(const model::Model& model, const model::Effects& effects);

}  // namespace handsim::engine::ode
