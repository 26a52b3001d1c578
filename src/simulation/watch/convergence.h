// How well the solver has solved, over a run: what it said of itself and what was measured of it, and what of
// that is bad enough to be told.
#pragma once

#include <string>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/simulation/watch/ledger.h"
#include "handsim/simulation/watch/monitor.h"

namespace handsim::simulation {

class Convergence {
 public:
  explicit Convergence(const model::Model& model) : model_(model) {}

  /// Takes in what a step that ends at a time [s] reported.
  void look(const engine::StepReport& report, double time);
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

  /// Steps whose residual was measured: quick_step's with contact, those at which a stop comes into force or
  /// goes out of it and every eighth of the others (engine::kResidualEvery); those in which world_step's LCP
  /// solver gave up; and those with contact on the articulated engine, whose contact solver says how far it
  /// got.
  long measured() const { return measured_; }
  /// Steps in which Newton's method did not find Coulomb's law, and friction's limits were updated from
  /// outside (articulated engine).
  long limit_steps() const { return limit_steps_; }
  /// Largest residuals of the measured steps: of joints [m/s] and [rad/s], and of rigid contacts [m/s].
  const Peak& linear() const { return linear_; }
  const Peak& angular() const { return angular_; }
  const Peak& contact() const { return contact_; }

  /// One sentence for each thing that is bad: LCP failures, steps that the guard could not mend, and
  /// residuals that, were they to stay, would hold a joint open by more than 0.1 mm or 5 mrad, or a contact
  /// in by 0.1 mm (residual times step over ERP).
  std::vector<std::string> warnings(const Ledger& ledger, const model::SolverSettings& solver) const;

 private:
  template <class Archive, class Self>
  static void carry(Archive& archive, Self& self);
  const model::Model& model_;
  long measured_ = 0, limit_steps_ = 0;
  Peak linear_, angular_, contact_;
};

}  // namespace handsim::simulation
