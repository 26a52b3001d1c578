// Variable-order BDF on the stabilised index-2 form: the reference formulation.
//
// Gear, Gupta & Leimkuhler (1985, J Comput Appl Math 12:77) keep positions and velocities on the constraints
// with a second set of multipliers mu:
//   x' = T(x) (u + M^-1 G^T mu),  u' = M^-1 (f - G^T lambda),  g = 0,  G u + g_t = 0,
// where mu = 0 in the exact solution. lambda and mu enter as rates of impulses, lambda = Lambda' and
// mu = Mu' (Gear 1988, SIAM J Sci Stat Comput 9:39): that makes the index 1, and lets the step's size scale
// the multipliers' columns of the Newton matrix as it does those of the motion.
#pragma once

#include <memory>
#include <vector>

#include "handsim/engine/dae/ida.h"
#include "handsim/engine/dae/integrator.h"

namespace handsim::engine::dae {

class Gear final : public Integrator {
 public:
  Gear(System system, const Settings& settings);
  void start(model::State& state) override;
  /// The integrator runs on from step to step; it starts anew where torques change, at keyframes of drives,
  /// and where other constraint rows have become the better choice.
  void advance(std::span<const double> torques, double end, model::State& state) override;
  /// The integrator's memory is its past since it last started anew: that start and the ends of the steps
  /// since.
  void save(ArchiveWriter& out) const override;
  /// Integrates over that past again.
  void restore(const model::State& state, ArchiveReader& in) override;

 private:
  void restart(const model::State& state);
  void read(const Vector& y, double time, model::KeySide side, model::State& state) const;
  void residual(double t, const Vector& y, const Vector& slope, Vector& out);
  /// out += G^T multipliers.
  Vector joint_force(const Vector& multipliers) const;
  [[noreturn]] void fail(const IdaFailure& failure) const;

  System system_;
  double tolerance_;
  std::vector<double> torques_;
  std::vector<Index> rows_;  ///< the independent ones
  double weakest_ = 1;       ///< how independent they were when chosen
  double limit_ = 0;         ///< next keyframe [s]
  double step_;              ///< of the engine [s]
  model::State origin_;      ///< where the integrator last started anew
  double first_end_ = 0;     ///< of the first step since [s]
  long ends_ = 0;            ///< steps since
  std::unique_ptr<Ida> ida_;
  model::State scratch_;  ///< the residual's
  std::vector<Row> scratch_rows_;
};

}  // namespace handsim::engine::dae
