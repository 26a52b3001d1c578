// Which shapes touch, and where: a space with the shapes that contact rules speak of, the pairs it finds
// near, and their contact points. For any engine: shapes are fixed to ODE bodies or put as in a state.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "handsim/engine/collision/approach.h"
#include "handsim/engine/collision/clearance.h"
#include "handsim/engine/collision/ode_library.h"
#include "handsim/engine/collision/sweep.h"
#include "handsim/engine/engine.h"

namespace handsim::engine {

/// Shapes from which on sweep-and-prune is faster than testing all pairs of bounding boxes.
inline constexpr std::size_t kSweepFrom = 24;
/// Least share of a pad's stiffness: a point that just touches has a spring still.
inline constexpr double kLeastShare = 1e-3;

/// Two shapes that touch: which points of the list are theirs, and what their surfaces are to each other.
struct Touch {
  std::size_t first = 0;
  int count = 0;
  model::Material surface;
};

class Collider {
 public:
  /// @param speculative finds coming contacts, too. @param bodies as Model::bodies, the ODE bodies of the
  /// shapes (null or empty: none). @throws OdeFault. The model must outlive this object.
  Collider(const model::Model& model, const model::Effects& effects, bool speculative,
           std::span<const dBodyID> bodies = {});

  Collider(const Collider&) = delete;  ///< its parts refer to each other
  Collider& operator=(const Collider&) = delete;

  /// Puts the shapes of bodies without an ODE body where the state has these; not where none has one.
  void place(const model::State& state);
  /// Finds the contacts at a state, where all shapes have been put, and where speculative those that fast
  /// bodies are about to make (depth below 0). @return pairs given to the narrow phase
  int collide(const model::State& state, const StepForecast& prospect);

  std::vector<Contact>& contacts() { return contacts_; }
  const std::vector<Contact>& contacts() const { return contacts_; }
  /// The list, which steps to come do not depend on.
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);
  /// In the order of their points in the list.
  std::span<const Touch> touches() const { return {touches_.data(), touch_count_}; }
  std::span<Touch> touches() { return {touches_.data(), touch_count_}; }
  /// Share of the pair's stiffness and damping that each contact has where its surfaces are pads.
  std::span<const double> shares() const { return shares_; }
  /// Largest moment about a contact's normal per normal force, beyond that of sliding friction at the touch's
  /// other points [m].
  double spinning(const Touch& touch, std::size_t contact) const;
  /// Points of two shapes at other poses; the list stays. Valid until the next call. For a collider without
  /// ODE bodies.
  std::span<const Contact> touch_at(std::size_t a, const Pose& x_WA, std::size_t b, const Pose& x_WB);
  /// What the surfaces of two shapes are to each other.
  model::Material surface(int shape_a, int shape_b) const;
  /// @returns whether a touch's points share its stiffness by their depths
  bool shares_by_depth(const Contact& any) const {
    return narrow_.flat(as_index(any.shape_a), as_index(any.shape_b));
  }

 private:
  static void near(void* self, dGeomID a, dGeomID b);
  void add_geoms(std::span<const dBodyID> bodies);
  bool allowed(std::size_t shape_a, std::size_t shape_b) const;
  std::vector<Clearance::Pair> allowed_pairs() const;
  void collect_near(const model::State& state);
  Pose pose(std::size_t shape, const model::State& state);
  int narrow_phase(std::size_t a, const Pose& x_WA, std::size_t b, const Pose& x_WB, bool pad,
                   std::vector<Contact>& out);
  std::optional<int> capsule_and_sphere(std::size_t a, const Pose& x_WA, std::size_t b, const Pose& x_WB,
                                        std::vector<Contact>& out) const;
  std::span<const Sweep::Pair> find_fast(const model::State& state, const StepForecast& prospect);
  void share_stiffness(const Touch& touch, bool flat);
  int approach(std::size_t a, std::size_t b, bool touching, const model::State& state);

  const model::Model& model_;
  UntestedPairs untested_;
  PairTable rules_;
  std::unique_ptr<dxSpace, Destroyer<dSpaceDestroy>> space_;
  std::vector<dGeomID> geoms_;  ///< as Model::shapes; null where no rule speaks of the shape
  std::vector<Clearance::Pair> near_pairs_;
  std::optional<Clearance> clearance_;  ///< in place of the space, where no shape is fixed to an ODE body
  /// Only with speculative contacts.
  std::optional<Sweep> sweep_;
  NarrowPhase narrow_;
  Approach approach_;
  std::vector<Way> ways_;  ///< of each body, in a step with a fast one
  std::vector<Contact> contacts_, trial_;
  std::vector<Touch> touches_;  ///< the first of them; the others are room
  std::size_t touch_count_ = 0;
  std::vector<double> shares_;  ///< as the contacts
};

}  // namespace handsim::engine
