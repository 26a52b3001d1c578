// Linearised implicit Euler at velocity level, with the two ways of Chrono (Tasora et al. 2016) to keep
// joints together. With all of G, g and forces at the start of the step (h its size, + its end):
//   (M - h df/du - h^2 df/dx T) u+ = M u + h (f - df/du u) + G^T P,   G u+ = -(erp / h) g - g_t,
//   x+ = x moved by h u+,
// where spring-dampers and gyroscopic torques make up the derivatives. `euler_linearised` pulls gaps back by
// `erp` a step; `euler_projected` has erp = 0 and moves x+ onto the constraints. First order both.
#include <algorithm>

#include <fmt/format.h>

#include "handsim/engine/dae/integrator.h"
#include "handsim/engine/multibody/projection.h"

namespace handsim::engine::dae {

namespace {

/// Relative size below which a combination of scaled constraint rows counts as redundant.
constexpr double kRankThreshold = 1e-12;
/// A step's way that closing the joints may take back, as a share. In smooth motion it is half the angle that
/// bodies turn by in the step. Shorter ways are rounding [m].
constexpr double kMostTakenBack = 0.9, kLeastWay = 1e-9;

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

class Euler final : public Integrator {
 public:
  Euler(System system, const Settings& settings)
      : system_(std::move(system)),
        projected_(settings.dae().method == DaeMethod::euler_projected),
        erp_(projected_ ? 0 : settings.erp()) {}

  void start(model::State& state) override {
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
      check_way(free, state, end, now);
      // Turned by the projection, the velocities keep their components in body axes.
      system_.set_velocities(u, now);
    }
    system_.copy_bodies(now, state);
  }

  // Depends on the state alone.
  void save(ArchiveWriter& /*out*/) const override {}
  void restore(const model::State& /*state*/, ArchiveReader& /*in*/) override {}

 private:
  /// Where the joints take back most of the way that the velocities went, these mean nothing: the joints let
  /// the bodies start to move, and no further (a four-bar pulled straight).
  /// @param free the step's end before the joints were closed
  void check_way(const model::State& free, const model::State& before, double end,
                 const model::State& closed) const {
    const Vector x0 = system_.positions(before), x1 = system_.positions(free), x2 = system_.positions(closed);
    double way = 0, back = 0;
    Index worst = 0;
    for (Index i = 0; i < system_.body_count(); ++i) {
      way = std::max(way, (x1 - x0).segment<3>(kPoseSize * i).norm());
      const double taken = (x2 - x1).segment<3>(kPoseSize * i).norm();
      if (taken > back) back = taken, worst = i;
    }
    if (back <= kMostTakenBack * way || back <= kLeastWay) return;
    throw Error(
        PhysicsFault{end, system_.body_name(worst), "way of a step [m]",
                     fmt::format("{:.3g} of {:.3g} is taken back to close the joints: they are singular "
                                 "here, or the step is too large",
                                 back, way)});
  }

  /// u+ at the state, in which driven bodies have the velocities of their drives.
  Vector next_velocities(const model::State& state, std::span<const double> torques, double step) const {
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

  System system_;
  bool projected_;
  double erp_;
};

}  // namespace

std::unique_ptr<Integrator> make_euler(System system, const Settings& settings) {
  return std::make_unique<Euler>(std::move(system), settings);
}

}  // namespace handsim::engine::dae
