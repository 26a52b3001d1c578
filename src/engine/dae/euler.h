// Linearised implicit Euler at velocity level, with the two ways of Chrono (Tasora et al. 2016) to keep
// joints together. With all of G, g and forces at the start of the step (h its size, + its end):
//   (M - h df/du - h^2 df/dx T) u+ = M u + h (f - df/du u) + G^T P,   G u+ = -(erp / h) g - g_t,
//   x+ = x moved by h u+,
// where spring-dampers and gyroscopic torques make up the derivatives. `euler_linearised` pulls gaps back by
// `erp` a step; `euler_projected` has erp = 0 and moves x+ onto the constraints. First order both.
#pragma once

#include "handsim/engine/dae/integrator.h"

namespace handsim::engine::dae {

class Euler final : public Integrator {
 public:
  Euler(System system, const Settings& settings);
  void start(model::State& state) override;
  void advance(std::span<const double> torques, double end, model::State& state) override;
  // Depends on the state alone.
  void save(ArchiveWriter& /*out*/) const override {}
  void restore(const model::State& /*state*/, ArchiveReader& /*in*/) override {}

 private:
  /// u+ at the state with driven bodies already aimed.
  Vector next_velocities(const model::State& state, std::span<const double> torques, double step) const;
  void check_way(const model::State& free, const model::State& before, double end,
                 const model::State& closed) const;

  System system_;
  bool projected_;
  double erp_;
};

}  // namespace handsim::engine::dae
