// The broad phase: which pairs of shapes may touch. A pair is tested again once its shapes together have
// moved as far as they were apart or overlapped. Exact: pairs left out do not touch. States may jump.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "handsim/model/shape_extent.h"
#include "handsim/model/state.h"

namespace handsim::engine {

/// Least distance of two shapes by their extents along both axes and, of capsules and spheres, segments [m];
/// negative where these do not part them. Never above the distance. At most one is a plane.
double least_gap(const model::Shape& a, const Pose& x_WA, const model::Shape& b, const Pose& x_WB);

class Clearance {
 public:
  using Pair = std::pair<std::uint32_t, std::uint32_t>;
  static constexpr std::size_t kUsualNear = 64;  ///< So many near pairs need no allocation in a step.

  /// The model must outlive this object. @param pairs that are to be watched
  Clearance(const model::Model& model, std::vector<Pair> pairs);

  /// Pairs watched.
  std::size_t size() const { return pairs_.size(); }
  /// The pairs that may touch, in their order.
  std::span<const Pair> near(const model::State& state);
  /// X_WS of a shape at the state last given to `near`.
  const Pose& pose(std::size_t shape);

 private:
  /// A body with shapes that are watched.
  struct Mover {
    std::size_t body = 0;
    double reach = 0;  ///< its farthest point from the body's origin [m]
    bool endless = false;
    std::uint64_t moves = 0;  ///< how often it has moved
    Pose last;
  };
  /// A shape with its pose, and its rotation, after so many moves of its body.
  struct Placed {
    std::size_t mover = 0;
    std::optional<std::uint64_t> posed, rotated;
    Pose pose;
    Mat3 R = Mat3::Identity();
  };
  /// Two shapes that are watched.
  struct Watched {
    std::uint32_t mover_a = 0, mover_b = 0;
    double limit = 0;  ///< travel of both at which they are tested again [m]
    bool overlap = false;
  };
  bool move(const model::State& state);
  bool test_group(std::size_t group);
  double gap(std::size_t a, std::size_t b);
  const Mat3& rotation(std::size_t shape);

  const model::Model& model_;
  std::vector<model::Extent> extents_;
  std::vector<Mover> movers_;
  std::vector<Placed> placed_;  ///< as Model::shapes
  std::vector<Pair> pairs_, near_;
  std::vector<Watched> watched_;  ///< as the pairs
  std::vector<double> travel_;    ///< most that a point of each mover may have moved so far [m]
  double moved_ = 0;              ///< most that any two bodies have moved together so far [m]
  std::vector<double> due_;       ///< of each group of pairs: the same when one of them may be tested again
};

}  // namespace handsim::engine
