// States as vectors of coordinates, and derivatives by differences, for tests of derivatives.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include <Eigen/Dense>

#include "handsim/core/index.h"
#include "handsim/model/kinematics.h"

namespace handsim::engine::articulated::test {

/// Coordinates as StepDerivatives has them.
class Coordinates {
 public:
  explicit Coordinates(const model::Model& model) : model_(model) {
    for (std::size_t i = 1; i < model.bodies.size(); ++i) {
      const auto has_joint = [&](const model::Joint& joint) { return joint.child == static_cast<int>(i); };
      if (!model.bodies[i].kinematic && std::ranges::none_of(model.joints, has_joint))
        free_.push_back(static_cast<int>(i));
    }
  }
  int size() const { return model_.dof_count() + 6 * static_cast<int>(free_.size()); }
  /// A state after a change of (q, u).
  model::State moved(const model::State& base, const Eigen::VectorXd& change) const {
    const int dofs = model_.dof_count(), n = size();
    model::State out = base;
    std::vector<double> q = base.q, u = base.u;
    for (const model::Joint& joint : model_.joints)
      if (joint.kind == model::JointKind::ball) {
        const auto f = joint.first_dof;
        const Vec3 now(q[as_index(f)], q[as_index(f + 1)], q[as_index(f + 2)]);
        const Vec3 turned =
            rotation_vector(rotation_quaternion(change.segment<3>(f)) * rotation_quaternion(now));
        for (int k = 0; k < 3; ++k) q[as_index(f + k)] = turned[k];
      } else {
        for (int k = 0; k < dof_count(joint.kind); ++k)
          q[as_index(joint.first_dof + k)] += change[joint.first_dof + k];
      }
    for (int k = 0; k < dofs; ++k) u[as_index(k)] += change[n + k];
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const int c = dofs + 6 * static_cast<int>(i);
      model::BodyState& body = out.bodies[as_index(free_[i])];
      body.q = rotation_quaternion(change.segment<3>(c)) * body.q;
      body.p += change.segment<3>(c + 3);
      body.w += change.segment<3>(n + c);
      body.v += change.segment<3>(n + c + 3);
    }
    const std::vector<double> activation = out.activation;
    model::place_joints(model_, q, u, out);
    out.activation = activation;
    return out;
  }
  /// (q, u), positions against another state's.
  Eigen::VectorXd apart(const model::State& to, const model::State& reference) const {
    const int dofs = model_.dof_count(), n = size();
    Eigen::VectorXd out(2 * n);
    for (int k = 0; k < dofs; ++k) {
      out[k] = to.q[as_index(k)] - reference.q[as_index(k)];
      out[n + k] = to.u[as_index(k)];
    }
    for (const model::Joint& joint : model_.joints) {
      if (joint.kind != model::JointKind::ball) continue;
      const auto f = as_index(joint.first_dof);
      const Quat a = rotation_quaternion(Vec3(to.q[f], to.q[f + 1], to.q[f + 2])),
                 b = rotation_quaternion(Vec3(reference.q[f], reference.q[f + 1], reference.q[f + 2]));
      out.segment<3>(joint.first_dof) = rotation_vector(a * b.conjugate());
    }
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const int c = dofs + 6 * static_cast<int>(i);
      const model::BodyState &body = to.bodies[as_index(free_[i])],
                             &was = reference.bodies[as_index(free_[i])];
      out.segment<3>(c) = rotation_vector(body.q * was.q.conjugate());
      out.segment<3>(c + 3) = body.p - was.p;
      out.segment<3>(n + c) = body.w;
      out.segment<3>(n + c + 3) = body.v;
    }
    return out;
  }

 private:
  const model::Model& model_;
  std::vector<int> free_;
};

/// A derivative by Ridders' method: central differences at halved steps, extrapolated; the estimate with the
/// smallest error as the table itself tells it (Numerical Recipes, section 5.7).
struct Difference {
  Eigen::VectorXd value;
  double error = HUGE_VAL;  ///< largest, relative as `error` has it
};
inline double error(const Eigen::VectorXd& found, const Eigen::VectorXd& oracle);
inline Difference ridders(double h, const std::function<Eigen::VectorXd(double)>& f) {
  constexpr int kRows = 9;
  std::vector<Eigen::VectorXd> last, now;
  Difference out;
  for (int i = 0; i < kRows; ++i, h /= 2) {
    now.assign(1, (f(h) - f(-h)) / (2 * h));
    double power = 1;
    for (int j = 1; j <= std::min(i, 3); ++j) {
      power *= 4;
      now.push_back((power * now.back() - last[as_index(j - 1)]) / (power - 1));
      const double e = std::max(error(now[as_index(j)], now[as_index(j - 1)]),
                                error(now[as_index(j)], last[as_index(j - 1)]));
      if (e < out.error) out = {now[as_index(j)], e};
    }
    last.swap(now);
  }
  return out;
}

/// Largest difference of a column over the largest number of its half (q', u').
inline double error(const Eigen::VectorXd& found, const Eigen::VectorXd& oracle) {
  const Eigen::Index n = found.size() / 2;
  double out = 0;
  for (const Eigen::Index first : {Eigen::Index{0}, n})
    out = std::max(out, (found - oracle).segment(first, n).lpNorm<Eigen::Infinity>() /
                            std::max(1e-3, oracle.segment(first, n).lpNorm<Eigen::Infinity>()));
  return out;
}

}  // namespace handsim::engine::articulated::test
