#include "handsim/simulation/watch/convergence.h"

#include <algorithm>

#include <fmt/format.h>

namespace handsim::simulation {

namespace {

constexpr double kBadGap = 1e-4;    ///< [m]
constexpr double kBadAngle = 5e-3;  ///< [rad]
/// With less, a gap is not pulled back at all; it then counts as if it were by this much a step.
constexpr double kLeastErp = 0.01;

}  // namespace

void Convergence::look(const engine::StepReport& report, double time) {
  if (report.contact_sweeps > 0) {
    ++measured_;
    limit_steps_ += report.limit_updates > 0 ? 1 : 0;
    if (report.contact_residual > contact_.value)
      contact_ = {report.contact_residual, time, "contacts and stops"};
  }
  if (!report.residual) return;
  ++measured_;
  const auto raise = [&](Peak& peak, const engine::ResidualPeak& found, const auto& named) {
    if (found.value > peak.value)
      peak = {found.value, time, named[static_cast<std::size_t>(found.where)].name};
  };
  raise(linear_, report.residual->linear, model_.joints);
  raise(angular_, report.residual->angular, model_.joints);
  raise(contact_, report.residual->contact, model_.shapes);
}

template <class Archive, class Self>
void Convergence::carry(Archive& archive, Self& self) {
  archive(self.measured_);
  archive(self.limit_steps_);
  for (auto* peak : {&self.linear_, &self.angular_, &self.contact_}) simulation::carry(archive, *peak);
}

void Convergence::save(ArchiveWriter& out) const { carry(out, *this); }

void Convergence::restore(ArchiveReader& in) { carry(in, *this); }

std::vector<std::string> Convergence::warnings(const Ledger& ledger,
                                               const model::SolverSettings& solver) const {
  std::vector<std::string> out;
  const bool articulated = model::engine_of(solver.method) == model::EngineKind::articulated;
  if (const long failures = ledger.lcp_failures(); failures > 0 && articulated)
    out.push_back(fmt::format(
        "contacts, stops and torque limits did not settle in {} steps: try a smaller step", failures));
  else if (failures > 0)
    out.push_back(fmt::format(
        "the LCP solver gave up {} times, and what it had not solved was left to move: try a larger "
        "solver.cfm, a smaller step, or the step_guard effect",
        failures));
  if (const long lost = ledger.rungs()[static_cast<std::size_t>(engine::Rung::unresolved)]; lost > 0)
    out.push_back(fmt::format("{} steps did not keep to the guard's limits in any way", lost));
  const double worth = solver.step / std::max(solver.erp, kLeastErp);
  const auto warn = [&](const Peak& peak, double bad, const char* what, const char* unit, const char* gap) {
    if (peak.value * worth > bad)
      out.push_back(fmt::format(
          "the solver left {} {} at {:.3g} {}/s at {:.3f} s, which to last would be {:.2g} {}: try {}a "
          "smaller step",
          peak.where, what, peak.value, unit, peak.time, 1e3 * peak.value * worth, gap,
          articulated ? "" : "more solver.iterations, world_step, or "));
  };
  warn(linear_, kBadGap, "coming apart", "m", "mm");
  warn(angular_, kBadAngle, "twisting out of its axes", "rad", "mrad");
  warn(contact_, kBadGap, "sinking in", "m", "mm");
  return out;
}

}  // namespace handsim::simulation
