#include "handsim/study/track/smoother.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace handsim::study {

namespace {

/// Frames of a block.
constexpr std::size_t kBlock = 1024;

/// A symmetric positive definite band matrix, whose rows have columns of their own and the two frames before.
/// Cholesky's method goes from block to block of frames and keeps the last two frames of each; the way back
/// factors every block again. Memory therefore does not grow with the length of a recording.
class BandSystem {
 public:
  /// Adds a frame's rows, whose entries are 0.
  using Fill = std::function<void(std::size_t frame, BandSystem& to)>;

  BandSystem(std::size_t frames, std::size_t size, Fill fill)
      : frames_(frames), size_(size), width_(2 * size), fill_(std::move(fill)) {}

  /// Entry (i, j) with i >= j, of the frame that is filled.
  double& at(std::size_t i, std::size_t j) { return rows_[(i - base_) * (width_ + 1) + width_ + j - i]; }
  double& right(std::size_t i) { return right_[i - base_]; }

  std::vector<double> solve() {
    const std::size_t blocks = (frames_ + kBlock - 1) / kBlock;
    std::vector<Part> heads(blocks);
    for (std::size_t b = 0; b < blocks; ++b) {
      factor(b, heads[b]);
      if (b + 1 < blocks) heads[b + 1] = {{rows_.end() - head_values(), rows_.end()}, tail()};
    }
    std::vector<double> out(frames_ * size_), later;
    for (std::size_t b = blocks; b-- > 0;) {
      if (b + 1 < blocks) {
        factor(b, heads[b]);
        std::ranges::copy(later, right_.end() - static_cast<std::ptrdiff_t>(width_));
      }
      const std::size_t begin = b * kBlock * size_;
      for (std::size_t i = base_ + right_.size(); i-- > begin;) {
        out[i] = right(i) /= at(i, i);
        for (std::size_t j = first_of(i); j < i; ++j) right(j) -= at(i, j) * right(i);
      }
      later.assign(right_.begin(), right_.begin() + static_cast<std::ptrdiff_t>(begin - base_));
    }
    return out;
  }

 private:
  /// Rows of two frames.
  struct Part {
    std::vector<double> rows, right;
  };
  std::ptrdiff_t head_values() const { return static_cast<std::ptrdiff_t>(width_ * (width_ + 1)); }
  std::vector<double> tail() const {
    return {right_.end() - static_cast<std::ptrdiff_t>(width_), right_.end()};
  }
  std::size_t first_of(std::size_t i) const { return i > width_ ? i - width_ : 0; }

  /// @param head factored rows of the two frames before the block
  void factor(std::size_t block, const Part& head) {
    const std::size_t begin = block * kBlock, end = std::min(frames_, begin + kBlock);
    base_ = begin * size_ - head.right.size();
    rows_ = head.rows;
    right_ = head.right;
    rows_.resize((end * size_ - base_) * (width_ + 1));
    right_.resize(end * size_ - base_);
    for (std::size_t k = begin; k < end; ++k) fill_(k, *this);
    for (std::size_t i = begin * size_; i < end * size_; ++i) {
      const std::size_t first = first_of(i);
      for (std::size_t j = first; j <= i; ++j) {
        const std::size_t from = std::max(first, first_of(j));
        const double sum = at(i, j) - dot(&at(i, from), &at(j, from), j - from);
        at(i, j) = j == i ? std::sqrt(std::max(sum, 1e-300)) : sum / at(j, j);
      }
      right(i) = (right(i) - dot(&at(i, first), &right(first), i - first)) / at(i, i);
    }
  }

  static double dot(const double* a, const double* b, std::size_t n) {
    using Vector = Eigen::Map<const Eigen::VectorXd>;
    const auto size = static_cast<Eigen::Index>(n);
    return Vector(a, size).dot(Vector(b, size));
  }

  std::size_t frames_, size_, width_;
  Fill fill_;
  std::size_t base_ = 0;  ///< row at which the block's memory begins
  std::vector<double> rows_, right_;
};

/// Parameters of a later pose minus those of an earlier one.
Eigen::VectorXd difference(const HandPose& from, const HandPose& to) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(6 + to.angles.size()));
  out.head<3>() = to.wrist.p - from.wrist.p;
  out.segment<3>(3) = rotation_vector(to.wrist.q * from.wrist.q.conjugate());
  for (std::size_t i = 0; i < to.angles.size(); ++i)
    out[static_cast<Eigen::Index>(6 + i)] = to.angles[i] - from.angles[i];
  return out;
}

}  // namespace

void smooth(const std::vector<double>& times, const RowsAt& rows_at, double noise, const MotionPrior& prior,
            const HandTree& tree, std::vector<HandPose>& poses) {
  const std::size_t count = poses.size(), size = tree.size();
  if (count < 3) return;
  const double weight = 1 / (noise * noise);
  const auto add_points = [&](std::size_t k, BandSystem& system) {
    const Rows at = rows_at(k, poses[k]);
    const Eigen::VectorXd gradient = at.jacobian.transpose() * at.residuals;
    const Eigen::MatrixXd matrix = at.jacobian.transpose() * at.jacobian;
    for (std::size_t i = 0; i < size; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      system.right(k * size + i) -= weight * gradient[row];
      for (std::size_t j = 0; j <= i; ++j)
        system.at(k * size + i, k * size + j) += weight * matrix(row, static_cast<Eigen::Index>(j));
    }
  };
  // The change of rate at a frame, in the rows of itself and its neighbours.
  const auto add_change = [&](std::size_t middle, std::size_t k, BandSystem& system) {
    const double before = times[middle] - times[middle - 1], after = times[middle + 1] - times[middle];
    const Eigen::VectorXd change = difference(poses[middle], poses[middle + 1]) / after -
                                   difference(poses[middle - 1], poses[middle]) / before;
    const std::array<double, 3> factor = {1 / before, -1 / before - 1 / after, 1 / after};
    const std::size_t a = k + 1 - middle;
    for (std::size_t i = 0; i < size; ++i) {
      const double density = i < 3 ? prior.position : i < 6 ? prior.turn : prior.angle;
      const double stiffness = 2 / (density * (before + after));
      const std::size_t row = k * size + i;
      system.right(row) -= stiffness * factor[a] * change[static_cast<Eigen::Index>(i)];
      for (std::size_t b = 0; b <= a; ++b)
        system.at(row, (middle + b - 1) * size + i) += stiffness * factor[a] * factor[b];
    }
  };
  BandSystem system(count, size, [&](std::size_t k, BandSystem& to) {
    add_points(k, to);
    for (std::size_t middle = std::max<std::size_t>(k, 2) - 1; middle <= k + 1 && middle + 1 < count;
         ++middle)
      add_change(middle, k, to);
  });
  const std::vector<double> step = system.solve();
  for (std::size_t k = 0; k < count; ++k)
    poses[k] = tree.moved(
        poses[k], Eigen::Map<const Eigen::VectorXd>(step.data() + k * size, static_cast<Eigen::Index>(size)));
}

}  // namespace handsim::study
