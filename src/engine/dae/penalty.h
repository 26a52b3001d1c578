// Augmented Lagrangian with second-order backward differences at a fixed step (Bayo & Ledesma 1996,
// Nonlinear Dyn 9:113). At the end of each step, with h' = 2h/3 and the hats made of the last two states,
//   x = T-step from x_hat by h' u,   M (u - u_hat) = h' (f - G^T (lambda + alpha g)),
// is solved by Newton's method; each iteration makes lambda += alpha g, until g is closed. Velocities are
// then projected onto the constraints. Second order; the first step after a start is implicit Euler.
//
// alpha = kPenalty / (h'^2 G M^-1 G^T) per row: a plain number says how much stiffer a joint is than the
// inertia it holds within a step, whatever the bodies weigh. Redundant rows share the load.
#pragma once

#include "handsim/engine/dae/integrator.h"

namespace handsim::engine::dae {

class Penalty final : public Integrator {
 public:
  explicit Penalty(System system);
  void start(model::State& state) override;
  void advance(std::span<const double> torques, double end, model::State& state) override;
  void save(ArchiveWriter& out) const override;
  void restore(const model::State& state, ArchiveReader& in) override;

 private:
  /// What a backward difference takes from the past, and the weight [s] of the present.
  struct Past {
    Vector x, u;
    double weight = 0;
  };
  template <class Archive, class Self>
  static void carry(Archive& archive, Self& self);
  Past past(const model::State& state, double step) const;
  /// x_hat + weight T(x) u, solved for x.
  Vector end_positions(const Past& past, const Vector& u) const;
  void close(const Past& past, std::span<const double> torques, model::State& state);

  System system_;
  bool has_last_ = false;
  Vector last_x_, last_u_;  ///< one step before the state
  double last_step_ = 0;    ///< [s]
  Vector multipliers_;
};

}  // namespace handsim::engine::dae
