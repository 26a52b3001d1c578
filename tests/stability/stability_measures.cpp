#include <algorithm>
#include <cmath>
#include <memory>

#include "stability/stability_measures.h"

namespace handsim::study {

namespace {

using simulation::Simulation;

/// Observes the impact of a joint on its stop, and the rebound.
class StopHit {
 public:
  /// @throws Error (input) for a joint without a stop.
  StopHit(const scene::Scene& scene, const std::string& joint) : at_(coordinate_of(scene, joint)) {
    if (!at_.joint->axes[at_.axis].stop) throw input_error("measures.joint", joint, "a joint with a stop");
  }

  void update(const Simulation& now) {
    const double q = at_.value(now.state()), rate = at_.rate(now.state());
    if (now.steps() == 0) start_ = q, impact_ = rate;
    if (now.steps() == 0) return;
    const double direction = impact_ > 0 ? 1 : -1;
    beyond_ = std::max({0.0, q - stop().high, stop().low - q});
    // The impact: the joint is beyond the stop, or has slowed down before it.
    if (!hit_ && (beyond_ > 0 || direction * rate < 0.9 * direction * impact_)) hit_ = now.steps();
    if (!hit_) {
      impact_ = rate;
      return;
    }
    // Until the joint is back at its start: the other stop does not count.
    if (!returned_) rebound_ = std::max(rebound_, -direction * rate / std::abs(impact_));
    returned_ = returned_ || direction * (q - start_) < 0;
  }

  const model::Stop& stop() const { return *at_.joint->axes[at_.axis].stop; }
  const std::string& joint() const { return at_.joint->name; }
  std::optional<long> hit() const { return hit_; }  ///< step of the impact
  double beyond() const { return beyond_; }         ///< present angle beyond the stop [rad]
  double rebound() const { return rebound_; }       ///< largest rebound rate over impact rate

 private:
  Coordinate at_;
  std::optional<long> hit_;
  bool returned_ = false;
  double start_ = 0, impact_ = 0, beyond_ = 0, rebound_ = 0;
};

/// Angle beyond the stop from the tenth step after impact on; or rebound over impact rate less the
/// restitution.
template <bool rebound>
Sampler stop_error(const scene::Scene& scene, const MeasureSpec& spec) {
  return [stop = StopHit(scene, spec.joint)](const Simulation& now) mutable {
    stop.update(now);
    if (!stop.hit() || (!rebound && now.steps() - *stop.hit() < 10)) return Sample();
    return Sample{
        {rebound ? std::abs(stop.rebound() - stop.stop().restitution) : stop.beyond(), stop.joint()}};
  };
}

/// Number of changes of a coordinate by more than half a turn in a step.
Sampler wraps(const scene::Scene& scene, const MeasureSpec& spec) {
  return [=, joint = coordinate_of(scene, spec.joint), last = std::optional<double>(),
          count = 0.0](const Simulation& now) mutable {
    const double value = joint.value(now.state());
    if (last && within(spec, now) && std::abs(value - *last) > M_PI) ++count;
    last = value;
    return Sample{{count, spec.joint}};
  };
}

/// Change of a rate in a step over the largest rate.
Sampler rate_jump(const scene::Scene& scene, const MeasureSpec& spec) {
  return [=, joint = coordinate_of(scene, spec.joint), last = std::optional<double>(),
          fastest = 0.0](const Simulation& now) mutable {
    const double rate = joint.rate(now.state());
    Sample out;
    fastest = std::max(fastest, std::abs(rate));
    if (last && within(spec, now)) out = Figure{std::abs(rate - *last), spec.joint, {}, fastest};
    last = rate;
    return out;
  };
}

/// Rate of a joint that starts on its stop over that without stops, in two steps; infinite if it stays.
Sampler release_ratio(const scene::Scene& scene, const MeasureSpec& spec) {
  const auto stopless =
      std::make_shared<scene::Scene>(scene::without_effect(scene, model::Effect::joint_stops));
  const auto other = std::make_shared<Simulation>(*stopless);
  return [=, joint = coordinate_of(scene, spec.joint)](const Simulation& now) -> Sample {
    if (now.steps() < 1 || now.steps() > 2) return {};
    other->step();
    const double ratio = joint.rate(now.state()) / joint.rate(other->state());
    const bool held = now.steps() == 2 && !(ratio > 0);
    return Figure{held ? std::numeric_limits<double>::infinity() : ratio, spec.joint};
  };
}

/// |a . b| of the two axes of universal joints.
Sampler axis_error(const scene::Scene&, const MeasureSpec&) {
  return [](const Simulation& now) {
    Sample out;
    for (const model::Joint& joint : now.model().joints) {
      if (joint.kind != model::JointKind::universal) continue;
      const auto& bodies = now.state().bodies;
      const Vec3 a = bodies[as_index(joint.parent)].q * (joint.parent_frame.q * joint.axes[0].axis);
      const Vec3 b = bodies[as_index(joint.child)].q * (joint.child_frame.q * joint.axes[1].axis);
      keep_larger(out, std::abs(a.dot(b)), joint.name);
    }
    return out;
  };
}

/// Error of a planar crank's slider, in closed form at r cos f + sqrt(l^2 - r^2 sin^2 f), crank angle f.
Sampler slider_error(const scene::Scene& scene, const MeasureSpec& spec) {
  const auto slider_at = [=](double angle) {
    const double across = spec.crank * std::sin(angle);
    return spec.crank * std::cos(angle) + std::sqrt(spec.rod * spec.rod - across * across);
  };
  return [=, crank = coordinate_of(scene, spec.joint), slider = body_of(scene, spec.body),
          start = std::optional<Vec3>()](const Simulation& now) mutable {
    const Vec3& p = now.state().bodies[slider].p;
    if (!start) start = p;
    const double moved = slider_at(spec.crank_angle + crank.value(now.state())) - slider_at(spec.crank_angle);
    // Its position perpendicular to the axis is constant.
    return Sample{{(p - *start - Vec3(moved, 0, 0)).norm(), spec.body}};
  };
}

/// The bodies distal to a joint. @throws Error (input) if there are none.
std::vector<std::size_t> distal_bodies(const model::Model& model, const std::string& name) {
  std::vector<bool> distal(model.bodies.size(), false);
  for (const model::Joint& joint : model.joints)
    if (joint.name == name || distal[as_index(joint.parent)]) distal[as_index(joint.child)] = true;
  std::vector<std::size_t> out;
  for (std::size_t i = 1; i < model.bodies.size(); ++i)
    if (distal[i]) out.push_back(i);
  if (out.empty()) throw input_error("measures.joint", name, "a joint of the scene");
  return out;
}

/// Relative error of a joint's reaction force, which must equal the weight of the distal bodies at rest. The
/// force follows from their change of momentum in a step; the bodies must have no contact.
Sampler reaction_error(const scene::Scene& scene, const MeasureSpec& spec) {
  const std::vector<std::size_t> bodies = distal_bodies(scene.model, spec.joint);
  double weight = 0;
  for (const std::size_t i : bodies) weight += scene.model.bodies[i].mass * scene.model.gravity.norm();
  return [=, step = scene.spec.solver.step, last = std::optional<Vec3>()](const Simulation& now) mutable {
    Vec3 momentum = Vec3::Zero(), gravity = Vec3::Zero();
    for (const std::size_t i : bodies) {
      momentum += now.model().bodies[i].mass * now.state().bodies[i].v;
      gravity += now.model().bodies[i].mass * now.model().gravity;
    }
    Sample out;
    if (last && within(spec, now)) {
      const Vec3 force = (momentum - *last) / step - gravity;
      out = {(force + gravity).norm() / weight, spec.joint};
    }
    last = momentum;
    return out;
  };
}

using D = Dimension;
using R = Reduce;

const MeasureKind kJointMeasures[] = {
    // name, dimension, unit, reduce, make, needs
    {"axis_error", D::none, "", R::largest, axis_error},
    {"stop_late", D::angle, "rad", R::largest, stop_error<false>, "joint"},
    {"rebound_error", D::none, "", R::total, stop_error<true>, "joint"},
    {"release_ratio", D::none, "", R::largest, release_ratio, "joint"},
    {"wraps", D::none, "", R::total, wraps, "joint"},
    {"rate_jump", D::none, "", R::largest, rate_jump, "joint"},
    {"slider_error", D::length, "m", R::largest, slider_error, "joint body crank rod"},
    {"reaction_error", D::none, "", R::largest, reaction_error, "joint"}};

}  // namespace

bool within(const MeasureSpec& spec, const Simulation& now) {
  const double time = now.state().time;
  return time >= spec.from - 1e-9 && time <= spec.until + 1e-9;
}

void keep_larger(std::optional<Figure>& figure, double value, const std::string& where) {
  if (!figure || value > figure->value) figure = Figure{value, where};
}

std::size_t body_of(const scene::Scene& scene, const std::string& name) {
  for (std::size_t i = 1; i < scene.model.bodies.size(); ++i)
    if (scene.model.bodies[i].name == name) return i;
  throw input_error("measures.body", name, "a body of the scene that moves");
}

std::vector<std::size_t> bodies_of(const scene::Scene& scene, const MeasureSpec& spec) {
  if (!spec.body.empty()) return {body_of(scene, spec.body)};
  std::vector<std::size_t> out;
  for (std::size_t i = 1; i < scene.model.bodies.size(); ++i)
    if (!scene.model.bodies[i].kinematic) out.push_back(i);
  return out;
}

Coordinate coordinate_of(const scene::Scene& scene, const std::string& name) {
  for (const model::Joint& joint : scene.model.joints) {
    if (joint.name == name) return {&joint, 0};
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      if (joint.name + "." + joint.axes[a].name == name) return {&joint, a};
  }
  throw input_error("measures.joint", name, "a joint of the scene, or joint.axis");
}

Measure::Measure(const scene::Scene& scene, const MeasureSpec& spec)
    : reduce_(measure_kind(spec.kind)->reduce), sample_(measure_kind(spec.kind)->make(scene, spec)) {}

void Measure::update(const Simulation& now) {
  now_ = &now;
  if (reduce_ == Reduce::at_end) return;
  std::optional<Figure> sample = sample_(now);
  if (!sample) return;
  scale_ = std::max(scale_, sample->scale);
  if (reduce_ == Reduce::largest && kept_ && !(sample->value > kept_->value)) return;
  if (reduce_ != Reduce::total) sample->time = now.state().time;
  kept_ = std::move(sample);
}

std::optional<Figure> Measure::figure() const {
  if (reduce_ == Reduce::at_end) return now_ ? sample_(*now_) : std::nullopt;
  std::optional<Figure> out = kept_;
  if (out) out->value /= scale_;
  return out;
}

std::span<const MeasureKind> measure_kinds() {
  static const std::vector<MeasureKind> all = [] {
    std::vector<MeasureKind> out;
    for (const std::span<const MeasureKind> theme : {motion_measures(), joint_measures()})
      out.insert(out.end(), theme.begin(), theme.end());
    return out;
  }();
  return all;
}

const MeasureKind* measure_kind(std::string_view name) {
  const std::span<const MeasureKind> kinds = measure_kinds();
  const auto at = std::ranges::find_if(kinds, [&](const MeasureKind& kind) { return kind.name == name; });
  return at == kinds.end() ? nullptr : &*at;
}

std::span<const MeasureKind> joint_measures() { return kJointMeasures; }

}  // namespace handsim::study
