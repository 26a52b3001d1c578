#include "handsim/study/track/smoother.h"

#include <algorithm>
#include <cmath>

namespace handsim::study {

namespace {

/// Symmetric positive definite band matrix; row i has columns i - width to i.
class BandSystem {
 public:
  BandSystem(std::size_t size, std::size_t width)
      : size_(size), width_(width), rows_(size * (width + 1), 0.0), right_(size, 0.0) {}

  /// Entry (i, j) with i >= j >= i - width.
  double& at(std::size_t i, std::size_t j) { return rows_[i * (width_ + 1) + width_ + j - i]; }
  double& right(std::size_t i) { return right_[i]; }

  /// Cholesky's method; the solution replaces the right side.
  std::vector<double> solve() {
    for (std::size_t i = 0; i < size_; ++i) {
      const std::size_t first = i > width_ ? i - width_ : 0;
      for (std::size_t j = first; j <= i; ++j) {
        const std::size_t from = std::max(first, j > width_ ? j - width_ : 0);
        const double sum = at(i, j) - dot(&at(i, from), &at(j, from), j - from);
        at(i, j) = j == i ? std::sqrt(std::max(sum, 1e-300)) : sum / at(j, j);
      }
      right_[i] = (right_[i] - dot(&at(i, first), &right_[first], i - first)) / at(i, i);
    }
    for (std::size_t i = size_; i-- > 0;) {
      right_[i] /= at(i, i);
      const std::size_t first = i > width_ ? i - width_ : 0;
      for (std::size_t j = first; j < i; ++j) right_[j] -= at(i, j) * right_[i];
    }
    return std::move(right_);
  }

 private:
  static double dot(const double* a, const double* b, std::size_t n) {
    using Vector = Eigen::Map<const Eigen::VectorXd>;
    const auto size = static_cast<Eigen::Index>(n);
    return Vector(a, size).dot(Vector(b, size));
  }

  std::size_t size_, width_;
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

void smooth(const std::vector<double>& times, const std::vector<Linearised>& frames, double noise,
            const MotionPrior& prior, const HandTree& tree, std::vector<HandPose>& poses) {
  const std::size_t count = poses.size(), size = tree.size();
  if (count < 3) return;
  BandSystem system(count * size, 2 * size);
  const double weight = 1 / (noise * noise);
  for (std::size_t k = 0; k < count; ++k)
    for (std::size_t i = 0; i < size; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      system.right(k * size + i) -= weight * frames[k].gradient[row];
      for (std::size_t j = 0; j <= i; ++j)
        system.at(k * size + i, k * size + j) += weight * frames[k].matrix(row, static_cast<Eigen::Index>(j));
    }
  for (std::size_t k = 1; k + 1 < count; ++k) {
    const double before = times[k] - times[k - 1], after = times[k + 1] - times[k];
    const Eigen::VectorXd change =
        difference(poses[k], poses[k + 1]) / after - difference(poses[k - 1], poses[k]) / before;
    const std::array<double, 3> factor = {1 / before, -1 / before - 1 / after, 1 / after};
    for (std::size_t i = 0; i < size; ++i) {
      const double density = i < 3 ? prior.position : i < 6 ? prior.turn : prior.angle;
      const double stiffness = 2 / (density * (before + after));
      for (std::size_t a = 0; a < 3; ++a) {
        const std::size_t row = (k + a - 1) * size + i;
        system.right(row) -= stiffness * factor[a] * change[static_cast<Eigen::Index>(i)];
        for (std::size_t b = 0; b <= a; ++b)
          system.at(row, (k + b - 1) * size + i) += stiffness * factor[a] * factor[b];
      }
    }
  }
  const std::vector<double> step = system.solve();
  for (std::size_t k = 0; k < count; ++k) {
    const double* x = step.data() + k * size;
    poses[k].wrist.p += Vec3(x[0], x[1], x[2]);
    poses[k].wrist.q = (rotation_quaternion({x[3], x[4], x[5]}) * poses[k].wrist.q).normalized();
    for (std::size_t i = 0; i < poses[k].angles.size(); ++i)
      poses[k].angles[i] = std::clamp(poses[k].angles[i] + x[6 + i], tree.axes()[i].low, tree.axes()[i].high);
  }
}

}  // namespace handsim::study
