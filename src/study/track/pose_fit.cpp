#include "handsim/study/track/pose_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/SVD>

#include "handsim/study/track/least_squares.h"

namespace handsim::study {

namespace {

/// Residuals in mm, so that the tolerances of the solver fit.
constexpr double kScale = 1e3;

Mat3 cross_matrix(const Vec3& v) {
  Mat3 out;
  out << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return out;
}

/// exp(r + dr) = exp(J dr) exp(r) for small dr.
Mat3 left_jacobian(const Vec3& r) {
  const double angle = r.norm();
  const Mat3 k = cross_matrix(r);
  if (angle < 1e-6) return Mat3::Identity() + 0.5 * k;
  const double a2 = angle * angle;
  return Mat3::Identity() + (1 - std::cos(angle)) / a2 * k + (angle - std::sin(angle)) / (a2 * angle) * k * k;
}

/// The same for dr given and the turned vector log(R) wanted: the inverse of left_jacobian().
Mat3 inverse_left_jacobian(const Vec3& r) {
  const double angle = r.norm();
  const Mat3 k = cross_matrix(r);
  if (angle < 1e-6) return Mat3::Identity() - 0.5 * k;
  const double half = 0.5 * angle;
  return Mat3::Identity() - 0.5 * k + (1 - half / std::tan(half)) / (angle * angle) * k * k;
}

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The residuals of one frame for the solver; parameters: position, turn, angles.
class FrameCost {
 public:
  FrameCost(HandTree& tree, const std::vector<Feature>& features) : tree_(tree), features_(features) {}

  int residuals() const { return static_cast<int>(3 * features_.size()); }

  void set(const std::vector<MeasuredPoint>* frame, const Quat& reference,
           const std::vector<bool>& rejected) {
    frame_ = frame;
    reference_ = reference;
    rejected_ = rejected;
  }

  bool used(std::size_t i) const {
    if (rejected_[i]) return false;
    const MeasuredPoint& m = (*frame_)[i];
    return features_[i].kind == Feature::Kind::point ? m.point.has_value() : m.orientation.has_value();
  }

  void evaluate(const double* x, double* residuals, double* derivatives) const {
    const auto n = static_cast<Eigen::Index>(tree_.size());
    const Vec3 position(x[0], x[1], x[2]), turn(x[3], x[4], x[5]);
    const Mat3 rotation = (rotation_quaternion(turn) * reference_).toRotationMatrix();
    tree_.place({x + 6, tree_.size() - 6});
    const bool derive = derivatives != nullptr;
    Out jacobian(derivatives, derive ? this->residuals() : 0, derive ? n : 0);
    if (derive) jacobian.setZero();
    const Mat3 turning = derive ? left_jacobian(turn) : Mat3::Identity();
    for (std::size_t i = 0; i < features_.size(); ++i) {
      Eigen::Map<Vec3> residual(residuals + 3 * i);
      residual.setZero();
      if (!used(i)) continue;
      const auto row = static_cast<Eigen::Index>(3 * i);
      if (features_[i].kind == Feature::Kind::point)
        point(i, position, rotation, turning, residual, derive ? &jacobian : nullptr, row);
      else
        sensor(i, rotation, turning, residual, derive ? &jacobian : nullptr, row);
    }
  }

 private:
  using Out = Eigen::Map<RowMajor>;

  void point(std::size_t i, const Vec3& position, const Mat3& rotation, const Mat3& turning,
             Eigen::Map<Vec3>& residual, Out* jacobian, Eigen::Index row) const {
    const Feature& feature = features_[i];
    const Vec3 in_hand = tree_.point(feature), arm = rotation * in_hand;
    residual = kScale * (position + arm - *(*frame_)[i].point);
    if (!jacobian) return;
    jacobian->block<3, 3>(row, 0) = kScale * Mat3::Identity();
    jacobian->block<3, 3>(row, 3) = -kScale * cross_matrix(arm) * turning;
    jacobian->middleRows<3>(row).rightCols(jacobian->cols() - 6) =
        kScale * rotation * tree_.jacobian(feature).topRows<3>();
  }

  void sensor(std::size_t i, const Mat3& rotation, const Mat3& turning, Eigen::Map<Vec3>& residual,
              Out* jacobian, Eigen::Index row) const {
    constexpr double kArm = kScale * kSensorArm;
    const Feature& feature = features_[i];
    const Quat fitted = Quat(rotation) * tree_.orientation(feature);
    const Vec3 error = rotation_vector(fitted * (*frame_)[i].orientation->conjugate());
    residual = kArm * error;
    if (!jacobian) return;
    const Mat3 inverse = kArm * inverse_left_jacobian(error);
    jacobian->block<3, 3>(row, 3) = inverse * turning;
    jacobian->middleRows<3>(row).rightCols(jacobian->cols() - 6) =
        inverse * rotation * tree_.jacobian(feature).bottomRows<3>();
  }

  HandTree& tree_;
  const std::vector<Feature>& features_;
  const std::vector<MeasuredPoint>* frame_ = nullptr;
  Quat reference_ = Quat::Identity();
  std::vector<bool> rejected_;
};

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

}  // namespace

struct PoseFit::Parts {
  HandTree tree;
  std::vector<Feature> features;
  std::vector<double> x;
  FrameCost cost;
  std::vector<double> low, high;  ///< by parameter

  Parts(HandTree of, std::vector<Feature> with)
      : tree(std::move(of)), features(std::move(with)), x(tree.size(), 0.0), cost(tree, features) {
    constexpr double kNone = std::numeric_limits<double>::infinity();
    low.assign(6, -kNone);
    high.assign(6, kNone);
    for (const TreeAxis& axis : tree.axes()) {
      low.push_back(axis.low);
      high.push_back(axis.high);
    }
  }

  void solve() {
    const auto evaluate = [](const void* of, const double* at, double* residuals, double* jacobian) {
      static_cast<const FrameCost*>(of)->evaluate(at, residuals, jacobian);
    };
    study::solve({evaluate, &cost, cost.residuals(), static_cast<int>(x.size()), low.data(), high.data()}, x);
  }

  void load(const HandPose& pose) {
    for (int k = 0; k < 3; ++k) x[static_cast<std::size_t>(k)] = pose.wrist.p[k];
    std::fill(x.begin() + 3, x.begin() + 6, 0.0);
    for (std::size_t i = 0; i < pose.angles.size(); ++i)
      x[6 + i] = std::clamp(pose.angles[i], tree.axes()[i].low, tree.axes()[i].high);
  }

  HandPose pose(const Quat& reference) const {
    HandPose out;
    out.wrist.p = {x[0], x[1], x[2]};
    out.wrist.q = (rotation_quaternion({x[3], x[4], x[5]}) * reference).normalized();
    out.angles.assign(x.begin() + 6, x.end());
    return out;
  }

  void measure(FitResult& out) const {
    std::vector<double> residuals(3 * features.size());
    cost.evaluate(x.data(), residuals.data(), nullptr);
    out.squares = 0;
    out.residuals = 0;
    out.distances.assign(features.size(), std::nullopt);
    for (std::size_t i = 0; i < features.size(); ++i) {
      if (!cost.used(i)) continue;
      out.distances[i] = Eigen::Map<const Vec3>(residuals.data() + 3 * i).norm() / kScale;
      out.squares += *out.distances[i] * *out.distances[i];
      out.residuals += 3;
    }
    out.rms = out.residuals == 0 ? 0 : std::sqrt(3 * out.squares / static_cast<double>(out.residuals));
  }
};

PoseFit::PoseFit(HandTree tree, std::vector<Feature> features)
    : parts_(std::make_unique<Parts>(std::move(tree), std::move(features))) {}
PoseFit::~PoseFit() = default;
PoseFit::PoseFit(PoseFit&&) noexcept = default;

const HandTree& PoseFit::tree() const { return parts_->tree; }
const std::vector<Feature>& PoseFit::features() const { return parts_->features; }

FitResult PoseFit::fit(const std::vector<MeasuredPoint>& frame, const HandPose& start, double outlier) {
  constexpr int kMostRejected = 5;
  Parts& parts = *parts_;
  FitResult out;
  out.rejected.assign(parts.features.size(), false);
  HandPose from = start;
  for (int round = 0;; ++round) {
    parts.cost.set(&frame, from.wrist.q, out.rejected);
    parts.load(from);
    parts.solve();
    out.pose = parts.pose(from.wrist.q);
    parts.measure(out);
    const auto worst = std::ranges::max_element(out.distances);
    // An absent distance is less than any other.
    if (round == kMostRejected || !*worst || **worst <= outlier) return out;
    out.rejected[static_cast<std::size_t>(worst - out.distances.begin())] = true;
    from = out.pose;
  }
}

FitResult PoseFit::find(const std::vector<MeasuredPoint>& frame, double outlier) {
  Parts& parts = *parts_;
  std::optional<FitResult> best;
  for (const double flexion : {0.35, 0.9, 0.1}) {
    HandPose start;
    for (const TreeAxis& axis : parts.tree.axes())
      start.angles.push_back(std::clamp(axis.flexion ? flexion : 0.0, axis.low, axis.high));
    parts.tree.place(start.angles);
    // The palm alone where it has three points.
    for (const bool palm_only : {true, false}) {
      std::vector<Vec3> from, to;
      for (std::size_t i = 0; i < parts.features.size(); ++i) {
        const Feature& feature = parts.features[i];
        const bool at_base =
            feature.segment < 0 || feature.name.ends_with("_mcp") || feature.name.ends_with("_cmc");
        if (!frame[i].point || (palm_only && (!at_base || feature.name.ends_with("thumb_mcp")))) continue;
        from.push_back(parts.tree.point(feature));
        to.push_back(*frame[i].point);
      }
      const auto rigid = rigid_fit(from, to);
      if (rigid) start.wrist = *rigid;
      if (rigid) break;
    }
    for (std::size_t i = 0; i < parts.features.size(); ++i)
      if (frame[i].orientation && parts.features[i].segment < 0)
        start.wrist.q = *frame[i].orientation * parts.tree.orientation(parts.features[i]).conjugate();
    FitResult found = fit(frame, start, outlier);
    if (!best || found.rms < best->rms) best = std::move(found);
  }
  return *best;
}

std::vector<std::optional<double>> PoseFit::distances(const std::vector<MeasuredPoint>& frame,
                                                      const HandPose& pose,
                                                      const std::vector<bool>& rejected) {
  Parts& parts = *parts_;
  parts.cost.set(&frame, pose.wrist.q, rejected);
  parts.load(pose);
  FitResult out;
  parts.measure(out);
  return out.distances;
}

Rows PoseFit::rows(const std::vector<MeasuredPoint>& frame, const HandPose& pose,
                   const std::vector<bool>& rejected) {
  Parts& parts = *parts_;
  parts.cost.set(&frame, pose.wrist.q, rejected);
  parts.load(pose);
  Eigen::VectorXd residuals(parts.cost.residuals());
  RowMajor jacobian(parts.cost.residuals(), static_cast<Eigen::Index>(parts.tree.size()));
  parts.cost.evaluate(parts.x.data(), residuals.data(), jacobian.data());
  return {residuals / kScale, jacobian / kScale};
}

Linearised PoseFit::linearise(const std::vector<MeasuredPoint>& frame, const HandPose& pose,
                              const std::vector<bool>& rejected) {
  const Rows at = rows(frame, pose, rejected);
  Linearised out;
  out.gradient = at.jacobian.transpose() * at.residuals;
  out.matrix = at.jacobian.transpose() * at.jacobian;
  out.squares = at.residuals.squaredNorm();
  for (std::size_t i = 0; i < parts_->features.size(); ++i)
    if (parts_->cost.used(i)) out.residuals += 3;
  return out;
}

}  // namespace handsim::study
