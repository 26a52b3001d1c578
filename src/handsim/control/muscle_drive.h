// Excitations of muscles: from a table over time, or from joint torques by static optimisation: activations
// 0..1 of the least sum of squares that give the torques (Crowninshield & Brand 1981, J Biomech 14:793).
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "handsim/control/motion_file.h"
#include "handsim/core/archive.h"
#include "handsim/model/actuation.h"
#include "handsim/model/state.h"

namespace handsim::control {

/// The source of excitations: a table, or the controller's torques.
struct MusclePlan {
  std::shared_ptr<const MotionTable> table;         ///< null: torques
  std::vector<std::optional<std::size_t>> columns;  ///< of the table, for each muscle; absent: 0 at all times
};

/// @throws nothing; columns that name no muscle are problems, with the nearest one.
MusclePlan table_plan(const model::Model& model, MotionTable table, Diagnostics& diagnostics);

/// Smallest activations for torques, in a model at a state. A muscle has no less than what reaches it of the
/// others' activations (model::Spill).
class StaticOptimisation {
 public:
  /// The model must outlive this object. @param dofs whose torques count. @param least activation:
  /// co-contraction
  StaticOptimisation(const model::Model& model, std::vector<std::size_t> dofs, double least = 0);

  /// Activations, as Model::muscles. @param torques by Model::dof_count() [N m]
  /// @param rested the torques are without what the muscles pull at rest, and a muscle counts with what it
  ///        gives at the activation found, not at full activation: at speed these differ
  std::span<const double> solve(const model::State& state, std::span<const double> torques,
                                bool rested = false);
  /// Torques that the activations of the last `solve` leave undone, by `dofs` [N m].
  std::span<const double> missing() const { return {missing_.data(), as_index(missing_.size())}; }
  /// The bounds that the next `solve` starts from: it has the same bits only with these.
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

 private:
  void assemble(const model::State& state, std::span<const double> torques, bool rested, bool again);
  void minimise();
  bool tie();
  double reaches(const model::Spill& spill) const;
  void reduce();

  const model::Model& model_;
  double least_;
  bool spills_ = false;                    ///< a muscle of the model has spills
  std::vector<const model::Spill*> tied_;  ///< what each muscle has exactly; null: it has more
  std::vector<std::size_t> dofs_;
  std::vector<std::optional<Eigen::Index>> row_;  ///< of each coordinate; absent: does not count
  Eigen::MatrixXd arms_;                          ///< torque per activation [N m], dofs by muscles
  Eigen::VectorXd wanted_, missing_, activation_;
  Eigen::VectorXd most_;       ///< activation of each muscle (model::Muscle::effort)
  Eigen::MatrixXd Q_, own_Q_;  ///< own: before muscles are tied
  Eigen::VectorXd c_, own_c_;
  std::vector<signed char> bound_;  ///< -1 at 0, 1 at the most, 0 between: kept from solve to solve
  std::vector<double> out_;
};

/// Computes the excitations of the muscles of a scene.
class MuscleDrive {
 public:
  /// All arguments must outlive this object. @param dofs that the controller drives
  MuscleDrive(const model::Model& model, const MusclePlan& plan, std::vector<std::size_t> dofs, double step);

  bool takes_torques() const { return optimisation_.has_value(); }
  /// Excitations of the step from a state. @param torques, servos drive muscles, not motors; may be empty
  std::span<const double> excitations(const model::State& state, std::span<const double> torques,
                                      std::span<const model::Servo> servos);
  void save(ArchiveWriter& out) const {
    if (optimisation_) optimisation_->save(out);
  }
  void restore(ArchiveReader& in) {
    if (optimisation_) optimisation_->restore(in);
  }

 private:
  void from_table(double time);

  const MusclePlan& plan_;
  std::optional<StaticOptimisation> optimisation_;
  double step_;
  std::vector<double> torques_, excitations_;
};

}  // namespace handsim::control
