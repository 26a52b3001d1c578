// Which of ODE's two solvers is cheaper for the step at hand. The direct solver's cost grows with the cube of
// the rows of an island (bodies that are jointed or touch), the iterative one's with rows times iterations.
// The choice is by row counts and a cost measured once, not by the clock: runs repeat bit for bit.
#pragma once

#include <span>
#include <vector>

#include "handsim/engine/ode/joints.h"

namespace handsim::engine::ode {

/// Cost of an island of `rows` rows [ns], from bench_handsim's island_cost on an EPYC; only the ratio counts.
double world_step_cost(int rows);
double quick_step_cost(int rows, int iterations);

class MethodChoice {
 public:
  /// The model and the joints must outlive this.
  MethodChoice(const model::Model& model, const Joints& joints, const std::vector<OdeBody>& bodies,
               const Settings& settings);
  /// @return world_step or quick_step
  OdeMethod pick(std::span<const Contact> contacts);

 private:
  int root(int body);
  void join(int a, int b, int rows);

  const model::Model& model_;
  int iterations_;
  int rows_per_contact_;
  std::vector<bool> moves_;       ///< by body: takes part in islands
  std::vector<int> tree_;         ///< union-find over bodies that are jointed
  std::vector<int> tree_rows_;    ///< rows of the joints below each root
  std::vector<int> root_, rows_;  ///< the same with the contacts of a step
};

}  // namespace handsim::engine::ode
