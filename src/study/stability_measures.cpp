#include "handsim/study/stability_measures.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

#include "handsim/model/energy.h"
#include "handsim/model/kinematics.h"

namespace handsim::study {

namespace {

using simulation::Peak;
using simulation::Simulation;

bool within(const MeasureSpec& spec, double time) {
  return time >= spec.from - 1e-9 && time <= spec.until + 1e-9;
}

/// A largest value, where and when.
class Largest {
 public:
  void book(double value, double time, const std::string& where = {}) {
    if (best_ && !(value > best_->value)) return;
    best_ = {value, time, where};
  }
  const std::optional<Figure>& figure() const { return best_; }

 private:
  std::optional<Figure> best_;
};

std::size_t body_of(const scene::Scene& scene, const std::string& name) {
  for (std::size_t i = 1; i < scene.model.bodies.size(); ++i)
    if (scene.model.bodies[i].name == name) return i;
  throw input_error("measures.body", name, "a body of the scene that moves");
}

/// The bodies that are meant: the one that is named, or all that move.
std::vector<std::size_t> bodies_of(const scene::Scene& scene, const MeasureSpec& spec) {
  if (!spec.body.empty()) return {body_of(scene, spec.body)};
  std::vector<std::size_t> out;
  for (std::size_t i = 1; i < scene.model.bodies.size(); ++i)
    if (!scene.model.bodies[i].kinematic) out.push_back(i);
  return out;
}

/// A coordinate, by `joint` or `joint.axis`.
struct Coordinate {
  const model::Joint* joint = nullptr;
  std::size_t axis = 0;

  double value(const model::State& state) const {
    std::array<double, 3> q{};
    model::joint_coordinates(*joint, state, q);
    return q[axis];
  }
  double rate(const model::State& state) const {
    std::array<double, 3> rate{};
    model::joint_rates(*joint, state, rate);
    return rate[axis];
  }
};

Coordinate coordinate_of(const scene::Scene& scene, const std::string& name) {
  for (const model::Joint& joint : scene.model.joints) {
    if (joint.name == name) return {&joint, 0};
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      if (joint.name + "." + joint.axes[a].name == name) return {&joint, a};
  }
  throw input_error("measures.joint", name, "a joint of the scene, or joint.axis");
}

double mechanical_energy(const Simulation& now) {
  return model::kinetic_energy(now.model(), now.state()) +
         model::potential_energy(now.model(), now.state(), now.engine().settings().effects);
}

/// Energy against the largest kinetic energy of the run.
class Energy final : public Measure {
 public:
  enum class What { gain, error, loss, rise };
  Energy(What what, const MeasureSpec& spec) : what_(what), spec_(spec) {}

  void look(const Simulation& now) override {
    if (!within(spec_, now.state().time)) return;
    const double energy = mechanical_energy(now);
    if (!start_) start_ = lowest_ = energy;
    lowest_ = std::min(lowest_, energy);
    scale_ = std::max(scale_, model::kinetic_energy(now.model(), now.state()));
    last_ = change(energy);
    if (what_ == What::loss) largest_ = {};
    largest_.book(last_, now.state().time);
  }
  std::optional<Figure> figure() const override {
    auto out = largest_.figure();
    if (out) out->value = scale_ > 0 ? out->value / scale_ : 0;
    return out;
  }
  std::optional<double> course() const override {
    return scale_ > 0 ? std::optional(last_ / scale_) : std::nullopt;
  }

 private:
  double change(double energy) const {
    switch (what_) {
      case What::gain:
        return energy - *start_;
      case What::error:
        return std::abs(energy - *start_);
      case What::loss:
        return *start_ - energy;
      case What::rise:
        return energy - lowest_;
    }
    return 0;
  }
  What what_;
  MeasureSpec spec_;
  std::optional<double> start_;
  double lowest_ = 0, scale_ = 0, last_ = 0;
  Largest largest_;
};

template <Energy::What what>
std::unique_ptr<Measure> make_energy(const scene::Scene&, const MeasureSpec& spec) {
  return std::make_unique<Energy>(what, spec);
}

/// Angular momentum about the common centre of mass against its start.
class Momentum final : public Measure {
 public:
  explicit Momentum(const scene::Scene& scene, const MeasureSpec& spec) : bodies_(bodies_of(scene, spec)) {}

  void look(const Simulation& now) override {
    const Vec3 value = angular_momentum(now);
    if (!start_) start_ = value;
    last_ = (value - *start_).norm() / start_->norm();
    largest_.book(last_, now.state().time);
  }
  std::optional<Figure> figure() const override { return largest_.figure(); }
  std::optional<double> course() const override { return last_; }

 private:
  Vec3 angular_momentum(const Simulation& now) const {
    double mass = 0;
    Vec3 centre = Vec3::Zero(), velocity = Vec3::Zero(), out = Vec3::Zero();
    for (const std::size_t i : bodies_) {
      mass += now.model().bodies[i].mass;
      centre += now.model().bodies[i].mass * now.state().bodies[i].p;
      velocity += now.model().bodies[i].mass * now.state().bodies[i].v;
    }
    centre /= mass, velocity /= mass;
    for (const std::size_t i : bodies_) {
      const model::Body& body = now.model().bodies[i];
      const model::BodyState& at = now.state().bodies[i];
      out += at.q * (body.inertia * (at.q.conjugate() * at.w));
      out += body.mass * (at.p - centre).cross(at.v - velocity);
    }
    return out;
  }
  std::vector<std::size_t> bodies_;
  std::optional<Vec3> start_;
  double last_ = 0;
  Largest largest_;
};

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

/// A body on the ground of a scene whose gravity is inclined: its speed against Coulomb's,
/// g (sin a - mu cos a) t from rest, or, rolling, g sin a t / (1 + I / (m r^2)). At rest, its own speed.
class Incline final : public Measure {
 public:
  enum class What { slide, creep, roll };
  Incline(What what, const scene::Scene& scene, const MeasureSpec& spec)
      : what_(what), body_(body_of(scene, spec.body)), spec_(spec) {
    const model::Model& model = scene.model;
    const model::Shape* ground = nullptr;
    const model::Shape* shape = nullptr;
    for (const model::Shape& candidate : model.shapes) {
      if (candidate.kind == model::ShapeKind::plane) ground = &candidate;
      if (candidate.body == static_cast<int>(body_)) shape = &candidate;
    }
    if (!ground || !shape) throw input_error("measures", "no ground or no shape", "a body on a ground");
    const model::Material surface =
        model::combined(model.materials[static_cast<std::size_t>(ground->material)],
                        model.materials[static_cast<std::size_t>(shape->material)]);
    const Vec3 normal = ground->pose.q * Vec3::UnitZ();
    const double down = -model.gravity.dot(normal);
    const double along = (model.gravity + down * normal).norm();
    const model::Body& body = model.bodies[body_];
    if (what == What::roll)
      acceleration_ = along / (1 + body.inertia(0, 0) / (body.mass * shape->radius * shape->radius));
    else
      acceleration_ = std::max(0.0, along - surface.friction * down);
  }

  void look(const Simulation& now) override {
    const double time = now.state().time;
    if (!within(spec_, time)) return;
    const double speed = now.state().bodies[body_].v.norm();
    if (what_ == What::creep) {
      // Mean over the span, so that a shiver about one place is none.
      if (!start_)
        start_ = now.state().bodies[body_].p, start_time_ = time;
      else
        figure_ = {(now.state().bodies[body_].p - *start_).norm() / (time - start_time_), time, ""};
      return;
    }
    const double expected = acceleration_ * time;
    if (expected > 0) figure_ = {std::abs(speed - expected) / expected, time, ""};
  }
  std::optional<Figure> figure() const override { return figure_; }
  std::optional<double> course() const override {
    return figure_ ? std::optional(figure_->value) : std::nullopt;
  }

 private:
  What what_;
  std::size_t body_;
  MeasureSpec spec_;
  double acceleration_ = 0, start_time_ = 0;
  std::optional<Vec3> start_;
  std::optional<Figure> figure_;
};

template <Incline::What what>
std::unique_ptr<Measure> make_incline(const scene::Scene& scene, const MeasureSpec& spec) {
  return std::make_unique<Incline>(what, scene, spec);
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

/// Depth of contacts.
class Penetration final : public Measure {
 public:
  explicit Penetration(const MeasureSpec& spec) : spec_(spec) {}
  void look(const Simulation& now) override {
    if (!within(spec_, now.state().time)) return;
    last_ = 0;
    for (const engine::Contact& contact : now.engine().contacts()) {
      last_ = std::max(last_, contact.depth);
      const auto name = [&](int shape) { return now.model().shapes[static_cast<std::size_t>(shape)].name; };
      if (!largest_.figure() || contact.depth > largest_.figure()->value)
        largest_.book(contact.depth, now.state().time,
                      name(contact.shape_a) + " in " + name(contact.shape_b));
    }
    if (!largest_.figure()) largest_.book(0, now.state().time);
  }
  std::optional<Figure> figure() const override { return largest_.figure(); }
  std::optional<double> course() const override { return last_; }

 private:
  MeasureSpec spec_;
  double last_ = 0;
  Largest largest_;
};

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

/// Fastest change of a joint's rate [rad/s^2]: what simulators of control call qacc.
class Acceleration final : public Measure {
 public:
  Acceleration(const scene::Scene& scene, const MeasureSpec& spec)
      : step_(scene.spec.solver.step), spec_(spec) {}
  void look(const Simulation& now) override {
    std::vector<double> rates = model::rates(now.model(), now.state());
    if (!last_.empty() && within(spec_, now.state().time))
      for (const model::Joint& joint : now.model().joints)
        for (int i = 0; i < model::dof_count(joint.kind); ++i) {
          const auto k = static_cast<std::size_t>(joint.first_dof + i);
          const double value = std::abs(rates[k] - last_[k]) / step_;
          if (!largest_.figure() || value > largest_.figure()->value)
            largest_.book(value, now.state().time, joint.name);
        }
    last_ = std::move(rates);
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

/// Growth of the process' resident memory from a tenth of the run on, as a share.
class Memory final : public Measure {
 public:
  void look(const Simulation& now) override {
    constexpr long kEvery = 1000;
    const long tenth = now.step_count() / 10;
    if (looks_++ < tenth || looks_ % kEvery != 0) return;
    const double now_pages = pages();
    if (!first_) first_ = now_pages;
    last_ = (now_pages - *first_) / *first_;
    largest_.book(last_, now.state().time);
  }
  std::optional<Figure> figure() const override { return largest_.figure(); }
  std::optional<double> course() const override { return first_ ? std::optional(last_) : std::nullopt; }

 private:
  static double pages() {
    std::ifstream file("/proc/self/statm");
    double all = 0, resident = 0;
    file >> all >> resident;
    return resident;
  }
  long looks_ = 0;
  std::optional<double> first_;
  double last_ = 0;
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

/// What the simulation keeps anyway, read at the end.
class Kept final : public Measure {
 public:
  using Read = std::optional<Figure> (*)(const Simulation&);
  explicit Kept(Read read) : read_(read) {}
  void look(const Simulation& now) override { now_ = &now; }
  std::optional<Figure> figure() const override { return now_ ? read_(*now_) : std::nullopt; }
  std::optional<double> course() const override {
    const auto figure = now_ ? read_(*now_) : std::nullopt;
    return figure ? std::optional(figure->value) : std::nullopt;
  }

 private:
  Read read_;
  const Simulation* now_ = nullptr;
};

template <Kept::Read read>
std::unique_ptr<Measure> make_kept(const scene::Scene&, const MeasureSpec&) {
  return std::make_unique<Kept>(read);
}

std::optional<Figure> of_peak(const Peak& peak) { return Figure{peak.value, peak.time, peak.where}; }
std::optional<Figure> completes(const Simulation&) { return Figure{}; }
std::optional<Figure> joint_gap(const Simulation& now) { return of_peak(now.monitor().joint_gap()); }
std::optional<Figure> stop_overshoot(const Simulation& now) {
  return of_peak(now.monitor().stop_overshoot());
}
std::optional<Figure> stop_rest(const Simulation& now) {
  return of_peak(now.monitor().stop_rest(now.state()));
}
std::optional<Figure> lcp_failures(const Simulation& now) {
  return Figure{static_cast<double>(now.ledger().lcp_failures()), std::nullopt, ""};
}
std::optional<Figure> steady_error(const Simulation& now) {
  std::optional<Figure> out;
  for (const simulation::AxisTracking& axis : now.tracking())
    if (axis.holds > 0 && (!out || axis.steady_error.value > out->value))
      out = {axis.steady_error.value, axis.steady_error.time, axis.name};
  return out;
}

/// The worst of the scene's grasps.
template <double simulation::GraspFigures::*field>
std::optional<Figure> of_grasps(const Simulation& now) {
  std::optional<Figure> out;
  for (const simulation::GraspFigures& grasp : now.grasps())
    if (grasp.complete && (!out || grasp.*field > out->value)) out = {grasp.*field, std::nullopt, grasp.name};
  return out;
}
std::optional<Figure> grasp_epsilon(const Simulation& now) {
  std::optional<Figure> out;
  for (const simulation::GraspFigures& grasp : now.grasps())
    if (grasp.complete && (!out || grasp.after.wrenches.epsilon < out->value))
      out = {grasp.after.wrenches.epsilon, std::nullopt, grasp.name};
  return out;
}

template <class M>
std::unique_ptr<Measure> make_of_scene(const scene::Scene& scene, const MeasureSpec& spec) {
  if constexpr (std::is_constructible_v<M, const scene::Scene&, const MeasureSpec&>)
    return std::make_unique<M>(scene, spec);
  else if constexpr (std::is_constructible_v<M, const scene::Scene&>)
    return std::make_unique<M>(scene);
  else if constexpr (std::is_constructible_v<M, const MeasureSpec&>)
    return std::make_unique<M>(spec);
  else
    return std::make_unique<M>();
}

constexpr MeasureNeeds kBody = {.body = true}, kJoint = {.joint = true};
using D = Dimension;

const std::array kKinds = {
    MeasureKind{"completes", "the run ends without a fault", D::none, "", false, {}, make_kept<completes>},
    MeasureKind{"energy_gain",
                "largest gain of energy over the start's, in largest kinetic energies",
                D::none,
                "",
                false,
                {},
                make_energy<Energy::What::gain>},
    MeasureKind{"energy_error",
                "largest change of energy, in largest kinetic energies",
                D::none,
                "",
                false,
                {},
                make_energy<Energy::What::error>},
    MeasureKind{"energy_loss",
                "energy lost at the end, in largest kinetic energies",
                D::none,
                "",
                false,
                {},
                make_energy<Energy::What::loss>},
    MeasureKind{"energy_rise",
                "largest rise of energy over its lowest so far, in largest kinetic energies",
                D::none,
                "",
                false,
                {},
                make_energy<Energy::What::rise>},
    MeasureKind{"momentum_error",
                "largest change of angular momentum, relative",
                D::none,
                "",
                false,
                {},
                make_of_scene<Momentum>},
    MeasureKind{"joint_gap", "largest gap of any joint", D::length, "m", false, {}, make_kept<joint_gap>},
    MeasureKind{"axis_error",
                "largest |a.b| of the axes of universal joints",
                D::none,
                "",
                false,
                {},
                make_of_scene<AxisError>},
    MeasureKind{"stop_overshoot",
                "largest overshoot of a stop beyond impact rate times step",
                D::angle,
                "rad",
                false,
                {},
                make_kept<stop_overshoot>},
    MeasureKind{"stop_rest",
                "largest overshoot of a stop at the end",
                D::angle,
                "rad",
                false,
                {},
                make_kept<stop_rest>},
    MeasureKind{"stop_late", "overshoot from ten steps after the stop was hit on", D::angle, "rad", false,
                kJoint, make_stop_hit<StopHit::What::late>},
    MeasureKind{"rebound_error", "rebound rate over impact rate, off the stop's bounce", D::none, "", false,
                kJoint, make_stop_hit<StopHit::What::rebound>},
    MeasureKind{"wraps", "jumps of an angle by half a turn and more", D::none, "", false, kJoint,
                make_jumps<Jumps::What::wraps>},
    MeasureKind{"rate_jump", "largest change of a rate in one step, over the largest rate", D::none, "",
                false, kJoint, make_jumps<Jumps::What::rate>},
    MeasureKind{"acceleration",
                "largest change of a joint's rate in a step, over the step",
                D::none,
                "rad/s2",
                false,
                {},
                make_of_scene<Acceleration>},
    MeasureKind{"slider_error",
                "slider off its place at the crank's angle",
                D::length,
                "m",
                false,
                {.body = true, .joint = true, .crank = true},
                make_of_scene<SliderError>},
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
    MeasureKind{"slide_error", "speed on an incline off g (sin a - mu cos a) t, relative", D::none, "", false,
                kBody, make_incline<Incline::What::slide>},
    MeasureKind{"creep", "mean speed on an incline that holds", D::speed, "m/s", false, kBody,
                make_incline<Incline::What::creep>},
    MeasureKind{"roll_error", "speed of a ball off g sin a t / (1 + I / (m r^2)), relative", D::none, "",
                false, kBody, make_incline<Incline::What::roll>},
    MeasureKind{"speed_error", "speed of a body off a closed form, relative", D::none, "", false, kBody,
                make_of_scene<SpeedError>},
    MeasureKind{"penetration", "deepest contact", D::length, "m", false, {}, make_of_scene<Penetration>},
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
    MeasureKind{
        "lcp_failures", "times that the solver gave up", D::none, "", false, {}, make_kept<lcp_failures>},
    MeasureKind{
        "steady_error", "largest error of a held pose", D::angle, "rad", false, {}, make_kept<steady_error>},
    MeasureKind{"grasp_slip",
                "mean drift of a grasped object in the palm",
                D::speed,
                "m/s",
                false,
                {},
                make_kept<of_grasps<&simulation::GraspFigures::slip>>},
    MeasureKind{"grasp_shift",
                "movement of a grasped object in the palm by the shake",
                D::length,
                "m",
                false,
                {},
                make_kept<of_grasps<&simulation::GraspFigures::shift>>},
    MeasureKind{"grasp_turn",
                "turn of a grasped object in the palm by the shake",
                D::angle,
                "rad",
                false,
                {},
                make_kept<of_grasps<&simulation::GraspFigures::turn>>},
    MeasureKind{"grasp_epsilon",
                "smallest wrench that breaks the grasp (Ferrari and Canny)",
                D::none,
                "",
                true,
                {},
                make_kept<grasp_epsilon>},
    MeasureKind{"mirror_error",
                "distance of a right hand's body from the left's mirror image",
                D::length,
                "m",
                false,
                {},
                make_of_scene<Mirror>},
    MeasureKind{"memory_growth",
                "growth of resident memory from a tenth of the run on, as a share",
                D::none,
                "",
                false,
                {},
                make_of_scene<Memory>},
    MeasureKind{"reaction_error", "force through a joint at rest off the weight that hangs on it, relative",
                D::none, "", false, kJoint, make_of_scene<Reaction>},
    MeasureKind{"convergence",
                "slope of log position error over log step, the ladder's smallest step being the reference",
                D::none,
                "",
                true,
                {.steps = true},
                nullptr,
                convergence},
    MeasureKind{"energy_order",
                "order in the step of the largest energy error; infinite where energy is kept to 1e-7",
                D::none,
                "",
                true,
                {.steps = true},
                nullptr,
                energy_order},
    MeasureKind{"release_ratio", "first rates off a stop over those without stops", D::none, "", false,
                kJoint, nullptr, release_ratio},
    MeasureKind{
        "repeats",
        "runs whose bits differ: again, eight threads at once, beside others, after restore and reset",
        D::none,
        "",
        false,
        {},
        nullptr,
        repeats},
    MeasureKind{"twin",
                "distance of bodies from those of the run with other settings",
                D::length,
                "m",
                false,
                {.set = true},
                nullptr,
                twin},
    MeasureKind{"round_trip",
                "torques found back from the motion that they make, relative",
                D::none,
                "",
                false,
                {},
                nullptr,
                round_trip},
    MeasureKind{"abuse",
                "bad torques and states that are not refused, or that other worlds notice",
                D::none,
                "",
                false,
                {},
                nullptr,
                abuse},
};

}  // namespace

std::span<const MeasureKind> measure_kinds() { return kKinds; }

const MeasureKind* measure_kind(std::string_view name) {
  const auto at =
      std::find_if(kKinds.begin(), kKinds.end(), [&](const MeasureKind& kind) { return kind.name == name; });
  return at == kKinds.end() ? nullptr : &*at;
}

}  // namespace handsim::study
