// Which shapes touch, and where: a space with the shape of every body that a contact rule speaks of, the
// pairs it finds near, and their contact points. Serves any engine: shapes ride on ODE bodies, or are put
// where a state has their bodies.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "handsim/engine/contact/clearance.h"
#include "handsim/engine/contact/sweep.h"
#include "handsim/engine/ode/approach.h"
#include "handsim/engine/ode/bodies.h"
#include "handsim/engine/ode/shapes.h"

namespace handsim::engine::ode {

/// Shapes from which on sweep-and-prune is faster than testing all pairs of bounding boxes.
inline constexpr std::size_t kSweepFrom = 24;

/// Two shapes that touch: which points of the list are theirs, and what their surfaces are to each other.
struct Touch {
  std::size_t first = 0;
  int count = 0;
  model::Material surface;
};

class Collider {
 public:
  /// @param bodies as Model::bodies, on whose ODE bodies shapes ride; empty: on none. Model and bodies must
  ///        outlive this. @throws OdeFault
  Collider(const model::Model& model, const Settings& settings, std::span<const OdeBody> bodies = {});

  /// Puts the shapes of bodies without an ODE body where the state has these; not where none has one.
  void place(const model::State& state);
  /// Finds the contacts at a state, where all shapes have been put, and with settings.speculative those that
  /// fast bodies are about to make (depth below 0). @return pairs given to the narrow phase
  int collide(const model::State& state, const Prospect& prospect);

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
  bool allowed(std::size_t shape_a, std::size_t shape_b) const;
  std::vector<Clearance::Pair> allowed_pairs() const;
  void find_near(const model::State& state);
  Pose pose(std::size_t shape, const model::State& state) const;
  int narrow_phase(std::size_t a, std::size_t b, const model::State& state);
  std::span<const Sweep::Pair> find_fast(const model::State& state, const Prospect& prospect);
  int approach(std::size_t a, std::size_t b, bool touching, const model::State& state);
  model::Material surface(std::size_t a, std::size_t b) const;

  const model::Model& model_;
  UntestedPairs untested_;
  PairTable rules_;
  std::unique_ptr<dxSpace, Destroyer<dSpaceDestroy>> space_;
  std::vector<dGeomID> geoms_;  ///< as Model::shapes; null where no rule speaks of the shape
  std::vector<Clearance::Pair> near_pairs_;
  /// Where no shape rides on an ODE body: in place of the space, and poses of all shapes.
  std::optional<Clearance> clearance_;
  std::vector<Pose> poses_;
  /// With settings.speculative only.
  std::optional<Sweep> sweep_;
  Approach approach_;
  std::vector<Way> ways_;  ///< of each body, in a step with a fast one
  std::vector<Contact> contacts_;
  std::vector<Touch> touches_;
};

/// What keeps contacts of a model from being tested: a plane on a body that moves.
std::vector<Problem> contact_defects(const model::Model& model, const model::Effects& effects);

/// True where a collision space is to be built.
bool needs_contacts(const model::Model& model, const model::Effects& effects);

}  // namespace handsim::engine::ode
