// CPU time of a run: phases are timed; effects inside the solver share its time by rows, as entries say.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/simulation/watch/watcher.h"

namespace handsim::simulation {

struct LedgerEntry {
  std::string name;                   ///< effect or phase
  long ran = 0;                       ///< steps in which it acted
  double rows = 0;                    ///< constraint rows per step
  std::optional<double> ns_per_step;  ///< absent if it cannot be separated
  std::string how;                    ///< how the time was determined
};

class Ledger final : public Watcher {
 public:
  explicit Ledger(const Watched& watched);

  std::string_view name() const override { return "ledger"; }
  void update(Step& step) override;
  bool wants_times() const override { return true; }
  void save(ArchiveWriter& out) const override;
  void restore(ArchiveReader& in, const model::State& state) override;
  void add_summary(SummaryJson& out) const override;

  /// Time of control, including the set-up of servos in the engine, over the time of the step.
  double control_share() const;
  std::vector<LedgerEntry> phases() const;
  std::vector<LedgerEntry> effects() const;
  /// Contact points, summed over the steps.
  long contacts() const { return contacts_; }
  /// Pairs tested by the narrow phase, summed over the steps.
  long collide_calls() const { return collide_calls_; }

 private:
  struct Count {
    long steps = 0;  ///< in which it acted
    long rows = 0;   ///< in all
  };
  template <class Archive, class Self>
  static void serialize(Archive& archive, Self& self);
  model::Effect kind_of(const engine::Contact& contact) const;
  Count& count(model::Effect effect) { return counts_[static_cast<std::size_t>(effect)]; }
  void add_rows(model::Effect effect, long rows);
  LedgerEntry entry(model::Effect effect) const;
  /// Time in the solver itself [ns].
  double solver_ns() const { return step_ns_ - collide_ns_ - tissue_ns_ - servo_ns_; }
  /// Mean over the timed steps; nothing if there were none.
  std::optional<double> per_step(double ns) const;

  const model::Model& model_;
  model::Effects effects_;
  bool rows_;             ///< true if the engine has constraint rows
  long joint_rows_ = 0;   ///< of the joints themselves, each step
  long tissue_rows_ = 0;  ///< each step
  long driven_rows_ = 0;  ///< of servo drives, each step; 0 where torques act
  long timed_ = 0;        ///< steps
  long steps_ = 0, contacts_ = 0, collide_calls_ = 0;
  double step_ns_ = 0, check_ns_ = 0, collide_ns_ = 0, tissue_ns_ = 0, control_ns_ = 0, servo_ns_ = 0;
  Count counts_[model::kEffectCount];
};

}  // namespace handsim::simulation
