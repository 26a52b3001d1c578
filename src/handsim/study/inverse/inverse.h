// Inverse dynamics of a recorded or programmed motion: the torques about every axis of the hands that make
// it, and a check: a simulation with these torques alone, which should return to the motion.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "handsim/control/motion_trajectory.h"
#include "handsim/core/units.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/study/inverse/undone.h"
#include "handsim/study/rollouts/rollouts_file.h"

namespace handsim::study {

/// RMS error over all axes of a check that returns to the motion [rad].
inline constexpr double kLargestCheckError = 1 * kDegree;
/// With muscles the check begins anew from the motion after each such time [s]: fingers that muscles hold can
/// be unstable in themselves, so that rounding grows without feedback (170 times in 60 ms in muscle_poses).
inline constexpr double kCheckWindow = 0.1;

struct InverseInput {
  /// Joint angles (.csv, .mot, .sto); absent: the programs of the scene's control.
  std::optional<std::filesystem::path> motion;
  control::MotionOptions options;  ///< names, clamping and cut-off of the low-pass for `motion`
  /// Forces from outside (loads.h), or the contacts.csv of a run.
  std::optional<std::filesystem::path> loads;
  bool forward = true;  ///< runs the check
  /// Finds activations of the muscles by static optimisation, each of at least so much (co-contraction).
  std::optional<double> least_activation;
};

/// Torques of one axis and its error in the check.
struct InverseAxis {
  std::string name;                                    ///< `right.index_mcp.flexion`
  std::size_t dof = 0;                                 ///< in vectors of model.dof_count()
  double largest_torque = 0;                           ///< |active| [N m]
  double rms_torque = 0;                               ///< of active [N m]
  std::optional<double> rms_error, largest_error;      ///< of the check; absent: not made [rad]
  std::optional<double> largest_reserve, rms_reserve;  ///< with activations [N m]
};

/// The motion and its torques at one step; all of size model.dof_count().
struct InverseRow {
  double time = 0;              ///< start of the step [s]
  std::vector<double> q;        ///< [rad]
  std::vector<double> moment;   ///< net torque that the motion needs [N m]
  std::vector<double> passive;  ///< part of passive tissue, resting muscles and bands [N m]
  std::vector<double> forward;  ///< angles of the check; empty without it [rad]
  // With activations; by muscle, and torque that the muscles leave undone [N m].
  std::vector<double> excitation, activation, reserve;

  /// The torque that muscles or motors give: moment - passive.
  double active(std::size_t dof) const { return moment[dof] - passive[dof]; }
};

struct InverseResult {
  std::vector<InverseAxis> axes;
  std::vector<InverseRow> rows;     ///< one for each step
  std::optional<double> cutoff;     ///< of the filter that was used [Hz]
  std::optional<double> rms_error;  ///< of the check over all axes and steps; absent: not made [rad]
  /// With activations: RMS of the reserves over that of the active torques, over all axes.
  std::optional<double> reserve_share;
  std::optional<Undone> undone;      ///< with activations: why
  std::optional<std::string> fault;  ///< why the check ended early
  std::vector<std::string> warnings;

  /// False where the check was made and did not return to the motion.
  bool agrees() const { return !fault && rms_error.value_or(0) <= kLargestCheckError; }
};

/// Angles are joined by a spline and differentiated at the step h of the scene's solver:
///   v_n = (q_n - q_{n-1}) / h,  a_n = (q_{n+1} - 2 q_n + q_{n-1}) / h^2,
/// the difference equations of a semi-implicit step, so that the torque of step n leads from q_n to q_{n+1}.
/// Passive tissue, resting muscles and bands act at the end of the step, as the engines solve them;
/// excitations of the scene do not count.
/// Activations give the torques with the least sum of squares (control::StaticOptimisation, tendons rigid);
/// excitations are those that lead there by the law of activation, within 0 to 1. What muscles with these
/// excitations leave undone, by the engines' own law, is the reserve. The check is driven by both.
/// @throws Error (input) for a scene without hands, with loops or free hands, and for files that do not fit.
InverseResult run_inverse(const scene::Scene& scene, const InverseInput& input,
                          const std::function<void(double)>& progress = {});

/// A study of hands within what is uncertain of the scene's: torques, with activations these too, and their
/// bands. The check is left to the scene's own hand.
RolloutsSpec uncertain_inverse(const std::filesystem::path& scene, std::vector<std::string> overrides,
                               InverseInput input, int count);

}  // namespace handsim::study
