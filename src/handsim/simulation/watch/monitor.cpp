#include "handsim/simulation/watch/monitor.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace handsim::simulation {

namespace {

constexpr double kTolerated = 1e-6;  ///< Overshoots that count for nothing [rad] or [m].

/// @param exists whether the scene has what is measured
Verdict verdict(std::string name, std::string unit, bool exists, const Peak& peak,
                std::optional<double> limit) {
  const std::optional<double> measured = exists ? std::optional(peak.value) : std::nullopt;
  return {std::move(name), std::move(unit), measured, limit, peak.time, peak.where};
}

}  // namespace

Monitor::Monitor(const Watched& watched)
    : Monitor(watched.scene.model, watched.scene.spec.solver.step,
              watched.scene.spec.solver.effects.has(model::Effect::joint_stops)) {
  engine_ = &watched.engine;
}

Monitor::Monitor(const model::Model& model, double step, bool stops) : model_(model), step_(step) {
  for (const model::Joint& joint : model.joints)
    slider_axes_.push_back(joint.slides(0) ? Vec3(joint.parent_frame.q * joint.axes[0].axis)
                                           : Vec3(Vec3::Zero()));
  if (!stops) return;
  for (const model::Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      if (joint.axes[a].stop) stopped_.push_back({&joint, a});
}

std::size_t Monitor::StoppedAxis::dof() const { return as_index(joint->first_dof) + axis; }

double Monitor::StoppedAxis::overshoot_in(const model::State& state) const {
  const model::Stop& stop = *joint->axes[axis].stop;
  const double q = state.q[dof()];
  return std::max({0.0, q - stop.high, stop.low - q});
}

void Monitor::update(Step& step) {
  update(step.engine.state());
  if (gap2_ <= kLargestGap * kLargestGap) return;
  const Peak gap = joint_gap();
  step.fault = {gap.time, gap.where, "joint gap [m]",
                fmt::format("{:g} is beyond {:g}: use a smaller step, more iterations or weaker torques",
                            gap.value, kLargestGap)};
}

void Monitor::update(const model::State& state) {
  update_gaps(state);
  update_stops(state);
}

void Monitor::update_gaps(const model::State& state) {
  for (std::size_t i = 0; i < model_.joints.size(); ++i) {
    const model::Joint& joint = model_.joints[i];
    const model::BodyState& child = state.bodies[as_index(joint.child)];
    const bool slides = joint.slides(0);
    Vec3 apart = child.p + child.q * joint.child_frame.p;
    Vec3 axis = slides ? slider_axes_[i] : Vec3::Zero();
    // The world stays at the origin, so that nothing is to be turned.
    if (joint.parent == model::kWorld) {
      apart -= joint.parent_frame.p;
    } else {
      const model::BodyState& parent = state.bodies[as_index(joint.parent)];
      apart -= parent.p + parent.q * joint.parent_frame.p;
      if (slides) axis = parent.q * axis;
    }
    if (slides) apart -= apart.dot(axis) * axis;
    const double gap2 = apart.squaredNorm();
    if (!(gap2 > gap2_)) continue;
    gap2_ = gap2;
    gap_time_ = state.time;
    gap_joint_ = i;
  }
}

void Monitor::update_stops(const model::State& state) {
  for (StoppedAxis& stopped : stopped_) {
    const double before = std::exchange(stopped.overshoot, stopped.overshoot_in(state));
    if (!(stopped.overshoot > 0)) continue;
    if (before <= 0) stopped.allowed = std::abs(state.u[stopped.dof()]) * step_ + kTolerated;
    const double excess = stopped.overshoot - stopped.allowed;
    if (excess > excess_.value) excess_ = {excess, state.time, stopped.name()};
  }
}

template <class Archive, class Self>
void Monitor::serialize(Archive& archive, Self& self) {
  for (auto& stopped : self.stopped_) archive(stopped.overshoot, stopped.allowed);
  archive(self.gap2_, self.gap_time_, self.gap_joint_);
  simulation::serialize(archive, self.excess_);
}

void Monitor::save(ArchiveWriter& out) const { serialize(out, *this); }

void Monitor::restore(ArchiveReader& in, const model::State& /*state*/) {
  serialize(in, *this);
  if (gap_joint_ > 0 && gap_joint_ >= model_.joints.size())
    in.refuse("the gap of a joint that is not there", "one of this scene's joints");
}

Peak Monitor::joint_gap() const {
  if (model_.joints.empty()) return {};
  return {std::sqrt(gap2_), gap_time_, model_.joints[gap_joint_].name};
}

Peak Monitor::stop_rest(const model::State& state) const {
  Peak worst;
  for (const auto& stopped : stopped_) worst.raise(stopped.overshoot_in(state), state.time, stopped.name());
  return worst;
}

void Monitor::add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const {
  out.push_back(verdict("joint_gap", "m", !model_.joints.empty(), joint_gap(), criteria.joint_gap));
  out.push_back(verdict("stop_overshoot", "rad", has_stops(), excess_, criteria.stop_overshoot));
  out.push_back(verdict("stop_rest", "rad", has_stops(), engine_ ? stop_rest(engine_->state()) : Peak{},
                        criteria.stop_rest));
}

}  // namespace handsim::simulation
