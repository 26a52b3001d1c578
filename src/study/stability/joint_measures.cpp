// Measures of hard cases: what joints and stops do.
#include <algorithm>
#include <array>
#include <cmath>

#include "handsim/study/stability/measure_tools.h"

namespace handsim::study {

namespace {

using simulation::Simulation;

/// What a joint does at its stop: how far it is beyond it from ten steps after it got there on, or how far
/// its rebound is from what the stop's `bounce` asks for.
class StopHit final : public Measure {
 public:
  enum class What { late, rebound };
  StopHit(What what, const scene::Scene& scene, const MeasureSpec& spec)
      : what_(what), at_(coordinate_of(scene, spec.joint)) {
    if (!at_.joint->axes[at_.axis].stop)
      throw input_error("measures.joint", spec.joint, "a joint with a stop");
  }

  void look(const Simulation& now) override {
    const model::Stop& stop = *at_.joint->axes[at_.axis].stop;
    const double q = at_.value(now.state()), rate = at_.rate(now.state());
    if (looks_++ == 0) {
      start_ = q;
      impact_ = rate;
      return;
    }
    const double direction = impact_ > 0 ? 1 : -1;
    // At the stop: beyond it, or turned back before it.
    if (!hit_ && (q > stop.high || q < stop.low || direction * rate < 0.9 * direction * impact_))
      hit_ = looks_;
    if (!hit_) {
      impact_ = rate;
      return;
    }
    const double beyond = std::max({0.0, q - stop.high, stop.low - q});
    last_ = beyond;
    if (what_ == What::late && looks_ - *hit_ >= 10) largest_.book(beyond, now.state().time, at_.joint->name);
    // Until it is back where it came from: the other stop is another story.
    if (what_ == What::rebound && !returned_)
      fastest_back_ = std::max(fastest_back_, -direction * rate / std::abs(impact_));
    returned_ = returned_ || direction * (q - start_) < 0;
    hit_time_ = now.state().time;
  }
  std::optional<Figure> figure() const override {
    if (!hit_) return std::nullopt;
    if (what_ == What::late) return largest_.figure();
    const double bounce = at_.joint->axes[at_.axis].stop->bounce;
    return Figure{std::abs(fastest_back_ - bounce), std::nullopt, at_.joint->name};
  }
  std::optional<double> course() const override { return last_; }

 private:
  What what_;
  Coordinate at_;
  long looks_ = 0;
  std::optional<long> hit_;
  bool returned_ = false;
  double start_ = 0, impact_ = 0, fastest_back_ = 0, hit_time_ = 0, last_ = 0;
  Largest largest_;
};

template <StopHit::What what>
std::unique_ptr<Measure> make_stop_hit(const scene::Scene& scene, const MeasureSpec& spec) {
  return std::make_unique<StopHit>(what, scene, spec);
}

/// A coordinate's jumps: by more than half a turn in a step; or of its rate, over its largest rate.
class Jumps final : public Measure {
 public:
  enum class What { wraps, rate };
  Jumps(What what, const scene::Scene& scene, const MeasureSpec& spec)
      : what_(what), at_(coordinate_of(scene, spec.joint)), spec_(spec) {}

  void look(const Simulation& now) override {
    const double value = what_ == What::wraps ? at_.value(now.state()) : at_.rate(now.state());
    if (last_ && within(spec_, now.state().time)) {
      const double jump = std::abs(value - *last_);
      if (what_ == What::wraps && jump > M_PI) ++wraps_;
      if (what_ == What::rate) largest_.book(jump, now.state().time, spec_.joint);
    }
    last_ = value;
    fastest_ = std::max(fastest_, std::abs(value));
  }
  std::optional<Figure> figure() const override {
    if (!last_) return std::nullopt;
    if (what_ == What::wraps) return Figure{static_cast<double>(wraps_), std::nullopt, spec_.joint};
    auto out = largest_.figure();
    if (out) out->value /= fastest_;
    return out;
  }
  std::optional<double> course() const override { return last_; }

 private:
  What what_;
  Coordinate at_;
  MeasureSpec spec_;
  std::optional<double> last_;
  double fastest_ = 0;
  long wraps_ = 0;
  Largest largest_;
};

template <Jumps::What what>
std::unique_ptr<Measure> make_jumps(const scene::Scene& scene, const MeasureSpec& spec) {
  return std::make_unique<Jumps>(what, scene, spec);
}

/// |a . b| of the two axes of universal joints, from the poses of their bodies.
class AxisError final : public Measure {
 public:
  void look(const Simulation& now) override {
    last_ = 0;
    for (const model::Joint& joint : now.model().joints) {
      if (joint.kind != model::JointKind::universal) continue;
      const auto pose = [&](int body) { return now.state().bodies[static_cast<std::size_t>(body)].q; };
      const Vec3 a = pose(joint.parent) * (joint.parent_frame.q * joint.axes[0].axis);
      const Vec3 b = pose(joint.child) * (joint.child_frame.q * joint.axes[1].axis);
      last_ = std::max(last_, std::abs(a.dot(b)));
      largest_.book(std::abs(a.dot(b)), now.state().time, joint.name);
    }
  }
  std::optional<Figure> figure() const override { return largest_.figure(); }
  std::optional<double> course() const override { return last_; }

 private:
  double last_ = 0;
  Largest largest_;
};

/// The slider of a planar slider-crank against r cos f + sqrt(l^2 - r^2 sin^2 f) at the crank's angle f.
class SliderError final : public Measure {
 public:
  SliderError(const scene::Scene& scene, const MeasureSpec& spec)
      : crank_(coordinate_of(scene, spec.joint)), slider_(body_of(scene, spec.body)), spec_(spec) {}

  void look(const Simulation& now) override {
    const Vec3& p = now.state().bodies[slider_].p;
    const double place = slider_at(spec_.crank_angle + crank_.value(now.state()));
    if (!start_) start_ = p, start_place_ = slider_at(spec_.crank_angle);
    // Across its axis it does not move at all.
    const Vec3 error = p - *start_ - Vec3(place - start_place_, 0, 0);
    last_ = error.norm();
    largest_.book(last_, now.state().time, spec_.body);
  }
  std::optional<Figure> figure() const override { return largest_.figure(); }
  std::optional<double> course() const override { return last_; }

 private:
  double slider_at(double angle) const {
    const double across = spec_.crank * std::sin(angle);
    return spec_.crank * std::cos(angle) + std::sqrt(spec_.rod * spec_.rod - across * across);
  }
  Coordinate crank_;
  std::size_t slider_;
  MeasureSpec spec_;
  std::optional<Vec3> start_;
  double start_place_ = 0, last_ = 0;
  Largest largest_;
};

/// The force through a joint against the weight of all that hangs on it, which is at rest. The force follows
/// from the momentum that the step gave the bodies beyond the joint; nothing else may touch them.
class Reaction final : public Measure {
 public:
  Reaction(const scene::Scene& scene, const MeasureSpec& spec) : step_(scene.spec.solver.step), spec_(spec) {
    const model::Model& model = scene.model;
    std::vector<bool> beyond(model.bodies.size(), false);
    for (const model::Joint& joint : model.joints) {
      const bool itself = joint.name == spec.joint;
      if (itself || beyond[static_cast<std::size_t>(joint.parent)])
        beyond[static_cast<std::size_t>(joint.child)] = true;
    }
    for (std::size_t i = 1; i < model.bodies.size(); ++i)
      if (beyond[i]) bodies_.push_back(i), weight_ += model.bodies[i].mass * model.gravity.norm();
    if (bodies_.empty()) throw input_error("measures.joint", spec.joint, "a joint of the scene");
  }
  void look(const Simulation& now) override {
    Vec3 momentum = Vec3::Zero(), gravity = Vec3::Zero();
    for (const std::size_t i : bodies_) {
      momentum += now.model().bodies[i].mass * now.state().bodies[i].v;
      gravity += now.model().bodies[i].mass * now.model().gravity;
    }
    if (last_ && within(spec_, now.state().time)) {
      const Vec3 force = (momentum - *last_) / step_ - gravity;
      value_ = (force + gravity).norm() / weight_;
      largest_.book(value_, now.state().time, spec_.joint);
    }
    last_ = momentum;
  }
  std::optional<Figure> figure() const override { return largest_.figure(); }
  std::optional<double> course() const override { return value_; }

 private:
  double step_;
  MeasureSpec spec_;
  std::vector<std::size_t> bodies_;
  double weight_ = 0, value_ = 0;
  std::optional<Vec3> last_;
  Largest largest_;
};

constexpr MeasureNeeds kJoint = {.joint = true};
using D = Dimension;

const std::array kJointMeasures = {
    MeasureKind{"axis_error",
                "largest |a.b| of the axes of universal joints",
                D::none,
                "",
                false,
                {},
                make_of_scene<AxisError>},
    MeasureKind{"stop_late", "overshoot from ten steps after the stop was hit on", D::angle, "rad", false,
                kJoint, make_stop_hit<StopHit::What::late>},
    MeasureKind{"rebound_error", "rebound rate over impact rate, off the stop's bounce", D::none, "", false,
                kJoint, make_stop_hit<StopHit::What::rebound>},
    MeasureKind{"wraps", "jumps of an angle by half a turn and more", D::none, "", false, kJoint,
                make_jumps<Jumps::What::wraps>},
    MeasureKind{"rate_jump", "largest change of a rate in one step, over the largest rate", D::none, "",
                false, kJoint, make_jumps<Jumps::What::rate>},
    MeasureKind{"slider_error",
                "slider off its place at the crank's angle",
                D::length,
                "m",
                false,
                {.body = true, .joint = true, .crank = true},
                make_of_scene<SliderError>},
    MeasureKind{"reaction_error", "force through a joint at rest off the weight that hangs on it, relative",
                D::none, "", false, kJoint, make_of_scene<Reaction>}};

}  // namespace

std::span<const MeasureKind> joint_measures() { return kJointMeasures; }

}  // namespace handsim::study
