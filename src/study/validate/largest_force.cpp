#include "handsim/study/validate/subject.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "handsim/control/muscle_drive.h"
#include "handsim/core/index.h"
#include "handsim/model/kinematics.h"

namespace handsim::study {

namespace {

constexpr double kHighest = 2000;  ///< of the forces that are tried [N]
/// Share of the largest torque, and torque [N m], that may be missing.
constexpr double kMissingShare = 0.01, kMissingTorque = 1e-3;
constexpr double kInwards = -0.5;     ///< cosine beyond which the other end lies inside the finger's shaft
constexpr double kFinestLean = 1e-4;  ///< of the search, over the friction

/// Forces of a contact whose torques muscles have to hold, at one posture.
class Press {
 public:
  /// @param J torques of a force: a column for each of `dofs`, rows in the axes of `normal`
  Press(const Subject& subject, std::span<const double> q, std::vector<int> dofs, Eigen::MatrixXd J)
      : dofs_(std::move(dofs)),
        J_(std::move(J)),
        state_(model::state_at(subject.model(), q)),
        muscles_(subject.model(), {dofs_.begin(), dofs_.end()}),
        torques_(q.size()) {}

  /// The largest component along `normal` of forces that lean from it by at most `friction`: bisection on
  /// what static optimisation leaves undone.
  double largest(const Vec3& normal, double friction) {
    const Vec3 first = normal.unitOrthogonal(), second = normal.cross(first);
    across_ = J_.transpose() * (Eigen::Matrix<double, 3, 2>() << first, second).finished();
    along_ = J_.transpose() * normal;
    lean_.setZero();
    double low = 0, high = kHighest;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (low + high);
      (holds(middle, friction) ? low : high) = middle;
    }
    return low;
  }

 private:
  /// Torques that muscles leave undone under a force along the normal and a lean.
  std::span<const double> missing(double force, const Eigen::Vector2d& lean) {
    const Eigen::VectorXd wanted = force * (along_ + across_ * lean);
    largest_ = wanted.cwiseAbs().maxCoeff();
    for (std::size_t i = 0; i < dofs_.size(); ++i)
      torques_[at(dofs_[i])] = wanted[static_cast<Eigen::Index>(i)];
    muscles_.solve(state_, torques_);
    return muscles_.missing();
  }

  double squares(double force, const Eigen::Vector2d& lean) {
    double out = 0;
    for (const double each : missing(force, lean)) out += each * each;
    return out;
  }

  /// A pattern search over the lean, from that of the last force: what is missing is a smooth convex function
  /// of it.
  bool holds(double force, double friction) {
    double least = squares(force, lean_);
    for (double step = friction / 2; step > kFinestLean * friction;) {
      bool better = false;
      for (int way = 0; way < 8; ++way) {
        const Eigen::Vector2d lean =
            lean_ + step * Eigen::Vector2d(std::cos(way * M_PI_4), std::sin(way * M_PI_4));
        if (lean.norm() > friction) continue;
        if (const double found = squares(force, lean); found < least) {
          lean_ = lean;
          least = found;
          better = true;
        }
      }
      if (!better) step /= 2;
    }
    return balances(force, lean_) || balances(force, Eigen::Vector2d::Zero());
  }

  bool balances(double force, const Eigen::Vector2d& lean) {
    double most = 0;
    for (const double each : missing(force, lean)) most = std::max(most, std::abs(each));
    return most <= kMissingShare * largest_ + kMissingTorque;
  }

  std::vector<int> dofs_;
  Eigen::MatrixXd J_;
  model::State state_;
  control::StaticOptimisation muscles_;
  std::vector<double> torques_;
  Eigen::VectorXd along_;                ///< torques of a newton along the normal
  Eigen::Matrix<double, -1, 2> across_;  ///< and of one across it, in two directions
  Eigen::Vector2d lean_;                 ///< shear over the force along the normal
  double largest_ = 0;                   ///< of the torques that were wanted last [N m]
};

}  // namespace

double largest_tip_force(const Subject& subject, const Measurement& of) {
  const std::vector<double> q = subject.coordinates(of.pose);
  const Eigen::MatrixXd J = of.segment.empty()
                                ? subject.tip_jacobian(of.finger, q)
                                : subject.point_jacobian(of.segment, subject.middle(of.segment), q);
  Press press(subject, q, subject.finger_dofs(of.finger), J.topRows<3>());
  return press.largest(tip_direction(of.direction), of.friction);
}

double largest_pinch_force(const Subject& subject, const Measurement& of) {
  const std::vector<double> q = subject.coordinates(of.pose);
  std::vector<int> dofs;
  std::array<Vec3, 2> centre, outwards;
  std::array<Eigen::MatrixXd, 2> J;  // in the world
  const std::array<std::string, 2> fingers = {"thumb", of.finger};
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string last = last_segment(fingers[i]);
    const Pose segment = subject.segment_pose(last, q);
    const double along = subject.tip_centre(fingers[i]);
    centre[i] = segment.p + segment.q * Vec3(0, along, 0);
    outwards[i] = segment.q * Vec3(0, 1, 0);
    J[i] = segment.q.toRotationMatrix() * subject.point_jacobian(last, along, q).topRows<3>();
    for (const int dof : subject.finger_dofs(fingers[i])) dofs.push_back(dof);
  }
  const Vec3 normal = (centre[1] - centre[0]).normalized();
  if (normal.dot(outwards[0]) < kInwards || -normal.dot(outwards[1]) < kInwards)
    throw Error(PhysicsFault{0, of.name, "pinch", "the round ends do not face each other in this pose"});
  // The thumb presses towards the finger, the finger with the opposite force.
  Eigen::MatrixXd both(3, J[0].cols() + J[1].cols());
  both << J[0], -J[1];
  Press press(subject, q, dofs, std::move(both));
  return press.largest(normal, of.friction);
}

}  // namespace handsim::study
