// Procedures of hard cases: comparisons of several runs.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <thread>

#include <fmt/format.h>

#include "handsim/model/kinematics.h"
#include "handsim/model/newton_euler.h"
#include "handsim/study/stability/stability_measures.h"

namespace handsim::study {

namespace {

using simulation::Simulation;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Energy errors below this are rounding errors, which have no order of convergence.
constexpr double kConserved = 1e-7;
/// Largest torque of a round trip [N m]: in a step of 1 us it moves a finger by less than 1e-12 rad.
constexpr double kSmallTorque = 1e-7;

std::uint64_t hash_at_end(Simulation& simulation) {
  while (simulation.steps() < simulation.step_count()) simulation.step();
  return simulation.state_hash();
}

std::uint64_t hash_of_run(const scene::Scene& scene) {
  Simulation simulation(scene);
  return hash_at_end(simulation);
}

/// The hash of a run that another simulation continues from a snapshot of its middle, and that of a run after
/// a reset to the start.
std::pair<std::uint64_t, std::uint64_t> hashes_of_restored(const scene::Scene& scene) {
  Simulation first(scene), second(scene);
  const simulation::RunSnapshot start = first.snapshot();
  while (first.steps() < first.step_count() / 2) first.step();
  second.restore(first.snapshot());
  first.restore(start);
  return {hash_at_end(second), hash_at_end(first)};
}

using Positions = std::vector<std::vector<Vec3>>;

/// Positions of all bodies at multiples of `every` [s].
Positions positions_of(const scene::Scene& scene, double every) {
  Simulation simulation(scene);
  Positions out;
  const long stride = std::max(1L, std::lround(every / scene.spec.solver.step));
  for (long i = 1; i <= simulation.step_count(); ++i) {
    simulation.step();
    if (i % stride != 0) continue;
    out.emplace_back();
    for (const model::BodyState& body : simulation.state().bodies) out.back().push_back(body.p);
  }
  return out;
}

double largest_distance(const Positions& a, const Positions& b) {
  double out = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    for (std::size_t k = 0; k < a[i].size(); ++k) out = std::max(out, (a[i][k] - b[i][k]).norm());
  return out;
}

/// Slope of the straight line through (log x, log y), by least squares.
double log_slope(const std::vector<std::pair<double, double>>& points) {
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (const auto& [x, y] : points) {
    const double lx = std::log(x), ly = std::log(y);
    sx += lx, sy += ly, sxx += lx * lx, sxy += lx * ly;
  }
  const auto n = static_cast<double>(points.size());
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

bool same_bits(const model::State& a, const model::State& b) {
  for (std::size_t i = 0; i < a.bodies.size(); ++i)
    if (a.bodies[i].p != b.bodies[i].p || a.bodies[i].q.coeffs() != b.bodies[i].q.coeffs() ||
        a.bodies[i].v != b.bodies[i].v || a.bodies[i].w != b.bodies[i].w)
      return false;
  return true;
}

/// True if the call throws an Error.
template <class Call>
bool refused(Call call) {
  try {
    call();
  } catch (const Error&) {
    return true;
  }
  return false;
}

/// Slope of log position error over log step.
Figure convergence(const SceneMaker& scene, const MeasureSpec& spec) {
  // The run with the smallest step, the last one, is the reference.
  Positions reference;
  std::vector<std::pair<double, double>> errors;
  for (auto step = spec.steps.rbegin(); step != spec.steps.rend(); ++step) {
    const Positions run = positions_of(scene({"solver.step=" + number_text(*step)}), spec.steps.front() * 5);
    if (reference.empty())
      reference = run;
    else
      errors.emplace_back(*step, std::max(largest_distance(run, reference), 1e-300));
  }
  const auto& [step, error] = errors.back();
  return {log_slope(errors), fmt::format("{:.2g} m at {:g} ms", error, 1e3 * step), {}, errors};
}

/// Order of convergence of the largest energy error; infinite if the error is below kConserved.
Figure energy_order(const SceneMaker& scene, const MeasureSpec& spec) {
  MeasureSpec energy_error;
  energy_error.kind = "energy_error";
  std::vector<std::pair<double, double>> errors;
  for (const double step : spec.steps) {
    const scene::Scene of = scene({"solver.step=" + number_text(step)});
    Measure measure(of, energy_error);
    Simulation simulation(of);
    measure.update(simulation);
    for (long i = 0; i < simulation.step_count(); ++i) {
      simulation.step();
      measure.update(simulation);
    }
    errors.emplace_back(step, std::max(measure.figure()->value, 1e-300));
  }
  const auto& [step, error] = errors.front();
  const double order = error < kConserved ? kInfinity : log_slope(errors);
  return {order, fmt::format("{:.2g} at {:g} ms", error, 1e3 * step), {}, errors};
}

/// Rates of a joint in the first two steps from its stop over those in a run without stops.
Figure release_ratio(const SceneMaker& scene, const MeasureSpec& spec) {
  const scene::Scene with = scene({});
  const scene::Scene without = scene::without_effect(with, model::Effect::joint_stops);
  Simulation stopped(with), unstopped(without);
  const Coordinate coordinate = coordinate_of(with, spec.joint);
  const auto rate = [&](const Simulation& now) { return coordinate.rate(now.state()); };
  Figure out;
  for (int i = 0; i < 2; ++i) {
    stopped.step();
    unstopped.step();
    const double ratio = rate(stopped) / rate(unstopped);
    // The stop must release the joint.
    if (i == 1 && !(ratio > 0)) return {kInfinity, spec.joint, stopped.state().time};
    if (ratio > out.value) out = {ratio, spec.joint, stopped.state().time};
  }
  return out;
}

/// Number of runs with other bits: repeated, in eight threads, interleaved with another run, after restore
/// and reset.
Figure repeats(const SceneMaker& scene, const MeasureSpec&) {
  const scene::Scene of = scene({});
  const std::uint64_t reference = hash_of_run(of);
  Figure out;
  const auto compare = [&](std::uint64_t hash, const char* when) {
    if (hash == reference) return;
    ++out.value;
    out.where = when;
  };
  for (int i = 0; i < 3; ++i) compare(hash_of_run(of), "repeated");
  std::vector<std::uint64_t> hashes(8);
  std::vector<std::thread> threads;
  for (std::uint64_t& hash : hashes) threads.emplace_back([&] { hash = hash_of_run(of); });
  for (std::thread& thread : threads) thread.join();
  for (const std::uint64_t hash : hashes) compare(hash, "in eight threads");
  // Interleaved with a run with another seed.
  auto other = of;
  if (other.spec.solver.engine() == engine::EngineKind::ode) other.spec.solver.ode().seed = 77;
  Simulation beside(other), simulation(of);
  while (simulation.steps() < simulation.step_count()) {
    beside.step();
    simulation.step();
  }
  compare(simulation.state_hash(), "interleaved with another run");
  const auto [restored, reset] = hashes_of_restored(of);
  compare(restored, "after restore");
  compare(reset, "after reset");
  return out;
}

/// Largest distance of bodies from those of a run with other settings.
Figure twin(const SceneMaker& scene, const MeasureSpec& spec) {
  const scene::Scene a = scene({}), b = scene(spec.set);
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 1; i < a.model.bodies.size(); ++i)
    for (std::size_t k = 1; k < b.model.bodies.size(); ++k)
      if (a.model.bodies[i].name == b.model.bodies[k].name && a.model.bodies[i].name.starts_with(spec.body))
        pairs.emplace_back(i, k);
  if (pairs.empty())
    throw input_error("measures.body", spec.body, "the start of the name of a body of both runs");
  Simulation one(a), other(b);
  Figure out;
  for (long i = 0; i < one.step_count(); ++i) {
    one.step();
    other.step();
    for (const auto& [k, l] : pairs) {
      const double apart = (one.state().bodies[k].p - other.state().bodies[l].p).norm();
      if (apart > out.value) out = {apart, a.model.bodies[k].name, one.state().time};
    }
  }
  return out;
}

/// Relative error of torques that inverse dynamics computes from the motion of a step.
Figure round_trip(const SceneMaker& scene, const MeasureSpec&) {
  constexpr int kTrials = 200;
  const scene::Scene of = scene({});
  const bool falls = of.spec.solver.effects.has(model::Effect::gravity);
  const Vec3 gravity = falls ? of.model.gravity : Vec3(Vec3::Zero());
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Figure out;
  for (int i = 0; i < kTrials; ++i) {
    const auto engine = engine::make_engine(of.model, of.spec.solver);
    std::vector<double> q, tau;
    for (const model::Joint& joint : of.model.joints)
      for (const model::JointAxis& axis : joint.axes) {
        const double middle = axis.stop ? 0.5 * (axis.stop->low + axis.stop->high) : 0;
        const double half = axis.stop ? 0.5 * (axis.stop->high - axis.stop->low) : 1;
        q.push_back(middle + 0.9 * half * uniform(random));
        tau.push_back(kSmallTorque * uniform(random));
      }
    const model::State start = model::state_at(of.model, q);
    engine->set_state(start);
    engine->step({tau});
    model::NewtonEuler dynamics(of.model, gravity);
    dynamics.place(start, engine->state());
    const std::span<const double> found = dynamics.torques();
    double largest = 0, worst = 0;
    for (std::size_t k = 0; k < tau.size(); ++k) {
      largest = std::max(largest, std::abs(tau[k]));
      worst = std::max(worst, std::abs(tau[k] - found[k]));
    }
    if (worst / largest > out.value) out = {worst / largest, fmt::format("trial {}", i)};
  }
  return out;
}

/// Number of invalid torques and states that an engine accepts, or that change another engine.
Figure abuse(const SceneMaker& scene, const MeasureSpec&) {
  constexpr int kSteps = 100;
  const scene::Scene of = scene({});
  const auto fresh = [&] { return engine::make_engine(of.model, of.spec.solver); };
  const auto run = [](engine::Engine& engine, int steps) {
    for (int i = 0; i < steps; ++i) engine.step({});
  };
  const auto alone = fresh(), healthy = fresh();
  run(*alone, 2 * kSteps);
  run(*healthy, kSteps);
  Figure out;
  const auto expect = [&](bool good, const std::string& what) {
    if (good) return;
    ++out.value;
    out.where = what;
  };
  const auto dofs = static_cast<std::size_t>(of.model.dof_count());
  for (const double bad : {kNan, kInfinity, -kInfinity, 1e300, 1e200}) {
    const auto faulty = fresh();
    run(*faulty, 10);
    std::vector<double> tau(dofs, 0.0);
    tau.front() = bad;
    expect(refused([&] { faulty->step({tau}); }), fmt::format("a torque of {}", bad));
    const auto thrown = fresh();
    model::State state = thrown->state();
    state.bodies.back().v = state.bodies.back().w = Vec3::Constant(bad);
    expect(refused([&] {
             thrown->set_state(state);
             thrown->step({});
           }),
           fmt::format("a speed of {}", bad));
  }
  const auto faulty = fresh();
  model::State state = faulty->state();
  state.bodies.back().q = Quat(0, 0, 0, 0);
  expect(refused([&] { faulty->set_state(state); }), "a quaternion of zeros");
  const std::vector<double> many(dofs + 1, 0.0);
  expect(refused([&] { faulty->step({many}); }), "too many torques");
  run(*healthy, kSteps);
  expect(same_bits(healthy->state(), alone->state()), "another engine changed");
  return out;
}

constexpr MeasureNeeds kSteps = {.steps = true}, kSet = {.set = true};
using D = Dimension;

// name, dimension, unit, reduce, make, needs, procedure, at_least
const MeasureKind kProcedures[] = {{"convergence", D::none, "", {}, nullptr, kSteps, convergence, true},
                                   {"energy_order", D::none, "", {}, nullptr, kSteps, energy_order, true},
                                   {"release_ratio", D::none, "", {}, nullptr, kJoint, release_ratio},
                                   {"repeats", D::none, "", {}, nullptr, kNothing, repeats},
                                   {"twin", D::length, "m", {}, nullptr, kSet, twin},
                                   {"round_trip", D::none, "", {}, nullptr, kNothing, round_trip},
                                   {"abuse", D::none, "", {}, nullptr, kNothing, abuse}};

}  // namespace

std::span<const MeasureKind> procedures() { return kProcedures; }

}  // namespace handsim::study
