// What a run's effects and phases cost. Phases are timed. Effects that live inside the solver cannot be timed
// on their own: they get the solver's time by their share of its constraint rows, and the entry says so.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/engine/engine.h"

namespace handsim::simulation {

struct LedgerEntry {
  std::string name;                   ///< effect or phase
  long ran = 0;                       ///< steps in which it acted
  double rows = 0;                    ///< constraint rows per step
  std::optional<double> ns_per_step;  ///< absent where it cannot be told apart
  std::string how;                    ///< how the cost was found
};

/// What the parts of one step took [ns].
struct StepTimes {
  double control = 0;  ///< sensing joints and working out what drives them
  double step = 0;     ///< the engine
  double check = 0;    ///< monitoring and tracking figures
};

class Ledger {
 public:
  /// @param rows whether the engine has constraint rows to share its time by.
  Ledger(const model::Model& model, const model::Effects& effects, bool rows = true);

  /// @param driven_rows rows of servo drives in each step, 0 where torques act.
  void set_driven_rows(long driven_rows) { driven_rows_ = driven_rows; }
  /// Whether the step to be booked next is to be timed: one in 16, as on small scenes the clock costs as much
  /// as a phase; not the first, which is cold.
  bool times_next() const { return steps_ % kTimedEvery == kTimedEvery / 2; }
  /// Books one step: what the engine reported, its contacts, and, where it is timed, what its parts took.
  void book(const engine::StepReport& report, std::span<const engine::Contact> contacts,
            const StepTimes& times);
  /// Time in control, the drives' set-up in the engine included, over the time of the step it drives.
  double control_share() const;

  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

  std::vector<LedgerEntry> phases() const;
  std::vector<LedgerEntry> effects() const;
  long steps() const { return steps_; }
  long lcp_failures() const { return lcp_failures_; }
  long contacts() const { return contacts_; }
  long collide_calls() const { return collide_calls_; }
  /// Guarded steps by the way they were got through.
  const std::array<long, engine::kRungNames.size()>& rungs() const { return rungs_; }
  /// Steps that quick_step solved.
  long iterative_steps() const { return iterative_; }

 private:
  static constexpr long kTimedEvery = 16;
  struct Count {
    long steps = 0;  ///< in which it acted
    long rows = 0;   ///< in all
  };
  template <class Archive, class Self>
  static void carry(Archive& archive, Self& self);
  model::Effect kind_of(const engine::Contact& contact) const;
  Count& count(model::Effect effect) { return counts_[static_cast<std::size_t>(effect)]; }
  LedgerEntry entry(model::Effect effect) const;
  /// Time in the solver itself [ns].
  double solver_ns() const { return step_ns_ - collide_ns_ - tissue_ns_ - servo_ns_; }
  /// Per timed step; nothing where none was.
  std::optional<double> per_step(double ns) const;

  const model::Model& model_;
  model::Effects effects_;
  bool rows_;
  long joint_rows_ = 0;   ///< of the joints themselves, each step
  long tissue_rows_ = 0;  ///< each step
  long driven_rows_ = 0;  ///< each step
  long timed_ = 0;        ///< steps
  long steps_ = 0, lcp_failures_ = 0, contacts_ = 0, collide_calls_ = 0;
  double step_ns_ = 0, check_ns_ = 0, collide_ns_ = 0, tissue_ns_ = 0, control_ns_ = 0, servo_ns_ = 0;
  long iterative_ = 0;
  std::array<long, engine::kRungNames.size()> rungs_{};
  Count counts_[model::kEffectCount];
};

}  // namespace handsim::simulation
