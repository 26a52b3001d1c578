// Surfaces and drives of exported MJCF in MuJoCo. Oracles: closed forms, handsim's own runs, the model.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "handsim/control/controller.h"
#include "handsim/engine/collision/pair_table.h"
#include "handsim/engine/engine.h"
#include "handsim/model/kinematics.h"
#include "mujoco_model.h"
#include "scene_files.h"
#include "support/written.h"

namespace handsim::test {
namespace {

using ModelPointer = std::unique_ptr<mjModel, mujoco::Free>;
using DataPointer = std::unique_ptr<mjData, mujoco::Free>;

scene::Scene from(const std::string& text) {
  return scene::compile_scene(parse_yaml(text, source("tests/none.yaml").string()));
}

/// A scene in MuJoCo, at its keyframe.
struct There {
  ModelPointer model;
  DataPointer data;

  explicit There(const scene::Scene& scene)
      : model(mujoco::compile(test::written("mjcf", scene.model, scene.spec.solver,
                                            scene.control ? &*scene.control : nullptr))),
        data(mj_makeData(model.get())) {
    if (model->nkey > 0) mj_resetDataKeyframe(model.get(), data.get(), 0);
  }
  void run(double time) {
    while (data->time < time - 1e-9) mj_step(model.get(), data.get());
  }
  int id(mjtObj kind, const std::string& name) const {
    const int found = mj_name2id(model.get(), kind, name.c_str());
    EXPECT_GE(found, 0) << name;
    return found;
  }
  Vec3 position(const std::string& body) const {
    return Eigen::Map<const Vec3>(data->xpos + std::ptrdiff_t{3} * id(mjOBJ_BODY, body));
  }
};

model::State run_here(const scene::Scene& scene, double time) {
  const auto engine = engine::make_engine(scene.model, scene.spec.solver);
  const auto steps = static_cast<int>(std::lround(time / scene.spec.solver.step));
  for (int i = 0; i < steps; ++i) engine->step({});
  return engine->state();
}

std::size_t body_of(const model::Model& model, const std::string& name) {
  for (std::size_t i = 0; i < model.bodies.size(); ++i)
    if (model.bodies[i].name == name) return i;
  throw std::runtime_error("no body " + name);
}

// Oracle: the closed form, 3 m/s against friction sqrt(0.1 * 0.9) = 0.3: 3 t - 0.3 g t^2 / 2 = 1.529 m after
// 1 s. Bound: 1 %, there and here. MuJoCo's own rule, the greater coefficient, gives 0.51 m.
TEST(ExportedSurfaces, ABlockSlidesAsFarInMujocoAsHere) {
  for (const char* angle : {"0 deg", "30 deg", "45 deg"}) {
    const double turn = std::stod(angle) * M_PI / 180;
    const scene::Scene scene = from(
        "objects: [{name: block, shape: box, edges: [0.2, 0.2, 0.05], mass: 1, position: [0, 0, 0.025], "
        "friction: 0.1,"
        " velocity: [" +
        std::to_string(3 * std::cos(turn)) + ", " + std::to_string(3 * std::sin(turn)) +
        ", 0]}]\nground: {friction: 0.9}\ngravity: [0, 0, -9.80665]\nduration: 1\n"
        "solver: {engine: articulated, step: 0.001}\n");
    const double expected = 3 - 0.5 * 0.3 * 9.80665;
    There there(scene);
    there.run(1);
    const double slid_there = there.position("block").head<2>().norm();
    const double slid_here = run_here(scene, 1).bodies[body_of(scene.model, "block")].p.head<2>().norm();
    std::printf(
        "block of 0.1 on ground of 0.9, 3 m/s at %s, after 1 s: %.4f m in MuJoCo %s, %.4f m here, %.4f m by "
        "formula\n",
        angle, slid_there, mj_versionString(), slid_here, expected);
    EXPECT_NEAR(slid_there, expected, 0.01 * expected);
    EXPECT_NEAR(slid_here, expected, 0.01 * expected);
  }
}

// Oracle: the closed form on a slope of 35 degrees: g (sin - 0.3 cos) t^2 / 2 = 1.608 m after 1 s. Bound: 1
// %. With MuJoCo's own rule, the greater coefficient, the block stays.
TEST(ExportedSurfaces, ABlockSlidesDownASlopeAsFarInMujocoAsHere) {
  const double g = 9.80665, slope = 35 * M_PI / 180;
  const scene::Scene scene = from(
      "objects: [{name: block, shape: box, edges: [0.2, 0.2, 0.05], mass: 1, position: [0, 0, 0.025], "
      "friction: 0.1}]\n"
      "ground: {friction: 0.9}\ngravity: [" +
      std::to_string(g * std::sin(slope)) + ", 0, " + std::to_string(-g * std::cos(slope)) +
      "]\nduration: 1\nsolver: {engine: articulated, step: 0.001}\n");
  const double expected = 0.5 * g * (std::sin(slope) - 0.3 * std::cos(slope));
  There there(scene);
  there.run(1);
  const double slid_there = there.position("block").x();
  const double slid_here = run_here(scene, 1).bodies[body_of(scene.model, "block")].p.x();
  std::printf(
      "the block on a slope of 35 deg, after 1 s: %.4f m in MuJoCo %s, %.4f m here, %.4f m by formula\n",
      slid_there, mj_versionString(), slid_here, expected);
  EXPECT_NEAR(slid_there, expected, 0.01 * expected);
  EXPECT_NEAR(slid_here, expected, 0.01 * expected);
}

// Oracle: closed forms of a ball of radius r that loses speed by a moment of 1 mm times its weight, g 1 mm /
// (1.4 r), and of one that loses spin by 2 mm, g 2 mm / (0.4 r^2). Bound: 2 % of what is lost.
TEST(ExportedSurfaces, BallsRollAndSpinDownInMujoco) {
  const double g = 9.80665, r = 0.05;
  const scene::Scene scene = from(
      "objects:\n"
      "  - {name: rolling, shape: sphere, radius: 0.05, mass: 0.2, position: [0, 0, 0.05], velocity: [1, 0, "
      "0],"
      " angular_velocity: [0, 20, 0], material: rough}\n"
      "  - {name: spinning, shape: sphere, radius: 0.05, mass: 0.2, position: [0, 1, 0.05],"
      " angular_velocity: [0, 0, 30], material: rough}\n"
      "ground: {friction: 0.9}\ncontacts: {materials: [{name: rough, friction: 0.1, rolling_friction: 1 mm,"
      " spinning_friction: 2 mm}]}\ngravity: [0, 0, -9.80665]\nduration: 1\n"
      "solver: {engine: articulated, step: 0.001}\n");
  There there(scene);
  there.run(1);
  const double slowed = g * 0.001 / (1.4 * r), unspun = g * 0.002 / (0.4 * r * r);
  EXPECT_NEAR(there.position("rolling").x(), 1 - 0.5 * slowed, 0.02 * 0.5 * slowed);
  const int joint = there.id(mjOBJ_JOINT, "spinning");
  EXPECT_NEAR(there.data->qvel[there.model->jnt_dofadr[joint] + 5], 30 - unspun, 0.02 * unspun);
}

// Oracle: closed form: a ball on a spring-damper of 2000 N/m and 4 N s/m. Bound: 1 % of the depth at rest,
// 0.05 mm on the way (first-order steps of 0.1 ms).
TEST(ExportedSurfaces, APadSinksAndRisesAsASpring) {
  const double m = 0.2, k = 2000, c = 4, g = 9.80665, v0 = -0.1, r = 0.05;
  const scene::Scene scene = from(
      "objects: [{name: ball, shape: sphere, radius: 0.05, mass: 0.2, position: [0, 0, 0.05], velocity: [0, "
      "0, -0.1],"
      " material: pad}]\nground: {friction: 0.5}\ncontacts: {materials: [{name: pad, stiffness: 2000, "
      "damping: 4}]}\n"
      "gravity: [0, 0, -9.80665]\nduration: 1\nsolver: {engine: articulated, step: 0.0001}\n");
  There there(scene);
  ASSERT_EQ(there.model->npair, 1);
  const double d = c / (2 * m), w = std::sqrt(k / m - d * d), rest = -m * g / k;
  for (const double t : {0.005, 0.01, 0.02, 0.03}) {
    there.run(t);
    const double z =
        rest + std::exp(-d * t) * (-rest * std::cos(w * t) + (v0 - d * rest) / w * std::sin(w * t));
    EXPECT_NEAR(there.position("ball").z() - r, z, 5e-5) << t;
  }
  there.run(1.5);
  EXPECT_NEAR(there.position("ball").z() - r, rest, 0.01 * -rest);
}

// Oracle: one step of 1 ms of the spring-damper at its end, from each state of the way:
// v+ = (v - h (g + K r / m)) / (1 + h (c + h K) / m). Bound: rounding, and MuJoCo's solver.
TEST(ExportedSurfaces, APadActsAtTheStepsEnd) {
  const double m = 0.02, k = 3000, c = 10, g = 9.80665, h = 1e-3, radius = 0.05;
  const scene::Scene scene = from(
      "objects: [{name: ball, shape: sphere, radius: 0.05, mass: 0.02, position: [0, 0, 0.05], velocity: [0, "
      "0, -1],"
      " material: pad}]\nground: {friction: 0.5}\ncontacts: {materials: [{name: pad, stiffness: 3000, "
      "damping: 10}]}\n"
      "gravity: [0, 0, -9.80665]\nduration: 1\nsolver: {engine: articulated, step: 0.001}\n");
  There there(scene);
  const mjtNum *z = there.data->qpos + 2, *v = there.data->qvel + 2;
  int touching = 0;
  for (int step = 0; step < 100; ++step) {
    const double r = *z - radius, end = (*v - h * (g + k * r / m)) / (1 + h * (c + h * k) / m);
    const bool pressed = k * (r + h * end) + c * end < 0;
    mj_step(there.model.get(), there.data.get());
    if (r >= 0 || !pressed) continue;
    ++touching;
    EXPECT_NEAR(*v, end, 1e-9) << step;
  }
  EXPECT_GT(touching, 5);
}

// Oracle: the model's rules and materials: for all shapes whether MuJoCo may test them, and with what
// friction.
TEST(ExportedSurfaces, EveryPairHasTheRulesSurface) {
  for (const char* name : {"grasp_power_can", "two_hands_contact", "object_collection"}) {
    const scene::Scene scene = shipped_scene(name);
    const There there(scene);
    const mjModel& m = *there.model;
    std::map<std::pair<int, int>, int> pairs;
    for (int i = 0; i < m.npair; ++i) pairs[std::minmax(m.pair_geom1[i], m.pair_geom2[i])] = i;
    const engine::PairTable rules(scene.model);
    std::vector<bool> immovable;
    for (const model::Body& body : scene.model.bodies)
      immovable.push_back(body.kinematic || immovable.empty());
    const engine::UntestedPairs untested(scene.model, immovable);
    int ruled = 0, own = 0;
    for (const model::Shape& a : scene.model.shapes)
      for (const model::Shape& b : scene.model.shapes) {
        if (&a >= &b) continue;
        const int g = there.id(mjOBJ_GEOM, a.name), h = there.id(mjOBJ_GEOM, b.name);
        const auto pair = pairs.find(std::minmax(g, h));
        const bool touch = rules.meet(a.group, b.group) && !untested(a.body, b.body);
        if (!touch) {
          EXPECT_EQ(pair, pairs.end()) << name << ": " << a.name << " and " << b.name;
          continue;
        }
        ++ruled;
        const model::Material want = rules.between(a, b);
        if (pair == pairs.end()) {
          EXPECT_EQ(std::max(m.geom_friction[3 * g], m.geom_friction[3 * h]), want.friction)
              << a.name << b.name;
          EXPECT_FALSE(want.compliance);
          continue;
        }
        ++own;
        const mjtNum* friction = m.pair_friction + std::ptrdiff_t{5} * pair->second;
        EXPECT_EQ(friction[0], want.friction);
        EXPECT_EQ(friction[1], want.friction);
        EXPECT_EQ(friction[2], want.spinning_friction);
        EXPECT_EQ(friction[3], want.rolling_friction);
        EXPECT_EQ(m.pair_dim[pair->second], want.rolling_friction > 0    ? 6
                                            : want.spinning_friction > 0 ? 4
                                                                         : 3);
        if (!want.compliance) continue;
        // What MuJoCo makes of solimp and solref with its own mobilities of the two bodies. Bound: rounding.
        const double w = m.body_invweight0[2 * m.geom_bodyid[g]] + m.body_invweight0[2 * m.geom_bodyid[h]];
        const double d = m.pair_solimp[mjNIMP * pair->second], R = (1 - d) / d * w;
        const mjtNum* reference = m.pair_solref + std::ptrdiff_t{mjNREF} * pair->second;
        const double step = scene.spec.solver.step, stiffness = want.compliance->stiffness;
        EXPECT_NEAR(R * step * (want.compliance->damping + step * stiffness), 1, 1e-9) << a.name << b.name;
        EXPECT_NEAR(-reference[0] / (d * R * stiffness), 1, 1e-9) << a.name << b.name;
        EXPECT_NEAR(-reference[1] / d * step, 1, 1e-9) << a.name << b.name;
      }
    EXPECT_GT(ruled, 0) << name;
    if (std::string(name) == "grasp_power_can") {
      EXPECT_GT(own, 0);
    }
  }
}

// Oracle: the plan: gains and limits of each drive; axes without a drive keep a motor.
TEST(ExportedDrives, HaveThePlansGainsAndLimits) {
  const scene::Scene scene = shipped_scene("every_pose");
  const There there(scene);
  const mjModel& m = *there.model;
  ASSERT_TRUE(scene.control);
  EXPECT_EQ(m.nu, scene.model.dof_count());
  for (const control::DrivenAxis& axis : scene.control->axes) {
    const int i = there.id(mjOBJ_ACTUATOR, axis.name);
    EXPECT_EQ(m.actuator_gainprm[mjNGAIN * i], axis.proportional);
    EXPECT_EQ(m.actuator_biasprm[mjNBIAS * i + 1], -axis.proportional);
    EXPECT_EQ(m.actuator_biasprm[mjNBIAS * i + 2], -axis.derivative);
    EXPECT_EQ(m.actuator_forcerange[2 * i + 1], axis.torque_limit);
    EXPECT_EQ(m.actuator_forcerange[2 * i], -axis.torque_limit);
  }
}

// Oracle: the articulated engine with the same servos, without integral and feed-forward. Bound: 0.2 degrees
// on the way to targets 0.2 rad away, two first-order methods of 0.2 ms.
TEST(ExportedDrives, MoveTheHandAsServosDo) {
  scene::Scene scene = shipped_scene("every_pose", {"solver.engine=articulated", "solver.step=0.0002"});
  scene.control->gravity.reset();
  scene.control->tissue_compensation = false;
  for (control::DrivenAxis& axis : scene.control->axes) axis.integral = 0;
  There there(scene);
  const auto engine = engine::make_engine(scene.model, scene.spec.solver);
  control::Controller controller(scene.model, *scene.control, scene.spec.solver.step, engine->state());
  std::vector<double> targets;
  for (const control::DrivenAxis& axis : scene.control->axes) {
    const model::Stop& stop = *scene.model.joints[axis.joint].axes[axis.axis].stop;
    const double start = engine->state().q[axis.dof], middle = 0.5 * (stop.low + stop.high);
    targets.push_back(start + std::clamp(middle - start, -0.2, 0.2));
    there.data->ctrl[there.id(mjOBJ_ACTUATOR, axis.name)] = targets.back();
  }
  controller.set_targets(targets);
  double apart = 0, moved = 0;
  const std::vector<double> start = engine->state().q;
  for (int step = 1; step <= 1500; ++step) {
    controller.command(engine->state());
    engine->step({.servos = controller.servos()});
    controller.observe(engine->state());
    there.run(step * scene.spec.solver.step);
    for (const control::DrivenAxis& axis : scene.control->axes) {
      const int joint = there.id(mjOBJ_JOINT, axis.name);
      const double q = engine->state().q[axis.dof];
      apart = std::max(apart, std::abs(there.data->qpos[there.model->jnt_qposadr[joint]] - q));
      moved = std::max(moved, std::abs(q - start[axis.dof]));
    }
  }
  std::printf("drives: at most %.2e rad apart on a way of %.2f rad\n", apart, moved);
  EXPECT_GT(moved, 0.1);
  EXPECT_LT(apart, 0.2 * M_PI / 180);
}

}  // namespace
}  // namespace handsim::test
