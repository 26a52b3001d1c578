#include "handsim/study/track/pose_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/SVD>

namespace handsim::study {

namespace {

/// log(exp(dr) exp(r)) = r + J dr for small dr.
Mat3 inverse_left_jacobian(const Vec3& r) {
  const double angle = r.norm();
  const Mat3 k = cross_matrix(r);
  if (angle < 1e-6) return Mat3::Identity() - 0.5 * k;
  const double half = 0.5 * angle;
  return Mat3::Identity() - 0.5 * k + (1 - half / std::tan(half)) / (angle * angle) * k * k;
}

/// The rigid motion that brings points of the hand to measured ones (Kabsch); nothing for fewer than three.
std::optional<Pose> rigid_fit(const std::vector<Vec3>& from, const std::vector<Vec3>& to) {
  if (from.size() < 3) return std::nullopt;
  Vec3 a = Vec3::Zero(), b = Vec3::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) a += from[i], b += to[i];
  a /= static_cast<double>(from.size());
  b /= static_cast<double>(from.size());
  Mat3 sum = Mat3::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) sum += (to[i] - b) * (from[i] - a).transpose();
  const Eigen::JacobiSVD<Mat3> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 fix = Mat3::Identity();
  fix(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  const Quat q(Mat3(svd.matrixU() * fix * svd.matrixV().transpose()));
  return Pose{b - q * a, q};
}

/// Parameters that a step down the slope may change: not angles that it would push beyond their stops.
std::vector<Eigen::Index> free_parameters(const HandTree& tree, const HandPose& pose,
                                          const Eigen::VectorXd& slope) {
  std::vector<Eigen::Index> out;
  for (Eigen::Index i = 0; i < slope.size(); ++i) {
    const auto axis = as_index(i - 6);
    const bool held = i >= 6 && (slope[i] > 0 ? pose.angles[axis] <= tree.axes()[axis].low
                                              : pose.angles[axis] >= tree.axes()[axis].high);
    if (!held) out.push_back(i);
  }
  return out;
}

}  // namespace

Rows PoseFit::rows(const MeasuredFrame& frame, const HandPose& pose, const std::vector<bool>& rejected) {
  const auto count = static_cast<Eigen::Index>(6 * features_.size() + tree_.pairs());
  const auto angles = static_cast<Eigen::Index>(pose.angles.size());
  Rows out{Eigen::VectorXd::Zero(count), Eigen::MatrixXd::Zero(count, 6 + angles)};
  const Mat3 rotation = pose.wrist.q.toRotationMatrix();
  tree_.place(pose.angles);
  for (std::size_t i = 0; i < features_.size(); ++i) {
    const Feature& feature = features_[i];
    auto residual = out.residuals.segment<3>(static_cast<Eigen::Index>(3 * i));
    auto rows = out.jacobian.middleRows<3>(static_cast<Eigen::Index>(3 * i));
    if (rejected[i] || !frame[i].seen()) continue;
    if (feature.kind == Feature::Kind::point) {
      const Vec3 arm = rotation * tree_.point(feature);
      const double weight = frame[i].weight;
      residual = weight * (pose.wrist.p + arm - *frame[i].point);
      rows.leftCols<3>() = weight * Mat3::Identity();
      rows.middleCols<3>(3) = -weight * cross_matrix(arm);
      rows.rightCols(angles) = (weight * rotation) * tree_.jacobian(feature).topRows<3>();
    } else {
      const Vec3 error =
          rotation_vector(pose.wrist.q * tree_.orientation(feature) * frame[i].orientation->conjugate());
      const Mat3 inverse = kSensorArm * inverse_left_jacobian(error);
      residual = kSensorArm * error;
      rows.middleCols<3>(3) = inverse;
      rows.rightCols(angles) = inverse * rotation * tree_.jacobian(feature).bottomRows<3>();
    }
    if (!feature.from || rejected[*feature.from] || !frame[*feature.from].point) continue;
    const Vec3 measured = (*frame[i].point - *frame[*feature.from].point).normalized();
    Feature segment;
    segment.segment = feature.bone;
    const Vec3 along = rotation * (tree_.orientation(segment) * Vec3::UnitY());
    const auto first = static_cast<Eigen::Index>(3 * (features_.size() + i));
    out.residuals.segment<3>(first) = feature.arm * (along - measured);
    const Mat3 by_turn = -feature.arm * cross_matrix(along);
    out.jacobian.block<3, 3>(first, 3) = by_turn;
    out.jacobian.middleRows<3>(first).rightCols(angles) =
        by_turn * rotation * tree_.jacobian(segment).bottomRows<3>();
  }
  for (std::size_t i = 0; i < tree_.pairs() && firm_ > 0; ++i)
    if (const auto inside = tree_.inside(i, kGive)) {
      const auto row = static_cast<Eigen::Index>(6 * features_.size() + i);
      out.residuals[row] = firm_ * (inside->depth - kGive);
      out.jacobian.row(row).tail(angles) = firm_ * inside->by_angles;
    }
  return out;
}

/// Levenberg-Marquardt, with Marquardt's scale, on the parameters that are free at the pose.
HandPose PoseFit::solve(const MeasuredFrame& frame, HandPose pose, const std::vector<bool>& rejected) {
  constexpr int kMostSteps = 60;
  constexpr double kLeastGain = 1e-7, kLeastStep = 1e-10;  // of the squares; [m] or [rad]
  pose = tree_.moved(pose, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(tree_.size())));
  Rows now = rows(frame, pose, rejected);
  double damping = 1e-4;
  for (int i = 0; i < kMostSteps; ++i) {
    const Eigen::VectorXd slope = now.jacobian.transpose() * now.residuals;
    const std::vector<Eigen::Index> free = free_parameters(tree_, pose, slope);
    const Eigen::MatrixXd J = now.jacobian(Eigen::all, free);
    Eigen::MatrixXd H = J.transpose() * J;
    H.diagonal() += damping * H.diagonal().cwiseMax(1e-6 * H.diagonal().maxCoeff() + 1e-12);
    Eigen::VectorXd step = Eigen::VectorXd::Zero(slope.size());
    step(free) = -H.llt().solve(slope(free));
    const HandPose next = tree_.moved(pose, step);
    Rows there = rows(frame, next, rejected);
    const double before = now.residuals.squaredNorm(), after = there.residuals.squaredNorm();
    if (after < before) {
      pose = next;
      now = std::move(there);
    }
    damping *= after < before ? 1.0 / 3 : 8;
    const bool done = after < before && before - after <= kLeastGain * before;
    if (done || step.cwiseAbs().maxCoeff() <= kLeastStep) break;
  }
  return pose;
}

FitResult PoseFit::measure(const MeasuredFrame& frame, HandPose pose, std::vector<bool> rejected) {
  const Eigen::VectorXd residuals = rows(frame, pose, rejected).residuals;
  FitResult out{std::move(pose), 0, {}, std::move(rejected)};
  double squares = 0, count = 0;
  for (std::size_t i = 0; i < features_.size(); ++i) {
    auto& distance = out.distances.emplace_back();
    if (out.rejected[i] || !frame[i].seen()) continue;
    distance = residuals.segment<3>(static_cast<Eigen::Index>(3 * i)).norm() / frame[i].weight;
    squares += *distance * *distance;
    count += 1;
  }
  out.rms = count > 0 ? std::sqrt(squares / count) : 0;
  return out;
}

FitResult PoseFit::fit(const MeasuredFrame& frame, const HandPose& start, double outlier) {
  constexpr int kMostRejected = 5;
  FitResult out{start, 0, {}, std::vector<bool>(features_.size(), false)};
  for (int round = 0;; ++round) {
    out = measure(frame, solve(frame, out.pose, out.rejected), out.rejected);
    const auto worst = std::ranges::max_element(out.distances);
    // An absent distance is less than any other.
    if (round == kMostRejected || !*worst || **worst <= outlier) return out;
    out.rejected[as_index(worst - out.distances.begin())] = true;
  }
}

FitResult PoseFit::find(const MeasuredFrame& frame, double outlier) {
  std::optional<FitResult> best;
  for (const double flexion : {0.35, 0.9, 0.1}) {
    HandPose start;
    for (const TreeAxis& axis : tree_.axes())
      start.angles.push_back(std::clamp(axis.flexion ? flexion : 0.0, axis.low, axis.high));
    tree_.place(start.angles);
    // The palm alone where it has three points.
    for (const bool palm_only : {true, false}) {
      std::vector<Vec3> from, to;
      for (std::size_t i = 0; i < features_.size(); ++i) {
        if (!frame[i].point || (palm_only && !features_[i].base)) continue;
        from.push_back(tree_.point(features_[i]));
        to.push_back(*frame[i].point);
      }
      const auto rigid = rigid_fit(from, to);
      if (rigid) start.wrist = *rigid;
      if (rigid) break;
    }
    for (std::size_t i = 0; i < features_.size(); ++i)
      if (frame[i].orientation && !features_[i].segment)
        start.wrist.q = *frame[i].orientation * tree_.orientation(features_[i]).conjugate();
    FitResult found = fit(frame, start, outlier);
    if (!best || found.rms < best->rms) best = std::move(found);
  }
  return *best;
}

}  // namespace handsim::study
