// The broad phase: which pairs of shapes may touch. Every pair keeps how far apart it was when it was last
// tested, or by how much its bounds overlapped, and is not tested again before its two shapes have together
// moved as far. Exact: a pair left out does not touch. Knows nothing of time or speeds, so that states may
// jump.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "handsim/model/shape_extent.h"

namespace handsim::engine {

/// Least distance between two shapes that their extents along the axes of both and, of two capsules or
/// spheres, the nearest points of their segments tell [m]; negative where these do not part them. Never more
/// than the distance itself. At most one of them a plane.
double least_gap(const model::Shape& a, const Pose& x_WA, const model::Shape& b, const Pose& x_WB);

class Clearance {
 public:
  using Pair = std::pair<std::size_t, std::size_t>;

  /// The model must outlive this. @param pairs that are to be watched
  Clearance(const model::Model& model, std::vector<Pair> pairs);

  /// Pairs watched.
  std::size_t size() const { return pairs_.size(); }
  /// The pairs that may touch, in their order. @param poses X_WS of every shape
  std::span<const Pair> near(std::span<const Pose> poses);

 private:
  bool move(std::span<const Pose> poses);
  void test_pairs(std::span<const Pose> poses);
  double gap(std::size_t a, std::size_t b, std::span<const Pose> poses);
  const Mat3& rotation(std::size_t shape, const Pose& pose);

  const model::Model& model_;
  std::vector<model::Extent> extents_;
  std::vector<Mat3> rotations_;  ///< of the shapes where `rotated_`
  std::vector<char> rotated_;
  std::vector<Pair> pairs_, near_;
  std::vector<char> overlap_;   ///< of each pair: whether it may touch
  std::vector<double> limit_;   ///< of each pair: travel of both at which it is tested again [m]
  std::vector<double> travel_;  ///< of each shape: most that a point of it may have moved so far [m]
  std::vector<double> reach_;   ///< of each shape: its farthest point from the origin of its frame [m]
  std::vector<Pose> last_;
  /// No pair is tested before any two shapes have together moved by `slack_`; `moved_`: the most so far [m].
  double slack_ = 0, moved_ = 0;
};

}  // namespace handsim::engine
