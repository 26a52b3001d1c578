// Muscles and bands within the step of an engine. A tension at the step's end depends on the rates u+
// that the step finds: F = F(l0 + h l', l'), linear about the start. The generalised torques are
//   tau = start - B (u+ - u0),   B = sum over tendons of (h dF/dl + dF/dl') r r^T,
// with the moment arms r at the start. An engine solves them together with its motion: with B itself, or with
// a diagonal that exceeds it (row sums of |B|), which is stable at any step and exact at rest, and less exact
// in fast motion. Activations go one step by their own law before. With an elastic tendon F is the tension
// with which fibres and tendon pull alike at the end (model/elastic_lanes.h), and the fibres' length is a
// state. No engine's types.
#pragma once

#include <span>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/engine/tendon_layout.h"

namespace handsim::engine {

class Muscles {
 public:
  /// The model must outlive this object. @param solves an entry of B; what an engine does not solve is
  /// bounded by the diagonal. @param kernel null: the fastest
  Muscles(const model::Model& model, const Settings& settings, const TendonLayout::Solves& solves,
          const TendonKernel* kernel = nullptr);

  /// True where neither effect has anything to do.
  bool empty() const { return layout_.arrays().blocks == 0; }
  /// Sets activations, and fibre lengths of muscles with elastic tendons, to those of a state.
  void reset(const model::State& state);
  /// Computes activations at the end of a step, and tensions at the rates of its start and the lengths to
  /// which these lead. @param q, u by Model::dof_count()
  void begin_step(std::span<const double> q, std::span<const double> u, std::span<const double> excitations);
  /// Undoes the last `begin_step`, at most once, where its step was not made.
  void restore_step();
  /// `start` of the torques, by Model::dof_count() [N m].
  std::span<const double> torques() const { return torques_; }
  /// An entry of B, row >= column [N m s].
  struct Slope {
    int row = 0, column = 0;
    double value = 0;
  };
  /// The part of B that the engine solves, all rows by columns, with the bound of the rest on its diagonal.
  std::span<const Slope> slopes() const { return slopes_; }
  /// For an engine that solves the diagonal only: torques + damping u- of each coordinate, with which
  /// `tau = out - damping u+` is the law above, and that damping, by Model::dof_count() [N m s/rad].
  void by_coordinate(std::span<const double> u, std::span<const double> given, std::vector<double>& torques,
                     std::vector<double>& damping) const;
  /// Writes activations, fibre lengths and tensions at the end of the step into a state. @param u rates at
  /// its end
  void store_state(std::span<const double> q, std::span<const double> u, model::State& state) const;

 private:
  /// A number among the lanes that is added to a torque or an entry of B.
  struct Part {
    const double* from = nullptr;
    std::size_t to = 0;
  };
  /// The start of a step: arguments of `begin_step`, and by lane activations, lengths of elastic fibres and
  /// stretches of cross-bridges.
  struct Start {
    std::vector<double> q, u, excitations, activations, fibres, bridges;
  };
  double* fibres(int block) const;
  double* bridges(int block) const;
  void pull(const Start& start);
  std::size_t slot(int a, int b);
  void collect_parts();
  double rate_at(const TendonLayout::Place& place, std::span<const double> u) const;
  void place_fibres(std::size_t muscle, std::span<const double> q, double rate, model::State& state) const;

  double step_;
  bool goes_on_ = false;  ///< `pull` was called since `reset` or `restore_step`
  std::span<const model::Muscle> muscles_;
  TendonLayout layout_;
  const TendonKernel* kernel_;
  std::vector<Slope> slopes_;
  std::vector<double> torques_;
  std::vector<Part> torque_parts_, slope_parts_;
  Start start_, before_;  ///< of the step, and of the one before it
  int begun_ = 0;         ///< how many of the two there are
};

}  // namespace handsim::engine
