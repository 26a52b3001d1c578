// Errors of the solver over a run: its own reports, measured residuals, and warnings.
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
  /// A sentence for each problem: LCP failures, residuals that would
  /// open a joint by more than 0.1 mm or 5 mrad or let a contact sink by 0.1 mm (times step over ERP).
  void add_warnings(std::vector<std::string>& out) const override;
  void add_summary(SummaryJson& out) const override;

  long lcp_failures() const { return lcp_failures_; }
  /// Number of steps that quick_step solved, or the articulated engine by relaxation.
  long iterative_steps() const { return iterative_; }
  /// Steps whose residual was measured: of quick_step with contact, with a change of active stops, and every
  /// eighth other (engine::kResidualInterval); of world_step if its LCP solver failed; articulated: contact.
  long measured() const { return measured_; }
  /// Largest residuals of the measured steps: of joints [m/s] and [rad/s], and of rigid contacts [m/s].
  const Peak& linear() const { return linear_; }
  const Peak& angular() const { return angular_; }
  const Peak& contact() const { return contact_; }

 private:
  template <class Archive, class Self>
  static void serialize(Archive& archive, Self& self);
  bool articulated() const;

  const scene::Scene& scene_;
  long lcp_failures_ = 0, iterative_ = 0;
  long measured_ = 0, limit_steps_ = 0;
  Peak linear_, angular_, contact_;
};

}  // namespace handsim::simulation
