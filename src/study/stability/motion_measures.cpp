// Measures of hard cases: how bodies move.
#include <algorithm>
#include <array>
#include <cmath>

#include "handsim/core/index.h"
#include "handsim/study/stability/measure_tools.h"

namespace handsim::study {

namespace {

using simulation::Simulation;

/// Speeds of bodies: the largest, the root mean square, or after the first step alone.
class Speed final : public Measure {
 public:
  enum class What { top, rms, first };
  Speed(What what, const scene::Scene& scene, const MeasureSpec& spec)
      : what_(what), spec_(spec), bodies_(bodies_of(scene, spec)), sums_(bodies_.size(), 0.0) {}

  void look(const Simulation& now) override {
    const long look = looks_++;
    if (look == 0 || (what_ == What::first && look > 1) || !within(spec_, now.state().time)) return;
    ++count_;
    last_ = 0;
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      const double speed = now.state().bodies[bodies_[k]].v.norm();
      last_ = std::max(last_, speed);
      sums_[k] += speed * speed;
      const double value = what_ == What::rms ? 0 : speed;
      if (what_ != What::rms) largest_.book(value, now.state().time, name(now, k));
    }
    if (what_ != What::rms) return;
    // Of the body that moves most.
    const auto most = std::max_element(sums_.begin(), sums_.end());
    rms_ = {std::sqrt(*most / static_cast<double>(count_)), std::nullopt,
            name(now, static_cast<std::size_t>(most - sums_.begin()))};
  }
  std::optional<Figure> figure() const override { return what_ == What::rms ? rms_ : largest_.figure(); }
  std::optional<double> course() const override { return count_ > 0 ? std::optional(last_) : std::nullopt; }

 private:
  std::string name(const Simulation& now, std::size_t k) const { return now.model().bodies[bodies_[k]].name; }
  What what_;
  MeasureSpec spec_;
  std::vector<std::size_t> bodies_;
  std::vector<double> sums_;
  long looks_ = 0, count_ = 0;
  double last_ = 0;
  std::optional<Figure> rms_;
  Largest largest_;
};

template <Speed::What what>
std::unique_ptr<Measure> make_speed(const scene::Scene& scene, const MeasureSpec& spec) {
  return std::make_unique<Speed>(what, scene, spec);
}

/// How far bodies get from where they were at the start of the span: distance, angle, or mean speed of it.
class Drift final : public Measure {
 public:
  enum class What { distance, angle, mean_speed };
  Drift(What what, const scene::Scene& scene, const MeasureSpec& spec)
      : what_(what), spec_(spec), bodies_(bodies_of(scene, spec)) {}

  void look(const Simulation& now) override {
    const double time = now.state().time;
    if (!within(spec_, time)) return;
    if (start_.empty()) {
      for (const std::size_t i : bodies_) start_.push_back(now.state().bodies[i].pose());
      start_time_ = time;
    }
    if (what_ == What::mean_speed) largest_ = {};
    last_ = 0;
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      const model::BodyState& at = now.state().bodies[bodies_[k]];
      double value = (at.p - start_[k].p).norm();
      if (what_ == What::angle) value = rotation_vector(start_[k].q.conjugate() * at.q).norm();
      if (what_ == What::mean_speed && time > start_time_) value /= time - start_time_;
      last_ = std::max(last_, value);
      largest_.book(value, time, now.model().bodies[bodies_[k]].name);
    }
  }
  std::optional<Figure> figure() const override { return largest_.figure(); }
  std::optional<double> course() const override {
    return start_.empty() ? std::nullopt : std::optional(last_);
  }

 private:
  What what_;
  MeasureSpec spec_;
  std::vector<std::size_t> bodies_;
  std::vector<Pose> start_;
  double start_time_ = 0, last_ = 0;
  Largest largest_;
};

template <Drift::What what>
std::unique_ptr<Measure> make_drift(const scene::Scene& scene, const MeasureSpec& spec) {
  return std::make_unique<Drift>(what, scene, spec);
}

/// Speed of a body at the end of the span against a closed form, relative.
class SpeedError final : public Measure {
 public:
  SpeedError(const scene::Scene& scene, const MeasureSpec& spec)
      : body_(body_of(scene, spec.body)), spec_(spec) {
    if (!spec.expected) throw input_error("measures.expected", "nothing", "the speed in closed form");
  }
  void look(const Simulation& now) override {
    if (!within(spec_, now.state().time)) return;
    const double speed = now.state().bodies[body_].v.norm();
    figure_ = {std::abs(speed - *spec_.expected) / *spec_.expected, now.state().time, ""};
  }
  std::optional<Figure> figure() const override { return figure_; }

 private:
  std::size_t body_;
  MeasureSpec spec_;
  std::optional<Figure> figure_;
};

/// Fastest change of a joint's rate [rad/s^2]: what simulators of control call qacc.
class Acceleration final : public Measure {
 public:
  Acceleration(const scene::Scene& scene, const MeasureSpec& spec)
      : step_(scene.spec.solver.step), spec_(spec) {}
  void look(const Simulation& now) override {
    const std::vector<double>& rates = now.state().u;
    if (!last_.empty() && within(spec_, now.state().time))
      for (const model::Joint& joint : now.model().joints)
        for (int i = 0; i < model::dof_count(joint.kind); ++i) {
          const std::size_t k = at(joint.first_dof + i);
          const double value = std::abs(rates[k] - last_[k]) / step_;
          if (!largest_.figure() || value > largest_.figure()->value)
            largest_.book(value, now.state().time, joint.name);
        }
    last_ = rates;
  }
  std::optional<Figure> figure() const override { return largest_.figure(); }

 private:
  double step_;
  MeasureSpec spec_;
  std::vector<double> last_;
  Largest largest_;
};

/// Left and right hand of a scene that is its own mirror image in the y-z plane.
class Mirror final : public Measure {
 public:
  explicit Mirror(const scene::Scene& scene) {
    for (std::size_t i = 1; i < scene.model.bodies.size(); ++i) {
      const std::string& name = scene.model.bodies[i].name;
      if (name.starts_with("right.")) pairs_.emplace_back(i, body_of(scene, "left." + name.substr(6)));
    }
    if (pairs_.empty()) throw input_error("measures", "no hands", "a scene with a right and a left hand");
  }
  void look(const Simulation& now) override {
    last_ = 0;
    for (const auto& [right, left] : pairs_) {
      Vec3 image = now.state().bodies[left].p;
      image.x() = -image.x();
      const double apart = (now.state().bodies[right].p - image).norm();
      last_ = std::max(last_, apart);
      if (!largest_.figure() || apart > largest_.figure()->value)
        largest_.book(apart, now.state().time, now.model().bodies[right].name);
    }
  }
  std::optional<Figure> figure() const override { return largest_.figure(); }
  std::optional<double> course() const override { return last_; }

 private:
  std::vector<std::pair<std::size_t, std::size_t>> pairs_;
  double last_ = 0;
  Largest largest_;
};

using D = Dimension;

const std::array kMotionMeasures = {
    MeasureKind{
        "top_speed", "largest speed of a body", D::speed, "m/s", false, {}, make_speed<Speed::What::top>},
    MeasureKind{"rms_speed",
                "root mean square of a body's speed",
                D::speed,
                "m/s",
                false,
                {},
                make_speed<Speed::What::rms>},
    MeasureKind{"first_speed",
                "largest speed of a body after one step",
                D::speed,
                "m/s",
                false,
                {},
                make_speed<Speed::What::first>},
    MeasureKind{"drift",
                "distance of a body from where it was",
                D::length,
                "m",
                false,
                {},
                make_drift<Drift::What::distance>},
    MeasureKind{"turn",
                "angle of a body from where it was",
                D::angle,
                "rad",
                false,
                {},
                make_drift<Drift::What::angle>},
    MeasureKind{"slip_speed",
                "distance of a body from where it was, over the time",
                D::speed,
                "m/s",
                false,
                {},
                make_drift<Drift::What::mean_speed>},
    MeasureKind{"speed_error", "speed of a body off a closed form, relative", D::none, "", false, kNeedsBody,
                make_of_scene<SpeedError>},
    MeasureKind{"acceleration",
                "largest change of a joint's rate in a step, over the step",
                D::none,
                "rad/s2",
                false,
                {},
                make_of_scene<Acceleration>},
    MeasureKind{"mirror_error",
                "distance of a right hand's body from the left's mirror image",
                D::length,
                "m",
                false,
                {},
                make_of_scene<Mirror>}};

}  // namespace

std::span<const MeasureKind> motion_measures() { return kMotionMeasures; }

}  // namespace handsim::study
