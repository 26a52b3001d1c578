#include "handsim/simulation/watch/monitor.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace handsim::simulation {

namespace {

/// Overshoots are followed to this resolution [rad] or [m].
constexpr double kResolution = 1e-6;

/// Bound of how fast any coordinate of the joint moves. The axes of a universal joint are perpendicular, so
/// that no rate exceeds the relative angular velocity.
double fastest_rate(const model::Joint& joint, const model::State& state) {
  if (joint.kind == model::JointKind::slider)
    return std::abs(state.u[static_cast<std::size_t>(joint.first_dof)]);
  return (state.bodies[static_cast<std::size_t>(joint.child)].w -
          state.bodies[static_cast<std::size_t>(joint.parent)].w)
      .norm();
}

double overshoot(const model::Stop& stop, double q) { return std::max({0.0, q - stop.high, stop.low - q}); }

std::string axis_name(const model::Joint& joint, std::size_t axis) {
  return joint.name + "." + joint.axes[axis].name;
}

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
    slider_axes_.push_back(joint.kind == model::JointKind::slider
                               ? Vec3(joint.parent_frame.q * joint.axes[0].axis)
                               : Vec3(Vec3::Zero()));
  for (std::size_t i = 0; i < model.joints.size(); ++i) {
    const auto& axes = model.joints[i].axes;
    if (stops &&
        std::any_of(axes.begin(), axes.end(), [](const model::JointAxis& a) { return a.stop.has_value(); }))
      stopped_.push_back({static_cast<int>(i)});
  }
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
  for (StoppedJoint& stopped : stopped_) {
    // Twice the rate, for what a rate at the step's end says of the step.
    stopped.leeway -= 2 * step_ * fastest_rate(model_.joints[static_cast<std::size_t>(stopped.joint)], state);
    if (!(stopped.leeway > 0)) update_stops(stopped, state);
  }
}

void Monitor::update_gaps(const model::State& state) {
  for (std::size_t i = 0; i < model_.joints.size(); ++i) {
    const model::Joint& joint = model_.joints[i];
    const model::BodyState& child = state.bodies[static_cast<std::size_t>(joint.child)];
    const bool slides = joint.kind == model::JointKind::slider;
    Vec3 apart = child.p + child.q * joint.child_frame.p;
    Vec3 axis = slides ? slider_axes_[i] : Vec3::Zero();
    // The world stays at the origin, so that nothing is to be turned.
    if (joint.parent == model::kWorld) {
      apart -= joint.parent_frame.p;
    } else {
      const model::BodyState& parent = state.bodies[static_cast<std::size_t>(joint.parent)];
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

void Monitor::update_stops(StoppedJoint& stopped, const model::State& state) {
  const model::Joint& joint = model_.joints[static_cast<std::size_t>(stopped.joint)];
  const double* q = state.q.data() + joint.first_dof;
  stopped.leeway = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < joint.axes.size(); ++a) {
    const auto& stop = joint.axes[a].stop;
    if (!stop) continue;
    stopped.leeway =
        std::min(stopped.leeway, std::max(kResolution, std::min(stop->high - q[a], q[a] - stop->low)));
    record_overshoot(stopped, a, overshoot(*stop, q[a]), state);
  }
}

void Monitor::record_overshoot(StoppedJoint& stopped, std::size_t axis, double over,
                                const model::State& state) {
  const model::Joint& joint = model_.joints[static_cast<std::size_t>(stopped.joint)];
  if (over > 0 && stopped.overshoot[axis] <= 0) {
    const double rate = state.u[static_cast<std::size_t>(joint.first_dof) + axis];
    stopped.allowed[axis] = std::abs(rate) * step_ + kResolution;
  }
  stopped.overshoot[axis] = over;
  const double excess = over - stopped.allowed[axis];
  if (over > 0 && excess > excess_.value) excess_ = {excess, state.time, axis_name(joint, axis)};
}

template <class Archive, class Self>
void Monitor::carry(Archive& archive, Self& self) {
  for (auto& stopped : self.stopped_) {
    archive(stopped.leeway);
    archive.each(stopped.overshoot);
    archive.each(stopped.allowed);
  }
  archive(self.gap2_);
  archive(self.gap_time_);
  archive(self.gap_joint_);
  simulation::carry(archive, self.excess_);
}

void Monitor::save(ArchiveWriter& out) const { carry(out, *this); }

void Monitor::restore(ArchiveReader& in, const model::State& /*state*/) {
  carry(in, *this);
  if (gap_joint_ > 0 && gap_joint_ >= model_.joints.size())
    in.refuse("the gap of a joint that is not there", "one of this scene's joints");
}

Peak Monitor::joint_gap() const {
  if (model_.joints.empty()) return {};
  return {std::sqrt(gap2_), gap_time_, model_.joints[gap_joint_].name};
}

Peak Monitor::stop_rest(const model::State& state) const {
  Peak worst;
  for (const StoppedJoint& stopped : stopped_) {
    const model::Joint& joint = model_.joints[static_cast<std::size_t>(stopped.joint)];
    const double* q = state.q.data() + joint.first_dof;
    for (std::size_t a = 0; a < joint.axes.size(); ++a) {
      if (!joint.axes[a].stop) continue;
      const double over = overshoot(*joint.axes[a].stop, q[a]);
      if (over > worst.value) worst = {over, state.time, axis_name(joint, a)};
    }
  }
  return worst;
}

void Monitor::add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const {
  out.push_back(verdict("joint_gap", "m", !model_.joints.empty(), joint_gap(), criteria.joint_gap));
  out.push_back(verdict("stop_overshoot", "rad", has_stops(), excess_, criteria.stop_overshoot));
  out.push_back(verdict("stop_rest", "rad", has_stops(), engine_ ? stop_rest(engine_->state()) : Peak{},
                        criteria.stop_rest));
}

}  // namespace handsim::simulation
