// Measures of hard cases: what surfaces do that touch.
#include <algorithm>
#include <array>
#include <cmath>

#include "handsim/study/stability/measure_tools.h"

namespace handsim::study {

namespace {

using simulation::Simulation;

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

using D = Dimension;

const std::array kSurfaceMeasures = {
    MeasureKind{"slide_error", "speed on an incline off g (sin a - mu cos a) t, relative", D::none, "", false,
                kNeedsBody, make_incline<Incline::What::slide>},
    MeasureKind{"creep", "mean speed on an incline that holds", D::speed, "m/s", false, kNeedsBody,
                make_incline<Incline::What::creep>},
    MeasureKind{"roll_error", "speed of a ball off g sin a t / (1 + I / (m r^2)), relative", D::none, "",
                false, kNeedsBody, make_incline<Incline::What::roll>},
    MeasureKind{"penetration", "deepest contact", D::length, "m", false, {}, make_of_scene<Penetration>}};

}  // namespace

std::span<const MeasureKind> surface_measures() { return kSurfaceMeasures; }

}  // namespace handsim::study
