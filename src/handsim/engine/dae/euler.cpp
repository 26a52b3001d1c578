// Linearised implicit Euler at velocity level, with the two methods of Chrono (Tasora et al. 2016) that keep
// the joints closed. G, g and the forces are those at the start of the step; h is its size, + marks its end:
//   (M - h df/du - h^2 df/dx T) u+ = M u + h (f - df/du u) + G^T P,   G u+ = -(erp / h) g - g_t,
//   x+ = x displaced by h u+.
// The derivatives are those of spring-dampers and gyroscopic torques. `euler_linearised` reduces gaps by the
// share `erp` a step; `euler_projected` has erp = 0 and projects x+ onto the constraints. Both: first order.
#include <algorithm>

#include <fmt/format.h>

#include "handsim/core/least_squares.h"
#include "handsim/engine/dae/euler.h"
#include "handsim/engine/multibody/projection.h"

namespace handsim::engine::dae {

namespace {

/// Relative singular value below which scaled constraint rows count as redundant.
constexpr double kRankThreshold = 1e-12;
/// Largest share of a step's displacement that the projection may undo; smooth motion: half the step's turn.
constexpr double kMaxUndone = 0.9;
constexpr double kMinDisplacement = 1e-9;  ///< Displacements below this are rounding errors [m].

/// Solves A u = b + G^T P, G u = r for u. P is the minimum-norm solution if rows of G are linearly dependent.
Vector solve_constrained(const Matrix& mass, const Vector& momentum, const Matrix& jacobian,
                         const Vector& r) {
  const Eigen::PartialPivLU<Matrix> factors(mass);
  Vector free = factors.solve(momentum);
  if (r.size() == 0) return free;
  const Matrix response = factors.solve(jacobian.transpose());
  const Matrix schur = jacobian * response;
  // Rows have different units: the scale makes the diagonal of the Schur complement 1.
  const Vector scale = schur.diagonal().cwiseAbs().cwiseSqrt().cwiseInverse();
  const LeastSquares scaled(scale.asDiagonal() * schur * scale.asDiagonal(), kRankThreshold);
  const Vector impulses = scaled.solve(scale.cwiseProduct(r - jacobian * free));
  free += response * scale.cwiseProduct(impulses);
  return free;
}

class Euler final : public Integrator {
 public:
  Euler(System system, const Settings& settings)
      : system_(std::move(system)),
        projected_(settings.dae().method == DaeMethod::euler_projected),
        erp_(projected_ ? 0 : settings.erp()) {}

  void reset(model::State& state) override {
    if (projected_) project_positions(system_, state);
  }

  void advance(std::span<const double> torques, double end, model::State& state) override {
    model::State now = state;
    const double step = end - state.time;
    system_.set_driven_velocities(end, step, now);
    const Vector u = next_velocities(now, torques, step);
    system_.displace(step * u, now);
    system_.set_velocities(u, now);
    if (projected_) {
      now.time = end;
      system_.place_driven(end, model::KeySide::before, now);
      const model::State free = now;
      project_positions(system_, now);
      check_displacement(free, state, end, now);
      // The projection rotates the bodies; u has angular velocities in body axes.
      system_.set_velocities(u, now);
    }
    system_.copy_bodies(now, state);
  }

  // The next step depends only on the state.
  void save(ArchiveWriter& /*out*/) const override {}
  void restore(const model::State& /*state*/, ArchiveReader& /*in*/) override {}

 private:
  /// Rejects steps that the projection undoes almost completely: the joints allow these velocities but no
  /// finite motion (a fully stretched four-bar linkage). @param free the step's end before the projection
  void check_displacement(const model::State& free, const model::State& before, double end,
                          const model::State& closed) const {
    const Vector x0 = system_.positions(before), x1 = system_.positions(free), x2 = system_.positions(closed);
    double moved = 0, undone = 0;
    Index worst = 0;
    for (Index i = 0; i < system_.body_count(); ++i) {
      moved = std::max(moved, (x1 - x0).segment<3>(kPoseSize * i).norm());
      const double correction = (x2 - x1).segment<3>(kPoseSize * i).norm();
      if (correction > undone) undone = correction, worst = i;
    }
    if (undone <= kMaxUndone * moved || undone <= kMinDisplacement) return;
    throw Error(PhysicsFault{end, system_.body_name(worst), "displacement in a step [m]",
                             fmt::format("closing the joints undoes {:.3g} of {:.3g}: the joints are "
                                         "singular here, or the step is too large",
                                         undone, moved)});
  }

  /// u+ from a state in which driven bodies have the velocities of their drives.
  Vector next_velocities(const model::State& state, std::span<const double> torques, double step) const {
    const Vector u = system_.velocities(state);
    Vector force = system_.forces(state, torques);
    // f - df/du u of the gyroscopic torques f = -w x I w, which are quadratic in u: -f.
    for (Index i = 0; i < system_.body_count(); ++i) {
      const Vec3 w = u.segment<3>(kTwistSize * i + 3);
      force.segment<3>(kTwistSize * i + 3) += 2 * w.cross(system_.inertia(i) * w);
    }
    // The force of a spring-damper is k (q + h q'+) + c q'+; the share of driven bodies in q'+ is known.
    for (const TissueRow& each : system_.tissue(state)) {
      const double known = rate(each.row, state) - system_.own_rate(each.row, u, state);
      const double implicit = each.tissue.damping + step * each.tissue.stiffness;
      system_.add_transposed(each.row, -each.tissue.stiffness * each.deviation - implicit * known, state,
                             force);
    }
    std::vector<ConstraintRow> rows;
    system_.constraints(state, rows);
    Vector wanted(static_cast<Index>(rows.size()));
    for (Index i = 0; i < wanted.size(); ++i) {
      const ConstraintRow& row = rows[as_index(i)];
      wanted[i] = -erp_ / step * row.value - (rate(row, state) - system_.own_rate(row, u, state));
    }
    return solve_constrained(implicit_mass(system_, state, step, step), system_.times_mass(u) + step * force,
                             system_.jacobian(rows, state), wanted);
  }

  System system_;
  bool projected_;
  double erp_;
};

}  // namespace

std::unique_ptr<Integrator> make_euler(System system, const Settings& settings) {
  return std::make_unique<Euler>(std::move(system), settings);
}

Matrix implicit_mass(const System& system, const model::State& state, double a, double b) {
  Matrix out = system.mass_matrix();
  const Vector u = system.velocities(state);
  for (Index i = 0; i < system.body_count(); ++i) {
    // d(w x I w) = ([w] I - [I w]) dw.
    const Vec3 w = u.segment<3>(kTwistSize * i + 3);
    const Mat3& inertia = system.inertia(i);
    out.block<3, 3>(kTwistSize * i + 3, kTwistSize * i + 3) +=
        a * (cross_matrix(w) * inertia - cross_matrix(inertia * w));
  }
  Vector row(u.size());
  for (const TissueRow& each : system.tissue(state)) {
    row.setZero();
    system.add_transposed(each.row, 1, state, row);
    out += a * (each.tissue.damping + b * each.tissue.stiffness) * row * row.transpose();
  }
  return out;
}

}  // namespace handsim::engine::dae
