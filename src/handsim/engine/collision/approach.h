// Where two shapes that are apart will touch within a step if their bodies go on as they do: points with the
// gap that is left there. An engine lets them come nearer by that gap and no more (speculative contacts), so
// that a fast body does not end a step within or behind another. Against a plane these are the shape's points
// that the plane moved out by its way touches; against others those of the shapes moved to where they first
// meet, and a little into each other.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "handsim/engine/collision/narrow_phase.h"
#include "handsim/engine/collision/ode_library.h"
#include "handsim/engine/collision/sweep.h"

namespace handsim::engine {

class Approach {
 public:
  /// Both must outlive this object.
  Approach(const model::Model& model, const NarrowPhase& narrow)
      : model_(model), narrow_(narrow), geoms_(model.shapes.size()) {
    points_.reserve(kMaxPairContacts);
  }

  /// Points of two shapes as they are at the step's start: normals out of b into a, depth less the gap
  /// between the surfaces (0 or less). None where they do not meet within the step. @throws OdeFault
  /// @param touching they touch already: only where they do not yet. @param ways of every body
  std::span<const ManifoldPoint> find(std::size_t a, std::size_t b, bool touching, const model::State& state,
                                      std::span<const Way> ways);

 private:
  /// One of the two shapes, with its body's motion.
  struct Side {
    std::size_t shape = 0;
    Pose start;  ///< of its body
    Way way;
    double mass = 0;  ///< of its body, infinite where nothing moves it [kg]
    double lever = 0;
  };
  Side side(std::size_t shape, const model::State& state, std::span<const Way> ways) const;
  const model::Shape& shape_of(const Side& side) const { return model_.shapes[side.shape]; }
  void touch(const Side& a, const Pose& x_WA, const Side& b, const Pose& x_WB);
  void touch(const Side& a, const Side& b, double share) {
    touch(a, moved(a.start, a.way, share), b, moved(b.start, b.way, share));
  }
  double gap(const Side& a, const Side& b, double share) const;
  std::optional<double> meeting(const Side& a, const Side& b, double way, double radius);
  void measure(const Side& a, const Side& b, double share, double least);
  void meet_again(const Side& a, const Side& b, double way, double radius);
  void onto_plane(const Side& a, const Side& b);
  dGeomID geom(std::size_t shape);

  const model::Model& model_;
  const NarrowPhase& narrow_;
  std::vector<std::unique_ptr<dxGeom, Destroyer<dGeomDestroy>>> geoms_;  ///< as Model::shapes, when needed
  std::vector<ManifoldPoint> points_;
};

}  // namespace handsim::engine
