#include "handsim/study/track/smoother.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

namespace handsim::study {

namespace {

/// Steps are taken until no angle comes to a stop or leaves it, or moves by more than kStill, but at most
/// kMostSteps. Where many come and leave by turns none leaves after the first kReleasing (all chosen).
constexpr int kReleasing = 12, kMostSteps = 24;
constexpr double kStill = 2e-3;  // [rad]
/// Of Marquardt's scale, when a frame's sum has risen by more than rounding for the first time.
constexpr double kDamped = 1, kRounding = 1e-9;

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
  // Of a change of rate: the factors of the three frames, and the time from the first to the last.
  struct Change {
    std::array<double, 3> factor;
    double interval;
  };
  const auto change_at = [&](std::size_t middle) {
    const double before = times[middle] - times[middle - 1], after = times[middle + 1] - times[middle];
    return Change{{1 / before, -1 / before - 1 / after, 1 / after}, before + after};
  };
  const auto stiffness = [&](const Change& change, std::size_t i) {
    return 2 / ((i < 3 ? prior.position : i < 6 ? prior.turn : prior.angle) * change.interval);
  };
  // The changes of rate at a frame and its neighbours contain its parameters.
  const auto for_changes = [&](std::size_t k, const auto& call) {
    for (std::size_t middle = std::max<std::size_t>(k, 2) - 1; middle <= k + 1 && middle + 1 < count;
         ++middle)
      call(middle);
  };
  // Of the terms that contain a frame's parameters: their gradient, reversed, and their sum.
  struct Slope {
    Eigen::VectorXd downhill;
    double sum;
  };
  const auto slope_at = [&](std::size_t k, const Rows& at) {
    Slope out{-weight * (at.jacobian.transpose() * at.residuals), weight * at.residuals.squaredNorm()};
    for_changes(k, [&](std::size_t middle) {
      const Change change = change_at(middle);
      const Eigen::VectorXd of =
          difference(poses[middle], poses[middle + 1]) / (times[middle + 1] - times[middle]) -
          difference(poses[middle - 1], poses[middle]) / (times[middle] - times[middle - 1]);
      for (std::size_t i = 0; i < size; ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        const double stiff = stiffness(change, i);
        out.downhill[row] -= stiff * change.factor[k + 1 - middle] * of[row];
        out.sum += stiff * of[row] * of[row];
      }
    });
    return out;
  };
  std::vector<bool> held(count * size, false);
  std::vector<double> damping(count, 0), sums(count, 0);
  std::vector<int> seen(count, 0);
  int taken = 1;
  // Each frame has its own damping: a thumb that comes out of the palm and goes in by turns holds up no other
  // frame.
  const auto damp = [&](std::size_t k, double sum) {
    if (seen[k] == taken) return;  // the way back fills again
    damping[k] =
        taken > 1 && sum > sums[k] * (1 + kRounding) ? std::max(kDamped, 8 * damping[k]) : damping[k] / 4;
    sums[k] = sum;
    seen[k] = taken;
  };
  const auto fill = [&](std::size_t k, BandSystem& system) {
    const Rows at = rows_at(k, poses[k]);
    const Slope slope = slope_at(k, at);
    damp(k, slope.sum);
    const Eigen::MatrixXd matrix = at.jacobian.transpose() * at.jacobian;
    for (std::size_t i = 0; i < size; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      system.right(k * size + i) += slope.downhill[row];
      for (std::size_t j = 0; j <= i; ++j)
        system.at(k * size + i, k * size + j) += weight * matrix(row, static_cast<Eigen::Index>(j));
    }
    for_changes(k, [&](std::size_t middle) {
      const Change change = change_at(middle);
      const std::size_t a = k + 1 - middle;
      for (std::size_t i = 0; i < size; ++i)
        for (std::size_t b = 0; b <= a; ++b)
          system.at(k * size + i, (middle + b - 1) * size + i) +=
              stiffness(change, i) * change.factor[a] * change.factor[b];
    });
    // An angle that is held is no unknown.
    for (std::size_t row = k * size; row < (k + 1) * size; ++row) {
      system.at(row, row) *= 1 + damping[k];
      for (std::size_t column = row - std::min(row, 2 * size); column < row; ++column)
        if (held[row] || held[column]) system.at(row, column) = 0;
      if (held[row]) {
        system.at(row, row) = 1;
        system.right(row) = 0;
      }
    }
  };
  for (;; ++taken) {
    const std::vector<double> step = BandSystem(count, size, fill).solve();
    for (std::size_t k = 0; k < count; ++k)
      poses[k] = tree.moved_freely(poses[k], Eigen::Map<const Eigen::VectorXd>(
                                                 step.data() + k * size, static_cast<Eigen::Index>(size)));
    // Held at a stop is what has come beyond it, until it is better within.
    std::vector<bool> next = held;
    bool still = true;
    for (std::size_t k = 0; k < count; ++k) {
      std::optional<Slope> slope;
      for (std::size_t i = 6; i < size; ++i) {
        const TreeAxis& axis = tree.axes()[i - 6];
        const double angle = poses[k].angles[i - 6];
        const std::size_t row = k * size + i;
        if (!held[row]) {
          next[row] = angle < axis.low || angle > axis.high;
        } else if (taken < kReleasing) {
          if (!slope) slope = slope_at(k, rows_at(k, poses[k]));
          const double outwards =
              (angle <= axis.low ? -1 : 1) * slope->downhill[static_cast<Eigen::Index>(i)];
          next[row] = outwards > 0;
        }
        still = still && next[row] == held[row] && std::abs(step[row]) < kStill;
        // What comes to a stop or leaves it changes the sums beside it: no reason to damp.
        if (next[row] != held[row])
          for (std::size_t near = std::max<std::size_t>(k, 1) - 1; near < std::min(count, k + 2); ++near)
            sums[near] = std::numeric_limits<double>::infinity();
      }
    }
    held = std::move(next);
    for (HandPose& pose : poses) pose = tree.within_stops(std::move(pose));
    if (still || taken >= kMostSteps) return;
  }
}

}  // namespace handsim::study
