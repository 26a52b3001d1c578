#include "handsim/engine/dae/euler.h"

#include "handsim/engine/dae/implicit.h"
#include "handsim/engine/multibody/projection.h"

namespace handsim::engine::dae {

namespace {

/// Relative size below which a combination of scaled constraint rows counts as redundant.
constexpr double kRankThreshold = 1e-12;

/// Solves A u = b + G^T P, G u = r for u, with P the shortest where G's rows depend on each other.
Vector solve_constrained(const Matrix& mass, const Vector& momentum, const Matrix& jacobian,
                         const Vector& r) {
  const Eigen::PartialPivLU<Matrix> factors(mass);
  Vector free = factors.solve(momentum);
  if (r.size() == 0) return free;
  const Matrix response = factors.solve(jacobian.transpose());
  const Matrix schur = jacobian * response;
  // Rows have different units: scaled so that each responds to its own impulse by 1.
  const Vector scale = schur.diagonal().cwiseAbs().cwiseSqrt().cwiseInverse();
  Eigen::CompleteOrthogonalDecomposition<Matrix> decomposition;
  decomposition.setThreshold(kRankThreshold);
  decomposition.compute(scale.asDiagonal() * schur * scale.asDiagonal());
  const Vector impulses = decomposition.solve(scale.cwiseProduct(r - jacobian * free));
  free += response * scale.cwiseProduct(impulses);
  return free;
}

}  // namespace

Euler::Euler(System system, const Settings& settings)
    : system_(std::move(system)),
      projected_(settings.method == Method::euler_projected),
      erp_(projected_ ? 0 : settings.erp) {}

void Euler::start(model::State& state) {
  if (projected_) project_positions(system_, state);
}

void Euler::advance(std::span<const double> torques, double end, model::State& state) {
  model::State now = state;
  const double step = end - state.time;
  system_.aim_driven(end, step, now);
  const Vector u = next_velocities(now, torques, step);
  system_.displace(step * u, now);
  system_.set_velocities(u, now);
  if (projected_) {
    now.time = end;
    system_.place_driven(end, model::KeySide::before, now);
    project_positions(system_, now);
    // Turned by the projection, the velocities keep their components in body axes.
    system_.set_velocities(u, now);
  }
  system_.copy_bodies(now, state);
}

Vector Euler::next_velocities(const model::State& state, std::span<const double> torques, double step) const {
  const Vector u = system_.velocities(state);
  Vector force = system_.forces(state, torques);
  // f - df/du u of the gyroscopic torques, which are quadratic in u: -(-w x I w).
  for (Index i = 0; i < system_.body_count(); ++i) {
    const Vec3 w = u.segment<3>(kTwistSize * i + 3);
    force.segment<3>(kTwistSize * i + 3) += 2 * w.cross(system_.inertia(i) * w);
  }
  // A spring-damper pulls by k (q + h q'+) + c q'+; driven bodies' share of q'+ is known.
  for (const TissueRow& each : system_.tissue(state)) {
    const double known = rate(each.row, state) - system_.own_rate(each.row, u, state);
    const double implicit = each.tissue.damping + step * each.tissue.stiffness;
    system_.add_transposed(each.row, -each.tissue.stiffness * each.deviation - implicit * known, state,
                           force);
  }
  std::vector<Row> rows;
  system_.constraints(state, rows);
  Vector wanted(static_cast<Index>(rows.size()));
  for (Index i = 0; i < wanted.size(); ++i) {
    const Row& row = rows[static_cast<std::size_t>(i)];
    wanted[i] = -erp_ / step * row.value - (rate(row, state) - system_.own_rate(row, u, state));
  }
  return solve_constrained(implicit_mass(system_, state, step, step), system_.times_mass(u) + step * force,
                           system_.jacobian(rows, state), wanted);
}

}  // namespace handsim::engine::dae
