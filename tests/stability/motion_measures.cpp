// Measures of hard cases: conserved quantities, motion, contact, figures of the monitors, memory.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "handsim/core/index.h"
#include "handsim/model/energy.h"
#include "stability/stability_measures.h"

namespace handsim::study {

namespace {

using simulation::Peak;
using simulation::Simulation;

/// Above the energy at the start, above or below it, below it at the end, above the lowest so far.
enum class Change { gain, error, loss, rise };

/// Change of the energy over the largest kinetic energy of the run.
template <Change change>
Sampler energy(const scene::Scene&, const MeasureSpec& spec) {
  return [=, start = std::optional<double>(), lowest = 0.0](const Simulation& now) mutable -> Sample {
    if (!within(spec, now)) return {};
    const double kinetic = model::kinetic_energy(now.model(), now.state());
    const double energy =
        kinetic + model::potential_energy(now.model(), now.state(), now.engine().settings().effects);
    if (!start) start = lowest = energy;
    lowest = std::min(lowest, energy);
    const double changes[] = {energy - *start, std::abs(energy - *start), *start - energy, energy - lowest};
    // Avoids a division by zero in scenes at rest.
    return Figure{changes[static_cast<std::size_t>(change)],
                  {},
                  {},
                  std::max(kinetic, std::numeric_limits<double>::min())};
  };
}

/// Linear and angular momentum about a moving point, and the sums of the amounts of m v; of r x m v and I w.
struct Momenta {
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
  double shifts = 0, turns = 0, mass = 0;
  Vec3 moment = Vec3::Zero();  ///< mass times mass centre
  Momenta(const Simulation& now, const std::vector<std::size_t>& bodies, const Vec3& point, const Vec3& v) {
    for (const std::size_t i : bodies) {
      const model::Body& body = now.model().bodies[i];
      const model::BodyState& at = now.state().bodies[i];
      const Vec3 arm = body.mass * (at.p - point).cross(at.v - v), p = body.mass * at.v;
      const Vec3 spin = at.q * (body.inertia * (at.q.conjugate() * at.w));
      linear += p, angular += arm + spin, mass += body.mass, moment += body.mass * at.p;
      shifts += p.norm(), turns += arm.norm() + spin.norm();
    }
  }
};

/// Change of the linear momentum, less gravity's, or of the angular momentum in the frame that flies on as
/// the common mass centre did at the start; over the largest sums of amounts. The larger of the two.
Sampler momentum(const scene::Scene& scene, const MeasureSpec& spec) {
  return [bodies = bodies_of(scene, spec), start = std::optional<Momenta>(), first = 0.0, shifts = 0.0,
          turns = 0.0](const Simulation& now) mutable -> Sample {
    const Momenta any = start.value_or(Momenta(now, bodies, Vec3::Zero(), Vec3::Zero()));
    if (!start) first = now.state().time;
    const double time = now.state().time - first;
    const Vec3 v = any.linear / any.mass;
    const Momenta here(now, bodies, any.moment / any.mass + time * v, v);
    if (!start) start = here, start->moment = any.moment;
    shifts = std::max(shifts, here.shifts), turns = std::max(turns, here.turns);
    const bool falls = now.engine().settings().effects.has(model::Effect::gravity);
    const Vec3 weight = falls ? Vec3(any.mass * now.model().gravity) : Vec3(Vec3::Zero());
    const double tiny = std::numeric_limits<double>::min();
    const double shift = (here.linear - start->linear - time * weight).norm() / std::max(shifts, tiny);
    const double turn = (here.angular - start->angular).norm() / std::max(turns, tiny);
    return Figure{std::max(shift, turn), shift > turn ? "linear" : "angular"};
  };
}

/// Speed of the fastest body. @tparam first_step only in the first step
template <bool first_step>
Sampler speed(const scene::Scene& scene, const MeasureSpec& spec) {
  return [=, bodies = bodies_of(scene, spec)](const Simulation& now) {
    Sample out;
    if (now.steps() == 0 || (first_step && now.steps() > 1) || !within(spec, now)) return out;
    for (const std::size_t i : bodies)
      keep_larger(out, now.state().bodies[i].v.norm(), now.model().bodies[i].name);
    return out;
  };
}

/// Root mean square of the speed over the run, of the body with the largest.
Sampler rms_speed(const scene::Scene& scene, const MeasureSpec& spec) {
  return [=, bodies = bodies_of(scene, spec), sums = std::vector<double>(scene.model.bodies.size(), 0.0),
          count = 0L](const Simulation& now) mutable {
    Sample out;
    if (now.steps() == 0 || !within(spec, now)) return out;
    ++count;
    for (const std::size_t i : bodies) {
      const double speed = now.state().bodies[i].v.norm();
      sums[i] += speed * speed;
      keep_larger(out, std::sqrt(sums[i] / static_cast<double>(count)), now.model().bodies[i].name);
    }
    return out;
  };
}

enum class Drift { distance, angle, mean_speed };

/// Motion of bodies since the start of the span: distance, angle, or mean speed.
template <Drift drift>
Sampler motion_since_start(const scene::Scene& scene, const MeasureSpec& spec) {
  return [=, bodies = bodies_of(scene, spec),
          start = std::optional<model::State>()](const Simulation& now) mutable {
    Sample out;
    if (!within(spec, now)) return out;
    if (!start) start = now.state();
    const double span = now.state().time - start->time;
    for (const std::size_t i : bodies) {
      const model::BodyState &from = start->bodies[i], &to = now.state().bodies[i];
      double value = (to.p - from.p).norm();
      if (drift == Drift::angle) value = rotation_vector(from.q.conjugate() * to.q).norm();
      if (drift == Drift::mean_speed && span > 0) value /= span;
      keep_larger(out, value, now.model().bodies[i].name);
    }
    return out;
  };
}

/// Relative error of a body's speed at the end of the span, compared with a closed form.
Sampler speed_error(const scene::Scene& scene, const MeasureSpec& spec) {
  if (!spec.expected) throw input_error("measures.expected", "nothing", "the speed in closed form");
  return [=, body = body_of(scene, spec.body)](const Simulation& now) {
    const double speed = now.state().bodies[body].v.norm();
    return within(spec, now) ? Sample{{std::abs(speed - *spec.expected) / *spec.expected}} : Sample();
  };
}

/// Largest change of a joint rate over the step [rad/s^2] (qacc in MuJoCo).
Sampler acceleration(const scene::Scene& scene, const MeasureSpec& spec) {
  return [=, step = scene.spec.solver.step, last = std::vector<double>()](const Simulation& now) mutable {
    const std::vector<double>& rates = now.state().u;
    Sample out;
    if (!last.empty() && within(spec, now))
      for (const model::Joint& joint : now.model().joints)
        for (std::size_t k = as_index(joint.first_dof); k < as_index(joint.first_dof + dof_count(joint.kind));
             ++k)
          keep_larger(out, std::abs(rates[k] - last[k]) / step, joint.name);
    last = rates;
    return out;
  };
}

/// Asymmetry of left and right hand in a scene that is mirror symmetric about the y-z plane.
Sampler mirror_error(const scene::Scene& scene, const MeasureSpec&) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 1; i < scene.model.bodies.size(); ++i) {
    const std::string& name = scene.model.bodies[i].name;
    if (name.starts_with("right.")) pairs.emplace_back(i, body_of(scene, "left." + name.substr(6)));
  }
  if (pairs.empty()) throw input_error("measures", "no hands", "a scene with a right and a left hand");
  return [pairs](const Simulation& now) {
    Sample out;
    for (const auto& [right, left] : pairs) {
      const Vec3 image = now.state().bodies[left].p.cwiseProduct(Vec3(-1, 1, 1));
      keep_larger(out, (now.state().bodies[right].p - image).norm(), now.model().bodies[right].name);
    }
    return out;
  };
}

/// Acceleration down a slope [m/s^2]: g (sin a - mu cos a), of a rolling body g sin a / (1 + I / m r^2).
double incline_acceleration(const model::Model& model, std::size_t index, bool rolls) {
  const model::Shape* ground = nullptr;
  const model::Shape* shape = nullptr;
  for (const model::Shape& candidate : model.shapes) {
    if (candidate.kind == model::ShapeKind::plane) ground = &candidate;
    if (as_index(candidate.body) == index) shape = &candidate;
  }
  if (!ground || !shape) throw input_error("measures", "no ground or no shape", "a body on a ground");
  const model::Material surface = model::combined(model.materials[as_index(ground->material)],
                                                  model.materials[as_index(shape->material)]);
  const Vec3 normal = ground->pose.q * Vec3::UnitZ();
  const double down = -model.gravity.dot(normal);
  const double along = (model.gravity + down * normal).norm();
  const model::Body& body = model.bodies[index];
  if (rolls) return along / (1 + body.inertia(0, 0) / (body.mass * shape->radius * shape->radius));
  return std::max(0.0, along - surface.friction * down);
}

/// Relative speed error of a body that starts at rest on an inclined ground, compared with the closed form.
template <bool rolls>
Sampler incline_error(const scene::Scene& scene, const MeasureSpec& spec) {
  const std::size_t body = body_of(scene, spec.body);
  return [=, acceleration = incline_acceleration(scene.model, body, rolls)](const Simulation& now) {
    const double expected = acceleration * now.state().time;
    if (!within(spec, now) || !(expected > 0)) return Sample();
    return Sample{{std::abs(now.state().bodies[body].v.norm() - expected) / expected}};
  };
}

/// Speed of a body on the ground: distance over time since the start of the span, without vibration.
Sampler creep(const scene::Scene& scene, const MeasureSpec& spec) {
  const std::size_t body = body_of(scene, spec.body);
  incline_acceleration(scene.model, body, false);
  return [=, start = std::optional<Vec3>(), start_time = 0.0](const Simulation& now) mutable -> Sample {
    const Vec3& place = now.state().bodies[body].p;
    if (!within(spec, now)) return {};
    if (start) return {{(place - *start).norm() / (now.state().time - start_time)}};
    start = place, start_time = now.state().time;
    return {};
  };
}

/// Depth of the deepest contact.
Sampler penetration(const scene::Scene&, const MeasureSpec& spec) {
  return [=](const Simulation& now) {
    Sample out;
    if (!within(spec, now)) return out;
    const auto name = [&](int shape) { return now.model().shapes[as_index(shape)].name; };
    const engine::Contact* deepest = nullptr;
    for (const engine::Contact& contact : now.engine().contacts())
      if (!deepest || contact.depth > deepest->depth) deepest = &contact;
    out.emplace();
    if (deepest) out = {deepest->depth, name(deepest->shape_a) + " in " + name(deepest->shape_b)};
    return out;
  };
}

/// Relative growth of the resident memory of the process after the first tenth of the run.
Sampler memory_growth(const scene::Scene&, const MeasureSpec&) {
  return [first = std::optional<double>()](const Simulation& now) mutable -> Sample {
    constexpr long kEvery = 1000;
    if (now.steps() < now.step_count() / 10 || (now.steps() + 1) % kEvery != 0) return {};
    std::ifstream file("/proc/self/statm");
    double all = 0, resident = 0;
    file >> all >> resident;
    if (!first) first = resident;
    return {{(resident - *first) / *first}};
  };
}

/// A figure of the simulation's monitors, read at the end.
template <Sample (*read)(const Simulation&)>
Sampler at_end(const scene::Scene&, const MeasureSpec&) {
  return read;
}

Sample of_peak(const Peak& peak) { return Figure{peak.value, peak.where, peak.time}; }
Sample completes(const Simulation&) { return Figure{}; }
Sample joint_gap(const Simulation& now) { return of_peak(now.get<simulation::Monitor>().joint_gap()); }
Sample stop_overshoot(const Simulation& now) {
  return of_peak(now.get<simulation::Monitor>().stop_overshoot());
}
Sample stop_rest(const Simulation& now) {
  return of_peak(now.get<simulation::Monitor>().stop_rest(now.state()));
}
Sample lcp_failures(const Simulation& now) {
  return Figure{static_cast<double>(now.get<simulation::Convergence>().lcp_failures())};
}
Sample steady_error(const Simulation& now) {
  Sample out;
  for (const simulation::AxisTracking& axis : now.figures<simulation::Tracking>())
    if (axis.holds > 0 && (!out || axis.steady_error.value > out->value))
      out = {axis.steady_error.value, axis.name, axis.steady_error.time};
  return out;
}

/// The largest value among the scene's grasps.
template <double simulation::GraspFigures::*field>
Sample of_grasps(const Simulation& now) {
  Sample out;
  for (const simulation::GraspFigures& grasp : now.figures<simulation::Grasps>())
    if (grasp.complete) keep_larger(out, grasp.*field, grasp.name);
  return out;
}
Sample grasp_epsilon(const Simulation& now) {
  Sample out;
  for (const simulation::GraspFigures& grasp : now.figures<simulation::Grasps>())
    if (grasp.complete && (!out || grasp.after.wrenches.epsilon < out->value))
      out = {grasp.after.wrenches.epsilon, grasp.name};
  return out;
}

using D = Dimension;
using R = Reduce;
using Grasp = simulation::GraspFigures;

const MeasureKind kMotionMeasures[] = {
    // name, dimension, unit, reduce, make, needs
    {"completes", D::none, "", R::at_end, at_end<completes>},
    {"joint_gap", D::length, "m", R::at_end, at_end<joint_gap>},
    {"stop_overshoot", D::angle, "rad", R::at_end, at_end<stop_overshoot>},
    {"stop_rest", D::angle, "rad", R::at_end, at_end<stop_rest>},
    {"lcp_failures", D::none, "", R::at_end, at_end<lcp_failures>},
    {"steady_error", D::angle, "rad", R::at_end, at_end<steady_error>},
    {"grasp_slip", D::speed, "m/s", R::at_end, at_end<of_grasps<&Grasp::slip>>},
    {"grasp_shift", D::length, "m", R::at_end, at_end<of_grasps<&Grasp::shift>>},
    {"grasp_turn", D::angle, "rad", R::at_end, at_end<of_grasps<&Grasp::turn>>},
    {"grasp_epsilon", D::none, "", R::at_end, at_end<grasp_epsilon>, {}, true},
    {"memory_growth", D::none, "", R::largest, memory_growth},
    {"energy_gain", D::none, "", R::largest, energy<Change::gain>},
    {"energy_error", D::none, "", R::largest, energy<Change::error>},
    {"energy_loss", D::none, "", R::last, energy<Change::loss>},
    {"energy_rise", D::none, "", R::largest, energy<Change::rise>},
    {"momentum_error", D::none, "", R::largest, momentum},
    {"top_speed", D::speed, "m/s", R::largest, speed<false>},
    {"rms_speed", D::speed, "m/s", R::total, rms_speed},
    {"first_speed", D::speed, "m/s", R::largest, speed<true>},
    {"drift", D::length, "m", R::largest, motion_since_start<Drift::distance>},
    {"turn", D::angle, "rad", R::largest, motion_since_start<Drift::angle>},
    {"slip_speed", D::speed, "m/s", R::last, motion_since_start<Drift::mean_speed>},
    {"speed_error", D::none, "", R::last, speed_error, "body"},
    {"acceleration", D::none, "rad/s2", R::largest, acceleration},
    {"mirror_error", D::length, "m", R::largest, mirror_error},
    {"slide_error", D::none, "", R::last, incline_error<false>, "body"},
    {"creep", D::speed, "m/s", R::last, creep, "body"},
    {"roll_error", D::none, "", R::last, incline_error<true>, "body"},
    {"penetration", D::length, "m", R::largest, penetration}};

}  // namespace

std::span<const MeasureKind> motion_measures() { return kMotionMeasures; }

}  // namespace handsim::study
