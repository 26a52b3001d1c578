#include "handsim/simulation/watch/convergence.h"

#include <algorithm>

#include <fmt/format.h>

#include "handsim/simulation/watch/summary_json.h"

namespace handsim::simulation {

namespace {

constexpr double kBadGap = 1e-4;    ///< [m]
constexpr double kBadAngle = 5e-3;  ///< [rad]
/// With less, a gap is not pulled back at all; it then counts as if it were by this much a step.
constexpr double kLeastErp = 0.01;

}  // namespace

bool Convergence::articulated() const {
  return scene_.spec.solver.engine() == engine::EngineKind::articulated;
}

void Convergence::update(Step& step) {
  const engine::StepReport& report = step.report;
  lcp_failures_ += report.lcp_failures;
  iterative_ += report.iterative ? 1 : 0;
  if (report.contact_sweeps == 0 && !report.residual) return;
  const double time = step.engine.state().time;
  if (report.contact_sweeps > 0) {
    ++measured_;
    limit_steps_ += report.limit_updates > 0 ? 1 : 0;
    contact_.raise(report.contact_residual, time, "contacts and stops");
  }
  if (!report.residual) return;
  ++measured_;
  const auto raise = [&](Peak& peak, const engine::ResidualPeak& found, const auto& named) {
    if (found.value > peak.value) peak = {found.value, time, named[as_index(found.where)].name};
  };
  raise(linear_, report.residual->linear, scene_.model.joints);
  raise(angular_, report.residual->angular, scene_.model.joints);
  raise(contact_, report.residual->contact, scene_.model.shapes);
}

template <class Archive, class Self>
void Convergence::serialize(Archive& archive, Self& self) {
  archive(self.lcp_failures_, self.iterative_, self.measured_, self.limit_steps_);
  for (auto* peak : {&self.linear_, &self.angular_, &self.contact_}) simulation::serialize(archive, *peak);
}

void Convergence::save(ArchiveWriter& out) const { serialize(out, *this); }

void Convergence::restore(ArchiveReader& in, const model::State& /*state*/) { serialize(in, *this); }

void Convergence::add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const {
  Verdict failures{"lcp_failures", "", static_cast<double>(lcp_failures_)};
  if (criteria.lcp_failures) failures.limit = *criteria.lcp_failures;
  out.push_back(std::move(failures));
}

void Convergence::add_warnings(std::vector<std::string>& out) const {
  const engine::Settings& solver = scene_.spec.solver;
  if (lcp_failures_ > 0 && articulated())
    out.push_back(fmt::format(
        "contacts, stops and torque limits did not settle in {} steps: try a smaller step", lcp_failures_));
  else if (lcp_failures_ > 0)
    out.push_back(fmt::format(
        "the LCP solver gave up {} times, and what it had not solved was left to move: try a larger "
        "solver.cfm, a smaller step, or engine articulated",
        lcp_failures_));
  const double worth = solver.step / std::max(solver.erp(), kLeastErp);
  const auto warn = [&](const Peak& peak, double bad, const char* what, const char* unit, const char* gap) {
    if (peak.value * worth > bad)
      out.push_back(fmt::format(
          "the solver left {} {} at {:.3g} {}/s at {:.3f} s, which to last would be {:.2g} {}: try {}a "
          "smaller step",
          peak.where, what, peak.value, unit, peak.time, 1e3 * peak.value * worth, gap,
          articulated() ? "" : "more solver.iterations, world_step, or "));
  };
  warn(linear_, kBadGap, "coming apart", "m", "mm");
  warn(angular_, kBadAngle, "twisting out of its axes", "rad", "mrad");
  warn(contact_, kBadGap, "sinking in", "m", "mm");
}

void Convergence::add_summary(SummaryJson& out) const {
  out.json["counts"]["lcp_failures"] = lcp_failures_;
  const auto peak = [](const Peak& of) {
    return Json{{"largest", of.value}, {"time_s", of.time}, {"where", of.where}};
  };
  Json& solved = out.json["convergence"];
  solved["steps_measured"] = measured_;
  if (measured_ > 0) {
    solved["joint_residual_m_per_s"] = peak(linear_);
    solved["joint_residual_rad_per_s"] = peak(angular_);
    solved["contact_residual_m_per_s"] = peak(contact_);
  }
  if (articulated()) {
    solved["steps_by_fixed_friction_limits"] = limit_steps_;
    solved["steps_relaxed"] = iterative_;
  }
}

}  // namespace handsim::simulation
