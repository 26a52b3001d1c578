// How well the solver has solved, over a run: what it reports of itself, what is measured of it, and warnings
// of what is bad.
#pragma once

#include <array>

#include "handsim/simulation/watch/monitor.h"
#include "handsim/simulation/watch/watcher.h"

namespace handsim::simulation {

class Convergence final : public Watcher {
 public:
  explicit Convergence(const Watched& watched) : scene_(watched.scene) {}

  std::string_view name() const override { return "convergence"; }
  void update(Step& step) override;
  void save(ArchiveWriter& out) const override;
  void restore(ArchiveReader& in, const model::State& state) override;
  void add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const override;
  /// One sentence for each thing that is bad: LCP failures, steps that the guard could not mend, and
  /// residuals that, were they to stay, would hold a joint open by more than 0.1 mm or 5 mrad, or a contact
  /// in by 0.1 mm (residual times step over ERP).
  void add_warnings(std::vector<std::string>& out) const override;
  void add_summary(SummaryJson& out) const override;

  /// Steps in which the solver failed, counted once for each failure.
  long lcp_failures() const { return lcp_failures_; }
  /// Steps by the way they were solved, engine::Rung::none in unguarded ones.
  const std::array<long, engine::kRungNames.size()>& rungs() const { return rungs_; }
  /// Steps that quick_step solved, or the articulated engine by relaxation.
  long iterative_steps() const { return iterative_; }
  /// Steps whose residual was measured: quick_step's with contact, those at which a stop comes into force or
  /// goes out of it and every eighth of the others (engine::kResidualInterval); those in which world_step's
  /// LCP solver gave up; and those with contact on the articulated engine, whose contact solver reports its
  /// residual.
  long measured() const { return measured_; }
  /// Steps in which Newton's method did not find Coulomb's law, and friction's limits were updated from
  /// outside (articulated engine).
  long limit_steps() const { return limit_steps_; }
  /// Largest residuals of the measured steps: of joints [m/s] and [rad/s], and of rigid contacts [m/s].
  const Peak& linear() const { return linear_; }
  const Peak& angular() const { return angular_; }
  const Peak& contact() const { return contact_; }

 private:
  template <class Archive, class Self>
  static void carry(Archive& archive, Self& self);
  bool articulated() const;

  const scene::Scene& scene_;
  long lcp_failures_ = 0, iterative_ = 0;
  std::array<long, engine::kRungNames.size()> rungs_{};
  long measured_ = 0, limit_steps_ = 0;
  Peak linear_, angular_, contact_;
};

}  // namespace handsim::simulation
