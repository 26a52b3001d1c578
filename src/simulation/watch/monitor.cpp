#include "handsim/simulation/watch/monitor.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

}  // namespace

Monitor::Monitor(const model::Model& model, double step, bool stops) : model_(model), step_(step) {
  for (const model::Joint& joint : model.joints)
    slider_axes_.push_back(joint.kind == model::JointKind::slider
                               ? Vec3(joint.parent_frame.q * joint.axes[0].axis)
                               : Vec3(Vec3::Zero()));
  for (std::size_t i = 0; i < model.joints.size(); ++i) {
    const auto& axes = model.joints[i].axes;
    if (stops &&
        std::any_of(axes.begin(), axes.end(), [](const model::JointAxis& a) { return a.stop.has_value(); }))
      watched_.push_back({static_cast<int>(i)});
  }
}

void Monitor::look(const model::State& state) {
  look_at_gaps(state);
  for (Watched& watched : watched_) {
    // Twice the rate, for what a rate at the step's end says of the step.
    watched.leeway -= 2 * step_ * fastest_rate(model_.joints[static_cast<std::size_t>(watched.joint)], state);
    if (!(watched.leeway > 0)) look_at_stops(watched, state);
  }
}

void Monitor::look(std::span<const engine::Contact> contacts, double time) {
  for (const engine::Contact& contact : contacts) {
    if (!(contact.depth > depth_)) continue;
    depth_ = contact.depth;
    depth_time_ = time;
    deep_a_ = contact.shape_a;
    deep_b_ = contact.shape_b;
  }
}

void Monitor::look_at_gaps(const model::State& state) {
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

void Monitor::look_at_stops(Watched& watched, const model::State& state) {
  const model::Joint& joint = model_.joints[static_cast<std::size_t>(watched.joint)];
  const double* q = state.q.data() + joint.first_dof;
  watched.leeway = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < joint.axes.size(); ++a) {
    const auto& stop = joint.axes[a].stop;
    if (!stop) continue;
    watched.leeway =
        std::min(watched.leeway, std::max(kResolution, std::min(stop->high - q[a], q[a] - stop->low)));
    book(watched, a, overshoot(*stop, q[a]), state);
  }
}

void Monitor::book(Watched& watched, std::size_t axis, double over, const model::State& state) {
  const model::Joint& joint = model_.joints[static_cast<std::size_t>(watched.joint)];
  if (over > 0 && watched.overshoot[axis] <= 0) {
    const double rate = state.u[static_cast<std::size_t>(joint.first_dof) + axis];
    watched.allowed[axis] = std::abs(rate) * step_ + kResolution;
  }
  watched.overshoot[axis] = over;
  const double excess = over - watched.allowed[axis];
  if (over > 0 && excess > excess_.value) excess_ = {excess, state.time, axis_name(joint, axis)};
}

Peak Monitor::penetration() const {
  if (depth_ <= 0) return {};
  const auto name = [&](int shape) { return model_.shapes[static_cast<std::size_t>(shape)].name; };
  return {depth_, depth_time_, name(deep_a_) + " and " + name(deep_b_)};
}

template <class Archive, class Self>
void Monitor::carry(Archive& archive, Self& self) {
  for (auto& watched : self.watched_) {
    archive(watched.leeway);
    archive.each(watched.overshoot);
    archive.each(watched.allowed);
  }
  archive(self.gap2_);
  archive(self.gap_time_);
  archive(self.gap_joint_);
  simulation::carry(archive, self.excess_);
  archive(self.depth_);
  archive(self.depth_time_);
  archive(self.deep_a_);
  archive(self.deep_b_);
}

void Monitor::save(ArchiveWriter& out) const { carry(out, *this); }

void Monitor::restore(ArchiveReader& in) {
  carry(in, *this);
  if (gap_joint_ > 0 && gap_joint_ >= model_.joints.size())
    in.refuse("the gap of a joint that is not there", "one of this scene's joints");
  const auto shapes = static_cast<int>(model_.shapes.size());
  if (depth_ > 0 && (deep_a_ >= shapes || deep_b_ >= shapes))
    in.refuse("a contact of a shape that is not there", "one of this scene's shapes");
}

Peak Monitor::joint_gap() const {
  if (model_.joints.empty()) return {};
  return {std::sqrt(gap2_), gap_time_, model_.joints[gap_joint_].name};
}

Peak Monitor::stop_overshoot() const { return excess_; }

Peak Monitor::stop_rest(const model::State& state) const {
  Peak worst;
  for (const Watched& watched : watched_) {
    const model::Joint& joint = model_.joints[static_cast<std::size_t>(watched.joint)];
    const double* q = state.q.data() + joint.first_dof;
    for (std::size_t a = 0; a < joint.axes.size(); ++a) {
      if (!joint.axes[a].stop) continue;
      const double over = overshoot(*joint.axes[a].stop, q[a]);
      if (over > worst.value) worst = {over, state.time, axis_name(joint, a)};
    }
  }
  return worst;
}

}  // namespace handsim::simulation
