// Augmented Lagrangian with second-order backward differences at a fixed step (Bayo & Ledesma 1996,
// Nonlinear Dyn 9:113). With h' = 2h/3 and x_hat, u_hat from the last two states, Newton's method solves
//   x = x_hat + h' T(x) u,   M (u - u_hat) = h' (f - G^T (lambda + alpha g))
// at the end of each step; each iteration adds alpha g to lambda, until g is zero. Then velocities are
// projected onto the constraints. Second order; the first step after a start is implicit Euler.
//
// alpha = kPenalty / (h'^2 G M^-1 G^T) per row: kPenalty is the ratio of a joint's stiffness to the inertia
// of its bodies over h'^2, for bodies of any mass. Redundant rows share the load.
#include <cmath>

#include <fmt/format.h>

#include "handsim/engine/dae/euler.h"
#include "handsim/engine/dae/penalty.h"
#include "handsim/engine/multibody/projection.h"

namespace handsim::engine::dae {

namespace {

constexpr double kPenalty = 1e6;
constexpr int kMaxIterations = 60;
constexpr double kMaxConstraintError = 1e-12;  ///< ends the iteration [m, or 1]
constexpr double kMaxVelocityChange = 1e-10;   ///< ends the iteration, relative to 1 + the largest velocity
constexpr double kSameStep = 1e-6;             ///< relative difference of equal steps, by rounding of times

class Penalty final : public Integrator {
 public:
  explicit Penalty(System system) : system_(std::move(system)) {}

  void reset(model::State& state) override {
    project_positions(system_, state);
    project_velocities(system_, state);
    has_last_ = false;
    multipliers_ = Vector::Zero(system_.constraint_count());
  }

  void advance(std::span<const double> torques, double end, model::State& state) override {
    model::State now = state;
    const double step = end - state.time;
    const Past before = past(state, step);
    now.time = end;
    system_.place_driven(end, model::KeySide::before, now);
    solve_step(before, torques, now);
    project_velocities(system_, now);
    last_x_ = system_.positions(state);
    last_u_ = system_.velocities(state);
    last_step_ = step;
    has_last_ = true;
    system_.copy_bodies(now, state);
  }

  void save(ArchiveWriter& out) const override { serialize(out, *this); }

  void restore(const model::State& state, ArchiveReader& in) override {
    last_x_ = system_.positions(state);
    last_u_ = system_.velocities(state);
    multipliers_ = Vector::Zero(system_.constraint_count());
    serialize(in, *this);
  }

 private:
  /// x_hat and u_hat, the past states' part of a backward difference, and the weight h' [s] of the present.
  struct Past {
    Vector x, u;
    double weight = 0;
  };
  template <class Archive, class Self>
  static void serialize(Archive& archive, Self& self) {
    archive(self.has_last_);
    if (self.has_last_) {
      archive(self.last_step_);
      archive.each(self.last_x_);
      archive.each(self.last_u_);
    }
    archive.each(self.multipliers_);
  }

  Past past(const model::State& state, double step) const {
    const Vector x = system_.positions(state), u = system_.velocities(state);
    if (!has_last_ || std::abs(step - last_step_) > kSameStep * step) return {x, u, step};
    Vector last = last_x_;
    // q and -q are the same rotation; differences need the same sign.
    for (Index i = 0; i < system_.body_count(); ++i) {
      auto q = last.segment<4>(kPoseSize * i + 3);
      if (q.dot(x.segment<4>(kPoseSize * i + 3)) < 0) q = -q;
    }
    return {(4 * x - last) / 3, (4 * u - last_u_) / 3, 2 * step / 3};
  }

  /// x_hat + weight T(x) u, solved for x.
  Vector end_positions(const Past& past, const Vector& u) const {
    Vector x = past.x;
    for (Index i = 0; i < system_.body_count(); ++i) {
      x.segment<3>(kPoseSize * i) += past.weight * u.segment<3>(kTwistSize * i);
      // (1 - W) q = q_hat with W q = weight/2 q (0, w), and W^2 = -|weight w / 2|^2.
      const Vec3 w = 0.5 * past.weight * u.segment<3>(kTwistSize * i + 3);
      const Quat q(Eigen::Vector4d(past.x.segment<4>(kPoseSize * i + 3)));
      x.segment<4>(kPoseSize * i + 3) =
          (q.coeffs() + (q * Quat(0, w.x(), w.y(), w.z())).coeffs()).normalized();
    }
    return x;
  }

  void solve_step(const Past& past, std::span<const double> torques, model::State& state) {
    Vector u = past.u;
    std::vector<ConstraintRow> rows;
    Vector error(system_.constraint_count());
    double change = INFINITY;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      system_.set_positions(end_positions(past, u), state);
      system_.set_velocities(u, state);
      system_.constraints(state, rows);
      for (Index i = 0; i < error.size(); ++i) error[i] = rows[static_cast<std::size_t>(i)].value;
      const double gap = error.size() == 0 ? 0 : error.cwiseAbs().maxCoeff();
      if (gap <= kMaxConstraintError && change <= kMaxVelocityChange * (1 + u.cwiseAbs().maxCoeff())) return;
      const Matrix jacobian = system_.jacobian(rows, state);
      const Vector response = system_.scaled(jacobian).rowwise().squaredNorm();
      const Vector penalty = kPenalty / (past.weight * past.weight) * response.cwiseInverse();
      // The error of the initial guess is no error of the multipliers, which are those of the last step.
      if (iteration > 0) multipliers_ += penalty.cwiseProduct(error);
      const Vector missing =
          past.weight * (system_.all_forces(state, torques) -
                         jacobian.transpose() * (multipliers_ + penalty.cwiseProduct(error))) -
          system_.times_mass(u - past.u);
      const Matrix stiff = implicit_mass(system_, state, past.weight, past.weight) +
                           past.weight * past.weight * jacobian.transpose() * penalty.asDiagonal() * jacobian;
      const Vector step = stiff.partialPivLu().solve(missing);
      u += step;
      change = step.cwiseAbs().maxCoeff();
      if (!std::isfinite(change)) break;
    }
    Index worst = 0;
    if (error.size() > 0) error.cwiseAbs().maxCoeff(&worst);
    throw Error(PhysicsFault{
        state.time, error.size() > 0 ? system_.joint_of_row(worst).name : system_.body_name(0),
        "joint gap [m or rad]",
        fmt::format(
            "{:g} after {} iterations, in the last of which velocities changed by {:g}: use a smaller step",
            error.size() > 0 ? std::abs(error[worst]) : 0.0, kMaxIterations, change)});
  }

  System system_;
  bool has_last_ = false;
  Vector last_x_, last_u_;  ///< positions and velocities one step before the state
  double last_step_ = 0;    ///< [s]
  Vector multipliers_;
};

}  // namespace

std::unique_ptr<Integrator> make_penalty(System system) {
  return std::make_unique<Penalty>(std::move(system));
}

}  // namespace handsim::engine::dae
