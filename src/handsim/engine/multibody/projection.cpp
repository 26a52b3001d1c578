#include "handsim/engine/multibody/projection.h"

#include <cmath>
#include <numeric>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "handsim/core/least_squares.h"

namespace handsim::engine {

namespace {

constexpr int kMaxCorrections = 50;
/// Relative size below which the independent part of a row counts as zero.
constexpr double kRankThreshold = 1e-8;
/// Relative shift of the diagonal of G M^-1 G^T for redundant rows: below independent rows, above rounding.
constexpr double kRedundantShift = 1e-10;

/// Largest share of the joint accelerations at the start without a force; finite differences err by 1e-6.
constexpr double kMaxUnreachable = 1e-3;
/// Accelerations below this are rounding errors [m/s^2 or rad/s^2].
constexpr double kMinUnreachable = 1e-6;
constexpr double kAtRest = 1e-9;  ///< Velocities below this have no usable direction [m/s, rad/s].

LeastSquares decompose(const Matrix& jacobian) { return {jacobian, kRankThreshold}; }

Vector values(const std::vector<ConstraintRow>& rows) {
  Vector out(static_cast<Index>(rows.size()));
  for (Index i = 0; i < out.size(); ++i) out[i] = rows[as_index(i)].value;
  return out;
}

Vector rates(const std::vector<ConstraintRow>& rows, const model::State& state) {
  Vector out(static_cast<Index>(rows.size()));
  for (Index i = 0; i < out.size(); ++i) out[i] = rate(rows[as_index(i)], state);
  return out;
}

/// Largest constraint error of closed joints: rounding errors grow with the coordinates.
double closed_error(const System& system, const model::State& state) {
  return kMaxClosedError * std::max(1.0, system.positions(state).cwiseAbs().maxCoeff());
}

[[noreturn]] void throw_open_joint(const System& system, const model::State& state, const Vector& error) {
  Index worst = 0;
  const double value = error.cwiseAbs().maxCoeff(&worst);
  throw Error(PhysicsFault{state.time, system.joint_of_row(worst).name, "joint gap [m or rad]",
                           fmt::format("{:g} remains and cannot be closed: the joints contradict each other "
                                       "here, or the step is too large",
                                       value)});
}

/// Calls `correct` until the joints are closed. @throws Error (physics) naming a joint that stays open.
template <class Correct>
void close_joints(const System& system, const model::State& state, Correct correct) {
  std::vector<ConstraintRow> rows;
  rows.reserve(as_index(system.constraint_count()));
  double last = INFINITY;
  for (int i = 0;; ++i) {
    system.constraints(state, rows);
    const Vector error = values(rows);
    const double largest = error.cwiseAbs().maxCoeff();
    if (i < kMaxCorrections && largest <= closed_error(system, state)) return;
    // The second half of the corrections must reduce the error. NaN fails the condition.
    if (i == kMaxCorrections || !(largest < last || i < kMaxCorrections / 2))
      throw_open_joint(system, state, error);
    last = largest;
    correct(rows, error);
  }
}

/// d(G u + g_t)/dt at constant u: the change of the rates without accelerations. A one-sided difference of
/// second order along the motion; its relative error is (angular speed x interval)^2.
Vector rate_drift(const System& system, const model::State& state, const Vector& u,
                  const std::vector<Index>& rows) {
  const double interval = 1e-4 / (1 + u.cwiseAbs().maxCoeff());
  const auto rates_at = [&](double shift) {
    model::State moved = state;
    // At a keyframe of a drive, the rates after it.
    system.place_driven(state.time + shift, model::KeySide::after, moved);
    system.displace(shift * u, moved);
    system.set_velocities(u, moved);
    std::vector<ConstraintRow> all;
    system.constraints(moved, all);
    return Vector(rates(all, moved)(rows));
  };
  // One-sided, because a keyframe of a drive can be at the state's time.
  return (4 * rates_at(interval) - 3 * rates_at(0) - rates_at(2 * interval)) / (2 * interval);
}

Matrix scaled_jacobian(const System& system, const model::State& state) {
  std::vector<ConstraintRow> rows;
  system.constraints(state, rows);
  return system.scaled(system.jacobian(rows, state));
}

/// The matrix with rows of length 1, because the rows have different units.
Matrix unit_rows(Matrix matrix) {
  for (Index i = 0; i < matrix.rows(); ++i) matrix.row(i).normalize();
  return matrix;
}

}  // namespace

void project_positions(const System& system, model::State& state) {
  if (system.constraint_count() == 0) return;
  close_joints(system, state, [&](const std::vector<ConstraintRow>& rows, const Vector& error) {
    const Matrix scaled = system.scaled(system.jacobian(rows, state));
    system.displace(system.from_scaled(decompose(scaled).solve(-error)), state);
  });
}

void project_velocities(const System& system, model::State& state) {
  if (system.constraint_count() == 0) return;
  std::vector<ConstraintRow> rows;
  system.constraints(state, rows);
  const LeastSquares scaled = decompose(system.scaled(system.jacobian(rows, state)));
  // The second pass removes rounding errors.
  for (int i = 0; i < 2; ++i)
    system.set_velocities(system.velocities(state) - system.from_scaled(scaled.solve(rates(rows, state))),
                          state);
}

void close_step(const System& system, const model::State& before, double step, model::State& after) {
  if (system.constraint_count() == 0) return;
  // One factorisation is enough: the impulses have the directions of `before`, joints rotate little a step.
  // The shift lets redundant rows share the impulse; it slows convergence and does not change the solution.
  const Matrix scaled = scaled_jacobian(system, before);
  Matrix gram = scaled * scaled.transpose();
  gram.diagonal() *= 1 + kRedundantShift;
  const Eigen::LLT<Matrix> factors(gram);
  close_joints(system, after, [&](const std::vector<ConstraintRow>&, const Vector& error) {
    system.displace_by_impulse(system.from_scaled(-(scaled.transpose() * factors.solve(error))), before, step,
                               after);
  });
}

void require_regular_start(const model::Model& model, const Settings& settings, const model::State& start) {
  std::vector<Problem> problems;
  for (const System& island : islands(model, settings)) {
    if (island.constraint_count() == 0) continue;
    model::State state = start;
    project_velocities(island, state);
    if (island.velocities(state).norm() <= kAtRest) {
      // At rest, test the direction in which the motion starts.
      island.set_velocities(island.over_mass(island.all_forces(state, {})), state);
      project_velocities(island, state);
      const Vector u = island.velocities(state);
      if (u.norm() <= kAtRest) continue;
      island.set_velocities(u / u.norm(), state);
    }
    std::vector<Index> all(as_index(island.constraint_count()));
    std::iota(all.begin(), all.end(), Index{0});
    const Vector drift = rate_drift(island, state, island.velocities(state), all);
    const Matrix scaled = scaled_jacobian(island, state);
    const Vector left = drift - scaled * decompose(scaled).solve(drift);
    Index worst = 0;
    const double most = left.cwiseAbs().maxCoeff(&worst);
    if (most <= kMaxUnreachable * drift.cwiseAbs().maxCoeff() || most <= kMinUnreachable) continue;
    problems.push_back({std::nullopt, island.joint_of_row(worst).name,
                        fmt::format("a singular start: the joints require an acceleration of {:.3g} m/s^2 or "
                                    "rad/s^2 that no force can produce",
                                    most),
                        "a start that is not singular"});
  }
  if (!problems.empty()) throw Error(std::move(problems));
}

Accelerations accelerations(const System& system, const model::State& state, std::span<const double> torques,
                            const std::vector<Index>& rows) {
  Accelerations out;
  out.acceleration = system.over_mass(system.all_forces(state, torques));
  out.multipliers = Vector::Zero(static_cast<Index>(rows.size()));
  if (rows.empty()) return out;
  std::vector<ConstraintRow> all;
  system.constraints(state, all);
  const Matrix jacobian = system.jacobian(all, state)(rows, Eigen::all);
  const Matrix scaled = system.scaled(jacobian);
  const Vector missing =
      -rate_drift(system, state, system.velocities(state), rows) - jacobian * out.acceleration;
  // z is the joints' part of the scaled accelerations; the multipliers follow from W^T lambda = -z.
  const Vector z = decompose(scaled).solve(missing);
  out.acceleration += system.from_scaled(z);
  out.multipliers = -Matrix(scaled.transpose()).colPivHouseholderQr().solve(z);
  return out;
}

std::vector<Index> independent_rows(const System& system, const model::State& state, double& weakest) {
  weakest = 1;
  if (system.constraint_count() == 0) return {};
  Eigen::ColPivHouseholderQR<Matrix> qr;
  qr.setThreshold(kRankThreshold);
  qr.compute(unit_rows(scaled_jacobian(system, state)).transpose());
  std::vector<Index> out;
  for (Index i = 0; i < qr.rank(); ++i) out.push_back(qr.colsPermutation().indices()[i]);
  weakest = std::abs(qr.matrixR()(qr.rank() - 1, qr.rank() - 1));
  return out;
}

double independence(const System& system, const model::State& state, const std::vector<Index>& rows) {
  if (rows.empty()) return 1;
  const Matrix chosen = unit_rows(scaled_jacobian(system, state)(rows, Eigen::all));
  const Eigen::ColPivHouseholderQR<Matrix> qr(chosen.transpose());
  return std::abs(qr.matrixR()(chosen.rows() - 1, chosen.rows() - 1));
}

}  // namespace handsim::engine
