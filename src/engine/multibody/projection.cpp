#include "handsim/engine/multibody/projection.h"

#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "handsim/core/index.h"

namespace handsim::engine {

namespace {

constexpr int kMaxCorrections = 50;
/// Rows whose independent part is smaller than this, relative to the largest, count as redundant.
constexpr double kRankThreshold = 1e-8;
/// Relative shift of the rows' own response that keeps redundant rows solvable: small beside any row that is
/// independent, large beside rounding.
constexpr double kRedundantShift = 1e-10;

/// Of the accelerations that joints ask for at the start, the share that may be beyond all forces;
/// differences that stand for derivatives are right to 1e-6 of it. Less than the second is rounding [m/s^2 or
/// rad/s^2].
constexpr double kMostLeft = 1e-3, kLeastLeft = 1e-6;
/// Velocities below this do not show where a start moves to [m/s, rad/s].
constexpr double kAtRest = 1e-9;

using Decomposition = Eigen::CompleteOrthogonalDecomposition<Matrix>;

Decomposition decompose(const Matrix& jacobian) {
  Decomposition out;
  out.setThreshold(kRankThreshold);
  out.compute(jacobian);
  return out;
}

Vector values(const std::vector<Row>& rows) {
  Vector out(static_cast<Index>(rows.size()));
  for (Index i = 0; i < out.size(); ++i) out[i] = rows[at(i)].value;
  return out;
}

Vector rates(const std::vector<Row>& rows, const model::State& state) {
  Vector out(static_cast<Index>(rows.size()));
  for (Index i = 0; i < out.size(); ++i) out[i] = rate(rows[at(i)], state);
  return out;
}

/// Rounding grows with the coordinates.
double whole(const System& system, const model::State& state) {
  return kWhole * std::max(1.0, system.positions(state).cwiseAbs().maxCoeff());
}

[[noreturn]] void throw_open_joint(const System& system, const model::State& state, const Vector& error) {
  Index worst = 0;
  const double value = error.cwiseAbs().maxCoeff(&worst);
  throw Error(PhysicsFault{
      state.time, system.joint_of_row(worst).name, "joint gap [m or rad]",
      fmt::format("{:g} is left and cannot be closed: the joints contradict each other here, or the step is "
                  "too large",
                  value)});
}

/// Corrects the state until the joints are closed. @throws Error (physics) naming a joint that stays apart.
template <class Correct>
void close_joints(const System& system, const model::State& state, Correct correct) {
  std::vector<Row> rows;
  rows.reserve(static_cast<std::size_t>(system.constraint_count()));
  double last = INFINITY;
  for (int i = 0;; ++i) {
    system.constraints(state, rows);
    const Vector error = values(rows);
    const double largest = error.cwiseAbs().maxCoeff();
    if (i < kMaxCorrections && largest <= whole(system, state)) return;
    // Written so that NaN fails. Slow progress from afar is fine, none near the end is not.
    if (i == kMaxCorrections || !(largest < last || i < kMaxCorrections / 2))
      throw_open_joint(system, state, error);
    last = largest;
    correct(rows, error);
  }
}

/// d(G u + g_t)/dt at constant u: the change of the rates without accelerations. Central
/// difference along the motion; its error is (turning speed x interval)^2 of the value.
Vector rate_drift(const System& system, const model::State& state, const Vector& u,
                  const std::vector<Index>& rows) {
  const double interval = 1e-4 / (1 + u.cwiseAbs().maxCoeff());
  const auto rates_at = [&](double shift) {
    model::State moved = state;
    // Just after the state's time, also at a keyframe: drives have no accelerations to remember.
    system.place_driven(state.time + shift, model::KeySide::after, moved);
    system.displace(shift * u, moved);
    system.set_velocities(u, moved);
    std::vector<Row> all;
    system.constraints(moved, all);
    Vector out(static_cast<Index>(rows.size()));
    for (Index i = 0; i < out.size(); ++i)
      out[i] = rate(all[static_cast<std::size_t>(rows[static_cast<std::size_t>(i)])], moved);
    return out;
  };
  // One-sided of second order, so that only what comes after the state counts.
  return (4 * rates_at(interval) - 3 * rates_at(0) - rates_at(2 * interval)) / (2 * interval);
}

Matrix scaled_jacobian(const System& system, const model::State& state) {
  std::vector<Row> rows;
  system.constraints(state, rows);
  return system.scaled(system.jacobian(rows, state));
}

/// Rows of a matrix, each made of length 1: units of different rows do not compare.
Matrix unit_rows(Matrix matrix) {
  for (Index i = 0; i < matrix.rows(); ++i) matrix.row(i).normalize();
  return matrix;
}

}  // namespace

void project_positions(const System& system, model::State& state) {
  if (system.constraint_count() == 0) return;
  close_joints(system, state, [&](const std::vector<Row>& rows, const Vector& error) {
    const Matrix scaled = system.scaled(system.jacobian(rows, state));
    system.displace(system.from_scaled(decompose(scaled).solve(-error)), state);
  });
}

void project_velocities(const System& system, model::State& state) {
  if (system.constraint_count() == 0) return;
  std::vector<Row> rows;
  system.constraints(state, rows);
  const Decomposition scaled = decompose(system.scaled(system.jacobian(rows, state)));
  // Twice, for the last digits.
  for (int i = 0; i < 2; ++i)
    system.set_velocities(system.velocities(state) - system.from_scaled(scaled.solve(rates(rows, state))),
                          state);
}

void close_step(const System& system, const model::State& before, double step, model::State& after) {
  if (system.constraint_count() == 0) return;
  std::vector<Row> rows;
  rows.reserve(at(system.constraint_count()));
  system.constraints(before, rows);
  // One factorisation serves all corrections: the directions of the impulses are those of `before` anyway,
  // and within a step joints turn little. The shift makes redundant rows share; it slows, but does not bend.
  const Matrix scaled = system.scaled(system.jacobian(rows, before));
  Matrix gram = scaled * scaled.transpose();
  gram.diagonal() *= 1 + kRedundantShift;
  const Eigen::LLT<Matrix> factors(gram);
  close_joints(system, after, [&](const std::vector<Row>&, const Vector& error) {
    system.push(system.from_scaled(-(scaled.transpose() * factors.solve(error))), before, step, after);
  });
}

void require_regular_start(const model::Model& model, const Settings& settings, const model::State& start) {
  std::vector<Problem> problems;
  for (const System& island : islands(model, settings)) {
    if (island.constraint_count() == 0) continue;
    model::State state = start;
    project_velocities(island, state);
    if (island.velocities(state).norm() <= kAtRest) {
      // Where it is about to move.
      island.set_velocities(island.over_mass(island.all_forces(state, {})), state);
      project_velocities(island, state);
      const Vector u = island.velocities(state);
      if (u.norm() <= kAtRest) continue;
      island.set_velocities(u / u.norm(), state);
    }
    std::vector<Index> all(at(island.constraint_count()));
    std::iota(all.begin(), all.end(), Index{0});
    const Vector drift = rate_drift(island, state, island.velocities(state), all);
    std::vector<Row> rows;
    island.constraints(state, rows);
    const Matrix scaled = island.scaled(island.jacobian(rows, state));
    const Vector left = drift - scaled * decompose(scaled).solve(drift);
    Index worst = 0;
    const double most = left.cwiseAbs().maxCoeff(&worst);
    if (most <= kMostLeft * drift.cwiseAbs().maxCoeff() || most <= kLeastLeft) continue;
    problems.push_back(
        {std::nullopt, island.joint_of_row(worst).name,
         fmt::format("joints that let the bodies start to move and no further: {:.3g} m/s^2 or rad/s^2 of "
                     "their acceleration that no force can bring about",
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
  std::vector<Row> all;
  system.constraints(state, all);
  const Matrix jacobian = system.jacobian(all, state)(rows, Eigen::all);
  const Matrix scaled = system.scaled(jacobian);
  const Vector missing =
      -rate_drift(system, state, system.velocities(state), rows) - jacobian * out.acceleration;
  // z is what the joints add in scaled accelerations, and the multipliers make it: W^T lambda = -z.
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
