#include "handsim/engine/articulated/cone_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Dense>

namespace handsim::engine::articulated {

namespace {

/// Added to a contact's block, relative to its trace: mechanisms of few degrees of freedom have blocks that
/// are singular. Does not move the solution, for what is inverted only corrects.
constexpr double kSingular = 1e-9;
/// Corrections of a sliding contact in one turn.
constexpr int kSlides = 30;
constexpr double kSlideTolerance = 1e-12;
/// Growth of a sweep's square that calls for a new start of the conjugate directions.
constexpr double kRestart = 1.1;

Eigen::Vector2d onto_disc(const Eigen::Vector2d& x, double radius) {
  const double length = x.norm();
  return length <= radius ? x : Eigen::Vector2d(x * (radius / length));
}

}  // namespace

void ConeSolver::reset(std::size_t rows) {
  rows_ = rows;
  W_.assign(rows * rows, 0.0);
  b_.assign(rows, 0.0);
  p_.assign(rows, 0.0);
}

double ConeSolver::velocity(std::size_t row) const {
  using Row = Eigen::Map<const Eigen::VectorXd>;
  const auto n = static_cast<Eigen::Index>(rows_);
  return b_[row] + Row(W_.data() + row * rows_, n).dot(Row(p_.data(), n));
}

void ConeSolver::invert_blocks(std::span<const Cone> cones) {
  inverses_.resize(cones.size());
  for (std::size_t i = 0; i < cones.size(); ++i) {
    if (!(cones[i].friction > 0)) continue;
    Mat3 A;
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c)
        A(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) =
            entry(cones[i].row + r, cones[i].row + c);
    A.diagonal().array() += kSingular * A.trace();
    inverses_[i] = A.inverse();
  }
}

double ConeSolver::solve_line(std::size_t row, double bound) {
  if (!(entry(row, row) > 0)) return 0;
  const double old = p_[row];
  p_[row] = std::clamp(old - velocity(row) / entry(row, row), -bound, bound);
  return entry(row, row) * std::abs(p_[row] - old);
}

double ConeSolver::solve_disc(std::size_t row, double radius) {
  const double trace = entry(row, row) + entry(row + 1, row + 1);
  if (!(trace > 0)) return 0;
  const Eigen::Vector2d old(p_[row], p_[row + 1]);
  const Eigen::Vector2d v(velocity(row), velocity(row + 1));
  const Eigen::Vector2d now = onto_disc(old - v / trace, radius);
  p_[row] = now.x();
  p_[row + 1] = now.y();
  return trace * (now - old).norm();
}

/// The contact's own three impulses with all others as they are. Returns the most that its velocity changed.
double ConeSolver::solve_contact(const Cone& cone, const Mat3& inverse) {
  const std::size_t n = cone.row;
  const double diagonal = entry(n, n);
  if (!(diagonal > 0)) return 0;
  if (!(cone.friction > 0)) {
    const double old = p_[n];
    p_[n] = std::max(0.0, old - velocity(n) / diagonal);
    return diagonal * std::abs(p_[n] - old);
  }
  const Vec3 old(p_[n], p_[n + 1], p_[n + 2]);
  const Vec3 v(velocity(n), velocity(n + 1), velocity(n + 2));
  const double nx = entry(n, n + 1), ny = entry(n, n + 2), xx = entry(n + 1, n + 1), xy = entry(n + 1, n + 2),
               yy = entry(n + 2, n + 2);
  // Velocity that the others leave.
  const Vec3 c(v.x() - diagonal * old.x() - nx * old.y() - ny * old.z(),
               v.y() - nx * old.x() - xx * old.y() - xy * old.z(),
               v.z() - ny * old.x() - xy * old.y() - yy * old.z());
  Vec3 now = Vec3::Zero();
  if (c.x() < 0) {
    now = old - inverse * v;
    if (!(now.x() >= 0 && now.tail<2>().norm() <= cone.friction * now.x())) {
      // Slides: the normal impulse for the friction, the friction for the normal impulse.
      const double stiffest = 0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), xy);
      Eigen::Vector2d t = old.tail<2>();
      double normal = old.x();
      for (int i = 0; i < kSlides; ++i) {
        const double last = normal;
        normal = std::max(0.0, -(c.x() + nx * t.x() + ny * t.y()) / diagonal);
        const Eigen::Vector2d slip(c.y() + nx * normal + xx * t.x() + xy * t.y(),
                                   c.z() + ny * normal + xy * t.x() + yy * t.y());
        const Eigen::Vector2d next =
            stiffest > 0 ? onto_disc(t - slip / stiffest, cone.friction * normal) : t;
        const bool settled = (next - t).norm() + std::abs(normal - last) <= kSlideTolerance * normal;
        t = next;
        if (settled) break;
      }
      now << normal, t;
    }
  }
  p_[n] = now.x();
  p_[n + 1] = now.y();
  p_[n + 2] = now.z();
  const Vec3 d = now - old;
  return std::max({std::abs(diagonal * d.x() + nx * d.y() + ny * d.z()),
                   std::abs(nx * d.x() + xx * d.y() + xy * d.z()),
                   std::abs(ny * d.x() + xy * d.y() + yy * d.z())});
}

double ConeSolver::sweep(std::span<const Cone> cones) {
  double change = 0;
  for (std::size_t i = 0; i < cones.size(); ++i) {
    const Cone& cone = cones[i];
    change = std::max(change, solve_contact(cone, inverses_[i]));
    const double normal = p_[cone.row];
    std::size_t row = cone.row + (cone.friction > 0 ? 3 : 1);
    if (cone.spinning > 0) change = std::max(change, solve_line(row++, cone.spinning * normal));
    if (cone.rolling > 0) change = std::max(change, solve_disc(row, cone.rolling * normal));
  }
  return change;
}

ConeReport ConeSolver::solve(std::span<const Cone> cones, double tolerance, int most_sweeps) {
  invert_blocks(cones);
  direction_.assign(rows_, 0.0);
  change_.assign(rows_, 0.0);
  ConeReport report;
  double last_square = 0, best = std::numeric_limits<double>::infinity();
  while (report.sweeps < most_sweeps) {
    last_ = p_;
    report.residual = sweep(cones);
    ++report.sweeps;
    report.solved = report.residual <= tolerance;
    if (report.residual < best) {
      best = report.residual;
      best_ = p_;
    }
    if (report.solved) break;
    double square = 0;
    for (std::size_t i = 0; i < rows_; ++i) {
      change_[i] = p_[i] - last_[i];
      square += entry(i, i) * change_[i] * change_[i];
    }
    // A sweep's result keeps to the cones; what it is sped up to need not.
    if (report.sweeps == most_sweeps) break;
    // Redundant contacts that cannot all be met drift at a constant rate till one opens: no reason to
    // restart.
    const double ratio = last_square > 0 ? square / last_square : 0, share = std::min(ratio, 1.0);
    last_square = square;
    if (ratio > kRestart) {
      std::fill(direction_.begin(), direction_.end(), 0.0);
      continue;
    }
    for (std::size_t i = 0; i < rows_; ++i) {
      p_[i] += share * direction_[i];
      direction_[i] = share * direction_[i] + change_[i];
    }
  }
  if (!report.solved) {
    p_ = best_;
    report.residual = best;
  }
  return report;
}

}  // namespace handsim::engine::articulated
