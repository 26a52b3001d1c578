// Pairs of shapes that may pass each other in a step: they go further than half the smaller of their smallest
// radii; others touch before either is deep in the other. Some nanoseconds per body in slow scenes.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "handsim/engine/collision/pair_table.h"
#include "handsim/model/effects.h"
#include "handsim/model/state.h"

namespace handsim::engine {

/// Share of the smaller of two smallest radii that a pair may go in a step without being looked at.
inline constexpr double kSlowShare = 0.5;

/// Farthest from its body's centre of mass that a shape's point lies whose motion a turn can bring nearer to
/// something else [m]: a sphere about the centre of mass has none.
double lever(const model::Shape& shape);

/// The displacement of a body in a step.
struct Way {
  Vec3 shift = Vec3::Zero();  ///< of its centre of mass [m]
  Vec3 turn = Vec3::Zero();   ///< rotation vector, world axes [rad]
};

/// The motion that a step is expected to make, from which contacts that are about to happen are found.
struct StepForecast {
  /// A driven body, and its displacement in the step.
  struct Driven {
    int body = 0;
    Way way;
  };
  double step = 0;                      ///< [s]
  Vec3 fall = Vec3::Zero();             ///< velocity that gravity adds in it [m/s]
  std::span<const Driven> driven = {};  ///< all driven bodies
};

/// A body's pose after a share of its way.
Pose moved(const Pose& body, const Way& way, double share);

class Sweep {
 public:
  using Pair = std::pair<std::size_t, std::size_t>;

  /// The model must outlive this object.
  Sweep(const model::Model& model, const model::Effects& effects);

  /// Bodies that move and have a shape that something can touch.
  std::span<const int> bodies() const { return bodies_; }
  /// True where a body goes far enough for its pairs to matter. @param shift2, turn2 squares [m^2], [rad^2]
  bool fast(int body, double shift2, double turn2) const {
    const Limit& limit = limits_[as_index(body)];
    // (x + y)^2 is at most 2 (x^2 + y^2).
    return 2 * (shift2 + limit.lever2 * turn2) > limit.way2;
  }
  /// Pairs that go so far and meet on their ways, in ascending order. @param state at the start
  std::span<const Pair> find(const model::State& state, std::span<const Way> ways);

 private:
  struct Limit {
    double lever2 = 0, way2 = 0;
  };
  /// A shape's surroundings on its way.
  struct Track {
    Vec3 centre = Vec3::Zero();
    double way = 0, reach = 0;  ///< of its own centre and points [m]
  };
  bool allowed(std::size_t a, std::size_t b) const;
  void compute_limits();
  void add(std::size_t a, std::size_t b, const model::State& state, std::span<const Way> ways);

  const model::Model& model_;
  std::vector<bool> immovable_;
  UntestedPairs untested_;
  PairTable rules_;
  std::vector<int> bodies_;
  std::vector<Limit> limits_;           ///< of each body
  std::vector<double> radii_, levers_;  ///< of each shape
  std::vector<Track> tracks_;
  std::vector<std::size_t> order_;  ///< of shapes along x
  std::vector<Pair> found_;
};

}  // namespace handsim::engine
