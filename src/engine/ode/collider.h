// Which shapes touch, and where: a space with the shape of every body that a contact rule speaks of, the
// pairs it finds near, and their contact points. Serves any engine: shapes ride on ODE bodies, or are put
// where a state has their bodies.
#pragma once

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "handsim/engine/ode/bodies.h"
#include "handsim/engine/ode/shapes.h"

namespace handsim::engine::ode {

/// Contact points that one pair of shapes can have.
inline constexpr int kMaxPairContacts = 8;
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

/// Two shapes that touch: which points of the list are theirs, and what their surfaces are to each other.
struct Touch {
  std::size_t first = 0;
  int count = 0;
  model::Material surface;
};

class Collider {
 public:
  /// @param bodies as Model::bodies, on whose ODE bodies shapes ride; empty: on none. Model and bodies must
  /// outlive
  ///        this. @throws OdeFault
  Collider(const model::Model& model, const std::vector<bool>& immovable,
           std::span<const OdeBody> bodies = {});

  /// Puts the shapes of bodies without an ODE body where the state has these.
  void place(const model::State& state);
  /// Finds the contacts at a state, where all shapes have been put. @return pairs given to the narrow phase
  int collide(const model::State& state);

  std::vector<Contact>& contacts() { return contacts_; }
  const std::vector<Contact>& contacts() const { return contacts_; }
  /// The list, which steps to come do not depend on.
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);
  /// In the order of their points in the list.
  std::span<const Touch> touches() const { return touches_; }

 private:
  static void near(void* self, dGeomID a, dGeomID b);
  void add_geoms(std::span<const OdeBody> bodies);
  int narrow_phase(std::size_t a, std::size_t b, const model::State& state);
  model::Material surface(std::size_t a, std::size_t b) const;

  const model::Model& model_;
  UntestedPairs untested_;
  PairTable rules_;
  std::unique_ptr<dxSpace, Destroyer<dSpaceDestroy>> space_;
  std::vector<dGeomID> geoms_;  ///< as Model::shapes; null where no rule speaks of the shape
  std::vector<std::pair<std::size_t, std::size_t>> near_pairs_;
  std::vector<Contact> contacts_;
  std::vector<Touch> touches_;
};

/// What keeps contacts of a model from being tested: a plane on a body that moves.
std::vector<Problem> contact_defects(const model::Model& model, const model::Effects& effects);

/// True where a collision space is to be built.
bool needs_contacts(const model::Model& model, const model::Effects& effects);

}  // namespace handsim::engine::ode
