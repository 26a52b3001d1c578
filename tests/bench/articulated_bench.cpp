// What a step of the articulated engine costs against a bare ODE loop on the same hand. Asserts nothing.
#include <benchmark/benchmark.h>
#include <Eigen/Cholesky>

#include <ode/ode.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "bench/one_hand.h"
#include "bench/paired.h"
#include "handsim/core/index.h"
#include "handsim/engine/articulated/articulated_engine.h"
#include "handsim/engine/articulated/derivatives/dynamics_slopes.h"
#include "handsim/engine/ode/ode_engine.h"
#include "handsim/model/kinematics.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::bench {
namespace {

/// Candidate: the engine's whole step, servos set each time. Yardstick: dWorldStep alone on the same hand,
/// its servos set once.
void step_against_bare_ode(benchmark::State& state, int width) {
  const Load load = one_hand();
  const model::State start = model::initial_state(load.scene.model);
  engine::ode::OdeEngine bare(load.scene.model, load.scene.spec.solver);
  engine::Settings settings = load.scene.spec.solver;
  settings.use(engine::ArticulatedMethod::semi_implicit_euler);
  const engine::articulated::Kernel* kernel = nullptr;
  for (const engine::articulated::Kernel* each : engine::articulated::kernels())
    if (each->width == width) kernel = each;
  if (width > 0 && !kernel) return state.SkipWithError("not on this processor");
  engine::articulated::ArticulatedEngine engine(load.scene.model, settings, kernel);
  compare(
      state, kSteps,
      [&] {
        bare.set_state(start);
        engine.set_state(start);
        bare.step({.servos = load.servos[0]});
      },
      [&] {
        for (int i = 0; i < kSteps; ++i) dWorldStep(bare.world_id(), settings.step);
      },
      [&] {
        for (std::size_t i = 0; i < kSteps; ++i) engine.step({.servos = load.servos[i % kTurns]});
      });
  state.SetLabel(engine.version());
}
BENCHMARK_CAPTURE(step_against_bare_ode, chosen, 0)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_against_bare_ode, one_lane, 1)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_against_bare_ode, four_lanes, 4)->UseManualTime()->Unit(benchmark::kMillisecond);

#ifdef HANDSIM_WITH_MUJOCO
/// Yardstick: mj_step on the exported hand, stops on, the same spring-dampers by its motors; no contact
/// tested, or self-contact of which nothing touches (counters: contacts of either at the end).
void step_against_mujoco(benchmark::State& state, bool self_contact) {
  const Load load = one_hand(self_contact);
  const Other other = in_mujoco(load.scene.model, load.scene.spec.solver);
  mjModel* m = other.model.get();
  mjData* d = other.data.get();
  if (!self_contact) m->opt.disableflags |= mjDSBL_CONTACT;
  // The servos' damping as the joints' own, which MuJoCo solves implicitly, as the engine does.
  for (int k = 0; k < m->nv; ++k) m->dof_damping[k] += load.servos[0][static_cast<std::size_t>(k)].damping;
  engine::Settings settings = load.scene.spec.solver;
  settings.use(engine::ArticulatedMethod::semi_implicit_euler);
  engine::articulated::ArticulatedEngine engine(load.scene.model, settings);
  const model::State start = model::initial_state(load.scene.model);
  int touching = 0;
  compare(
      state, kSteps,
      [&] {
        mj_resetDataKeyframe(m, d, 0);
        engine.set_state(start);
      },
      [&] {
        for (std::size_t i = 0; i < kSteps; ++i) {
          for (int k = 0; k < m->nu; ++k) {
            const model::Servo& servo = load.servos[i % kTurns][static_cast<std::size_t>(k)];
            d->ctrl[k] = servo.stiffness * servo.error;
          }
          mj_step(m, d);
          touching = std::max(touching, d->ncon);
        }
      },
      [&] {
        for (std::size_t i = 0; i < kSteps; ++i)
          touching = std::max(touching, engine.step({.servos = load.servos[i % kTurns]}).contacts);
      });
  state.counters["touching"] = touching;
  state.SetLabel(engine.version() + " against MuJoCo " + mj_versionString());
}
BENCHMARK_CAPTURE(step_against_mujoco, without_contact, false)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_against_mujoco, self_contact_tested, true)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
#endif

/// A shipped grasp in the midst of its hold: the palm still, the controller's springs as the joints' own.
scene::Scene held(const std::string& name) {
  const std::string effects =
      "effects=[gravity, object_contact, friction, joint_stops, passive_tissue, actuation, wrist_motion]";
  scene::Scene scene = test::shipped_scene(
      name,
      {effects, "solver.engine=articulated", "solver.method=semi_implicit_euler", "record.contacts=false"});
  simulation::Simulation simulation(scene);
  while (simulation.state().time < scene.plans.grasps.front().phase("hold")->start + 1) simulation.step();
  const model::State at = simulation.state();
  const std::vector<double> q = at.q;
  const std::span<const model::Servo> servos = simulation.controller()->servos();
  scene.model.drives.clear();
  scene.spec.solver.effects.remove(model::Effect::wrist_motion);
  scene.spec.solver.effects.remove(model::Effect::actuation);
  std::vector<bool> hangs(scene.model.bodies.size());
  for (const model::Joint& joint : scene.model.joints) hangs[static_cast<std::size_t>(joint.child)] = true;
  for (std::size_t i = 0; i < hangs.size(); ++i) {
    if (!hangs[i]) scene.model.bodies[i].zero_pose = at.bodies[i].pose();
    scene.model.bodies[i].initial_velocity = scene.model.bodies[i].initial_angular_velocity = Vec3::Zero();
  }
  for (model::Joint& joint : scene.model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a) {
      const std::size_t dof = static_cast<std::size_t>(joint.first_dof) + a;
      model::JointAxis& axis = joint.axes[a];
      axis.initial = q[dof];
      if (!(servos[dof].limit > 0)) continue;
      const model::Tissue own = axis.tissue.value_or(model::Tissue{});
      model::Tissue both{own.stiffness + servos[dof].stiffness, own.damping + servos[dof].damping, 0};
      const double push =
          own.stiffness * own.rest + servos[dof].stiffness * (q[dof] + servos[dof].error) + servos[dof].feed;
      both.rest = push / both.stiffness;
      axis.tissue = both;
    }
  scene.spec.solver.contact_forces = false;
  return scene;
}

constexpr int kHeldSteps = 1000;

/// How fast a body drifts between two places [um/s].
double drift(const Vec3& from, const Vec3& to, double step) {
  return 1e6 * (to - from).norm() / (kHeldSteps * step);
}

int object_of(const scene::Scene& scene) {
  const std::string& name = scene.plans.grasps.front().object;
  for (std::size_t i = 0; i < scene.model.bodies.size(); ++i)
    if (scene.model.bodies[i].name == name) return static_cast<int>(i);
  throw std::runtime_error(name);
}

/// Yardstick: dWorldStep's whole engine, collision included, from the same hold.
void grasp_against_ode(benchmark::State& state, const char* name) {
  const scene::Scene scene = held(name);
  engine::Settings settings = scene.spec.solver;
  engine::articulated::ArticulatedEngine engine(scene.model, settings);
  settings.use(engine::OdeMethod::world_step);
  engine::ode::OdeEngine ode(scene.model, settings);
  const model::State start = model::initial_state(scene.model);
  const auto object = static_cast<std::size_t>(object_of(scene));
  double contacts = 0, failures = 0, slips[2] = {};
  const auto run = [&](engine::Engine& each, double& slip) {
    const Vec3 from = each.state().bodies[object].p;
    for (int i = 0; i < kHeldSteps; ++i) {
      const engine::StepReport report = each.step({});
      contacts = report.contacts;
      failures += report.lcp_failures;
    }
    slip = drift(from, each.state().bodies[object].p, settings.step);
  };
  const auto prepare = [&](engine::Engine& each) {
    each.set_state(start);
    for (int i = 0; i < kHeldSteps / 2; ++i) each.step({});
  };
  compare(
      state, kHeldSteps,
      [&] {
        prepare(ode);
        prepare(engine);
      },
      [&] { run(ode, slips[0]); }, [&] { run(engine, slips[1]); });
  state.counters["slip_yardstick"] = slips[0];
  state.counters["slip"] = slips[1];
  state.counters["contacts"] = contacts;
  state.counters["failures"] = failures;
}
BENCHMARK_CAPTURE(grasp_against_ode, cup, "grasp_cup")->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(grasp_against_ode, pinch, "grasp_pinch")->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(grasp_against_ode, tripod, "grasp_tripod")->UseManualTime()->Unit(benchmark::kMillisecond);

#ifdef HANDSIM_WITH_MUJOCO
/// What may keep an object from creeping in MuJoCo.
using Firmness = void (*)(mjOption&);

void as_exported(mjOption& /*option*/) {}
void impratio_1(mjOption& option) {
  option.impratio = 1;
  option.noslip_iterations = 0;
}
void impratio_1e6(mjOption& option) {
  option.impratio = 1e6;
  option.noslip_iterations = 0;
  option.tolerance = 1e-12;
}
void noslip_100(mjOption& option) {
  option.noslip_iterations = 100;
  option.noslip_tolerance = 1e-12;
}
/// `impratio` would stiffen all edges of a pyramid, and with them the pad.
void pyramids(mjOption& option) {
  option.impratio = 1;
  option.cone = mjCONE_PYRAMIDAL;
}

/// Sum of the normal forces on the object in one more step [N].
double grip(const scene::Scene& scene, const model::State& at) {
  engine::Settings settings = scene.spec.solver;
  settings.contact_forces = true;
  engine::articulated::ArticulatedEngine engine(scene.model, settings);
  engine.set_state(at);
  engine.step({});
  double out = 0;
  for (const engine::Contact& contact : engine.contacts()) out += contact.normal_force();
  return out;
}

double grip(const mjModel* m, mjData* d) {
  double out = 0;
  for (int i = 0; i < d->ncon; ++i) {
    mjtNum force[6];
    mj_contactForce(m, d, i, force);
    out += force[0];
  }
  return out;
}

/// Yardstick: mj_step of the exported hold.
void grasp_against_mujoco(benchmark::State& state, const char* name, Firmness firmness) {
  const scene::Scene scene = held(name);
  const engine::Settings& settings = scene.spec.solver;
  engine::articulated::ArticulatedEngine engine(scene.model, settings);
  const model::State start = model::initial_state(scene.model);
  const int object = object_of(scene);
  const Other other = in_mujoco(scene.model, settings);
  mjModel* m = other.model.get();
  mjData* d = other.data.get();
  firmness(m->opt);
  const int body =
      mj_name2id(m, mjOBJ_BODY, scene.model.bodies[static_cast<std::size_t>(object)].name.c_str());
  double contacts[2] = {}, failures = 0, slips[2] = {};
  const auto place = [&] { return Vec3(d->xpos[3 * body], d->xpos[3 * body + 1], d->xpos[3 * body + 2]); };
  compare(
      state, kHeldSteps,
      [&] {
        mj_resetDataKeyframe(m, d, 0);
        engine.set_state(start);
        for (int i = 0; i < kHeldSteps / 2; ++i) {
          mj_step(m, d);
          engine.step({});
        }
      },
      [&] {
        const Vec3 from = place();
        for (int i = 0; i < kHeldSteps; ++i) mj_step(m, d);
        slips[0] = drift(from, place(), settings.step);
        contacts[0] = d->ncon;
      },
      [&] {
        const Vec3 from = engine.state().bodies[static_cast<std::size_t>(object)].p;
        for (int i = 0; i < kHeldSteps; ++i) {
          const engine::StepReport report = engine.step({});
          contacts[1] = report.contacts;
          failures += report.lcp_failures;
        }
        slips[1] = drift(from, engine.state().bodies[static_cast<std::size_t>(object)].p, settings.step);
      });
  state.counters["slip_yardstick"] = slips[0];
  state.counters["slip"] = slips[1];
  state.counters["grip_yardstick"] = grip(m, d);
  state.counters["grip"] = grip(scene, engine.state());
  state.counters["contacts_yardstick"] = contacts[0];
  state.counters["contacts"] = contacts[1];
  state.counters["failures"] = failures;
}
/// Grasps of 3, 7 and 19 contacts.
#define HELD_BY(grasp, setting)                                                        \
  BENCHMARK_CAPTURE(grasp_against_mujoco, grasp##_##setting, "grasp_" #grasp, setting) \
      ->UseManualTime()                                                                \
      ->Unit(benchmark::kMillisecond)
#define HELD(grasp)             \
  HELD_BY(grasp, as_exported);  \
  HELD_BY(grasp, impratio_1);   \
  HELD_BY(grasp, impratio_1e6); \
  HELD_BY(grasp, noslip_100);   \
  HELD_BY(grasp, pyramids)
HELD(tripod);
HELD(cylinder_100mm);
HELD(cup);
#endif

/// The poses of all bodies out of the joint coordinates.
void read_state(benchmark::State& state) {
  const Load load = one_hand();
  engine::Settings settings = load.scene.spec.solver;
  settings.use(engine::ArticulatedMethod::semi_implicit_euler);
  engine::articulated::ArticulatedEngine engine(load.scene.model, settings);
  model::State out = engine.state();
  for (auto unused : state) {
    (void)unused;
    engine.mechanism().store_state(out);
    benchmark::DoNotOptimize(out.bodies.data());
  }
}
BENCHMARK(read_state);

/// Derivatives of forward dynamics by positions and rates, and the inverse inertia: what Pinocchio's
/// computeABADerivatives finds, whose time is in tests/peers/derivatives.py. Counter: coordinates.
void derivatives_of_dynamics(benchmark::State& state) {
  const Load load = one_hand();
  engine::Settings settings = load.scene.spec.solver;
  settings.use(engine::ArticulatedMethod::semi_implicit_euler);
  engine::articulated::Mechanism mechanism(load.scene.model, settings);
  engine::articulated::DynamicsSlopes slopes(mechanism);
  model::State start = model::initial_state(load.scene.model);
  for (std::size_t i = 0; i < start.q.size(); ++i) {
    start.q[i] += 0.3 * std::sin(static_cast<double>(i));
    start.u[i] = std::cos(static_cast<double>(i));
  }
  mechanism.load_state(start);
  mechanism.update_bases();
  const int n = slopes.size();
  // Coordinates of a finger depend on no other finger's.
  using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 8, 8>;
  std::vector<std::vector<int>> fingers;
  std::vector<std::size_t> finger_of, rate;
  for (int i = 0; i < n; ++i) {
    rate.push_back(mechanism.slot(static_cast<std::size_t>(slopes.node(i))).u);
    const int parent = slopes.parent_dof(i);
    finger_of.push_back(parent < 0 ? fingers.size() : finger_of[static_cast<std::size_t>(parent)]);
    if (parent < 0) fingers.emplace_back();
    fingers[finger_of.back()].push_back(i);
  }
  std::vector<double> du(rate.size());
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Zero(n, n), by_q = inverse, by_u = inverse;
  for (auto unused : state) {
    (void)unused;
    mechanism.kernel().kinematics(mechanism.tree());
    mechanism.kernel().prepare_smooth(mechanism.tree());
    mechanism.kernel().solve(mechanism.tree());
    for (std::size_t i = 0; i < du.size(); ++i) du[i] = mechanism.du()[rate[i]];
    slopes.find(du);
    for (const std::vector<int>& finger : fingers) {
      const auto size = static_cast<Eigen::Index>(finger.size());
      const auto part = [&](const Eigen::MatrixXd& of) {
        Small out(size, size);
        for (Eigen::Index j = 0; j < size; ++j)
          for (Eigen::Index i = 0; i < size; ++i) out(i, j) = of(finger[as_index(i)], finger[as_index(j)]);
        return out;
      };
      const auto put = [&](const Small& found, Eigen::MatrixXd& to) {
        for (Eigen::Index j = 0; j < size; ++j)
          for (Eigen::Index i = 0; i < size; ++i) to(finger[as_index(i)], finger[as_index(j)]) = found(i, j);
      };
      const Small own = part(slopes.inertia()).llt().solve(Small::Identity(size, size));
      put(own, inverse);
      put(-own * part(slopes.by_position()), by_q);
      put(-own * part(slopes.by_rate()), by_u);
    }
    benchmark::DoNotOptimize(by_q.data());
    benchmark::DoNotOptimize(by_u.data());
  }
  state.counters["coordinates"] = n;
  state.counters["largest"] = by_q.cwiseAbs().maxCoeff();
}
BENCHMARK(derivatives_of_dynamics);

}  // namespace
}  // namespace handsim::bench
