// Exported models in OpenSim (PyPI: opensim). Oracle: OpenSim's own mass, centre of mass, inverse dynamics
// and inverse kinematics, against the model and the articulated engine.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "handsim/engine/articulated/dynamics/joint_space.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/markers.h"
#include "output/export/opensim.h"
#include "scene_files.h"
#include "support/written.h"

namespace handsim::test {
namespace {

namespace fs = std::filesystem;

constexpr int kSamples = 100;
constexpr double kStep = 0.01;  ///< between samples [s]

/// Coordinates of a model in smooth motion between its stops.
struct Motion {
  std::vector<std::string> names;
  std::vector<double> middle, swing, rate;

  explicit Motion(const model::Model& model) {
    for (const model::Joint& joint : model.joints)
      for (const model::JointAxis& axis : joint.axes) {
        names.push_back(joint.name + "." + axis.name);
        const double k = static_cast<double>(names.size());
        middle.push_back(0.5 * (axis.stop->low + axis.stop->high));
        swing.push_back(0.3 * (axis.stop->high - axis.stop->low));
        rate.push_back(4 + std::fmod(1.7 * k, 5));
      }
  }
  double angle(std::size_t k, double time, int derivative) const {
    const double w = rate[k], phase = w * time + static_cast<double>(k);
    if (derivative == 0) return middle[k] + swing[k] * std::sin(phase);
    return derivative == 1 ? swing[k] * w * std::cos(phase) : -swing[k] * w * w * std::sin(phase);
  }
  std::vector<double> at(double time, int derivative) const {
    std::vector<double> out;
    for (std::size_t k = 0; k < names.size(); ++k) out.push_back(angle(k, time, derivative));
    return out;
  }
};

Vec3 centre_of_mass(const model::Model& model, const model::State& state) {
  Vec3 sum = Vec3::Zero();
  double mass = 0;
  for (std::size_t i = 1; i < model.bodies.size(); ++i) {
    sum += model.bodies[i].mass * state.bodies[i].p;
    mass += model.bodies[i].mass;
  }
  return sum / mass;
}

/// How a free palm turns and travels about its wrist, relative to the start.
Pose palm_motion(double time) {
  return {Vec3(0.02 * std::sin(3 * time), 0.1 * time, 0),
          rotation_quaternion(Vec3(0.4 * std::sin(2 * time), 0.3 * time, -0.5 * std::sin(time)))};
}

/// The state at a time of the motion. Palms without a joint keep their start; `free` ones move.
model::State state_of(const model::Model& model, const Motion& motion, double time) {
  model::State state = model::initial_state(model);
  for (const model::HandIndex& hand : model.hands) {
    const auto palm = static_cast<std::size_t>(hand.palm);
    if (model.bodies[palm].kinematic) continue;
    const Pose wrist = state.bodies[palm].pose() * hand.wrist_frame;
    const Pose pose = wrist * palm_motion(time) * hand.wrist_frame.inverse();
    state.bodies[palm].p = pose.p;
    state.bodies[palm].q = pose.q;
  }
  const std::vector<double> u(motion.names.size(), 0.0);
  model::place_joints(model, motion.at(time, 0), u, state);
  return state;
}

/// Marker positions in the file that motion capture writes [m].
void write_trc(const fs::path& path, const model::Model& model, const Motion& motion) {
  const std::vector<model::Marker> markers = model::hand_markers(model);
  std::ofstream out(path);
  out.precision(17);
  out << "PathFileType\t4\t(X/Y/Z)\tmarkers.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\t"
         "OrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n100\t100\t"
      << kSamples << '\t' << markers.size() << "\tm\t100\t1\t" << kSamples << "\nFrame#\tTime";
  for (const model::Marker& marker : markers) out << '\t' << marker.name << "\t\t";
  out << "\n\t";
  for (std::size_t k = 1; k <= markers.size(); ++k) out << "\tX" << k << "\tY" << k << "\tZ" << k;
  out << "\n\n";
  for (int i = 0; i < kSamples; ++i) {
    const model::State state = state_of(model, motion, kStep * i);
    out << i + 1 << '\t' << kStep * i;
    for (const model::Marker& marker : markers) {
      const Vec3 p = state.bodies[static_cast<std::size_t>(marker.body)].pose() * marker.point;
      out << '\t' << p.x() << '\t' << p.y() << '\t' << p.z();
    }
    out << '\n';
  }
}

json ask(const scene::Scene& scene, const Motion& motion, int samples, const std::vector<double>& times) {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "model.osim") << test::written("osim", scene.model, scene.spec.solver);
  if (samples > 0) write_trc(folder.path() / "markers.trc", scene.model, motion);
  json question = {
      {"names", motion.names}, {"samples", json::array()}, {"times", times}, {"kinematics", samples > 0}};
  for (int i = 0; i < samples; ++i)
    question["samples"].push_back(
        {{"q", motion.at(kStep * i, 0)}, {"u", motion.at(kStep * i, 1)}, {"du", motion.at(kStep * i, 2)}});
  std::ofstream(folder.path() / "motion.json") << question;
  return opensim_answer(folder.path());
}

/// Torques that the motion needs beside tissue, by recursive Newton-Euler here. For models whose joints are
/// hinges.
std::vector<std::map<std::string, double>> torques(const scene::Scene& scene, const Motion& motion) {
  engine::articulated::Mechanism mechanism(scene.model, scene.spec.solver,
                                           engine::articulated::kernels().front());
  mechanism.load_state(model::initial_state(scene.model));
  engine::articulated::JointSpace space(mechanism);
  const auto n = static_cast<std::size_t>(space.size());
  const auto& nodes = mechanism.topology().nodes;
  std::vector<std::map<std::string, double>> out;
  for (int sample = 0; sample < kSamples; ++sample) {
    const double time = kStep * sample;
    std::vector<double> du(n), tau(n);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const model::Joint& joint = scene.model.joints[static_cast<std::size_t>(*nodes[i].joint)];
      const auto dof = static_cast<std::size_t>(joint.first_dof + nodes[i].axis_index);
      mechanism.q()[mechanism.slot(i).q] = motion.angle(dof, time, 0);
      mechanism.u()[mechanism.slot(i).u] = motion.angle(dof, time, 1);
      du[mechanism.slot(i).u] = motion.angle(dof, time, 2);
    }
    mechanism.update_bases();
    mechanism.kernel().kinematics(mechanism.tree());
    mechanism.kernel().prepare_smooth(mechanism.tree());
    space.inverse_dynamics(du, tau);
    std::map<std::string, double> row;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const model::Joint& joint = scene.model.joints[static_cast<std::size_t>(*nodes[i].joint)];
      const auto dof = static_cast<std::size_t>(joint.first_dof + nodes[i].axis_index);
      const auto& tissue = joint.axes[static_cast<std::size_t>(nodes[i].axis_index)].tissue;
      double passive = 0;
      if (tissue && scene.spec.solver.effects.has(model::Effect::passive_tissue))
        passive = -tissue->stiffness * (motion.angle(dof, time, 0) - tissue->rest) -
                  tissue->damping * motion.angle(dof, time, 1);
      row[motion.names[dof]] = tau[mechanism.slot(i).u] - passive;
    }
    out.push_back(std::move(row));
  }
  return out;
}

scene::Scene hands(const std::string& model, const std::string& mount) {
  const std::string file = source("handmodels/" + model + ".yaml").string();
  return shipped_scene(
      "two_hands", {"hands.0.model=" + file, "hands.1.model=" + file, "hands.0.pose={}", "hands.1.pose={}",
                    "hands.0.tissue={}", "hands.1.tissue={}", "hands.0.wrist.mount=" + mount,
                    model == "prototype" ? "effects=[gravity, joint_stops]"
                                         : "effects=[gravity, joint_stops, passive_tissue]"});
}

struct Agreement {
  double mass = 0, centre = 0, torque = 0, angle = 0;
};

/// Largest differences: mass relative, centre of mass [m], torques over the largest torque, angles of inverse
/// kinematics [rad].
Agreement agreement(const scene::Scene& scene, const Motion& motion, const json& found, bool with_torques) {
  Agreement out;
  double mass = 0;
  for (const model::Body& body : scene.model.bodies) mass += body.mass;
  out.mass = std::abs(found["mass"].get<double>() / mass - 1);
  for (std::size_t i = 0; i < kSamples; ++i) {
    const double time = kStep * static_cast<double>(i);
    // The script leaves free palms at their start.
    model::State state = model::initial_state(scene.model);
    model::place_joints(scene.model, motion.at(time, 0), motion.at(time, 1), state);
    const Vec3 centre = centre_of_mass(scene.model, state);
    for (int k = 0; k < 3; ++k)
      out.centre = std::max(
          out.centre, std::abs(found["centres"][i][static_cast<std::size_t>(k)].get<double>() - centre[k]));
    for (std::size_t k = 0; k < motion.names.size(); ++k)
      out.angle = std::max(
          out.angle, std::abs(found["angles"][i][motion.names[k]].get<double>() - motion.angle(k, time, 0)));
  }
  if (!with_torques) return out;
  double largest = 0;
  const auto expected = torques(scene, motion);
  for (std::size_t i = 0; i < kSamples; ++i)
    for (const auto& [name, tau] : expected[i]) {
      largest = std::max(largest, std::abs(tau));
      out.torque = std::max(out.torque, std::abs(found["torques"][i][name].get<double>() - tau));
    }
  out.torque /= largest;
  return out;
}

/// Of the free right palm's coordinates, turned about x, y and z: largest difference [rad], [m].
double palm_apart(const json& found) {
  double out = 0;
  for (std::size_t i = 0; i < kSamples; ++i) {
    const Pose want = palm_motion(kStep * static_cast<double>(i));
    const auto value = [&](const char* axis) {
      return found["angles"][i][std::string("right.palm.world.") + axis].get<double>();
    };
    const Quat turned = Eigen::AngleAxisd(value("rx"), Vec3::UnitX()) *
                        Eigen::AngleAxisd(value("ry"), Vec3::UnitY()) *
                        Eigen::AngleAxisd(value("rz"), Vec3::UnitZ());
    out = std::max({out, rotation_vector(turned * want.q.conjugate()).norm(),
                    (Vec3(value("tx"), value("ty"), value("tz")) - want.p).norm()});
  }
  return out;
}

class InOpenSim : public testing::TestWithParam<std::pair<const char*, const char*>> {
 protected:
  void SetUp() override {
    if (!opensim_is_there()) GTEST_SKIP() << kNoOpenSim;
  }
};

// Bounds: 1e-6 relative; 1e-6 rad of inverse kinematics, whose tool is told an accuracy of 1e-12.
TEST_P(InOpenSim, TheSameHandComesOut) {
  const scene::Scene scene = hands(GetParam().first, GetParam().second);
  const Motion motion(scene.model);
  const json found = ask(scene, motion, kSamples, {});
  ASSERT_FALSE(found.is_null());
  EXPECT_EQ(found["warnings"], json::array());
  const bool hinges = std::string(GetParam().second) != "free";
  const Agreement result = agreement(scene, motion, found, hinges);
  std::printf("OpenSim %s, %s hands, %s: mass %.1e, centre of mass %.1e m, torques %.1e, angles %.1e rad\n",
              found["version"].get<std::string>().c_str(), GetParam().first, GetParam().second, result.mass,
              result.centre, result.torque, result.angle);
  EXPECT_LT(result.mass, 1e-12);
  EXPECT_LT(result.centre, 1e-12);
  EXPECT_LT(result.torque, 1e-6);
  EXPECT_LT(result.angle, 1e-6);
  if (!hinges) {
    EXPECT_LT(palm_apart(found), 1e-6);
  }
  const auto& shapes = scene.model.shapes;
  EXPECT_EQ(found["contact"], 2 * std::count_if(shapes.begin(), shapes.end(), [](const model::Shape& shape) {
                                return shape.kind == model::ShapeKind::capsule;  // a sphere at both ends
                              }));
  const model::State start = model::initial_state(scene.model);
  std::size_t dof = 0;
  for (const model::Joint& joint : scene.model.joints)
    for (const model::JointAxis& axis : joint.axes)
      EXPECT_EQ(found["ranges"][joint.name + "." + axis.name],
                json({axis.stop->low, axis.stop->high, false, start.q[dof++]}))
          << joint.name;
}

INSTANTIATE_TEST_SUITE_P(Hands, InOpenSim,
                         testing::Values(std::pair("anatomical", "fixed"),
                                         std::pair("anatomical", "universal"),
                                         std::pair("anatomical", "free"), std::pair("prototype", "hinge")),
                         [](const auto& each) {
                           return std::string(each.param.first) + "_" + each.param.second;
                         });

class ScenesInOpenSim : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (!opensim_is_there()) GTEST_SKIP() << kNoOpenSim;
  }
};

void expect_poses(const model::Model& model, const model::State& expected, const json& found, double bound) {
  for (std::size_t i = 1; i < model.bodies.size(); ++i) {
    const json& body = found[model.bodies[i].name];
    const model::BodyState& want = expected.bodies[i];
    const Mat3 R = want.q.toRotationMatrix();
    for (int r = 0; r < 3; ++r) {
      const auto row = static_cast<std::size_t>(r);
      EXPECT_NEAR(body["p"][row].get<double>(), want.p[r], bound) << model.bodies[i].name;
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(body["R"][row][static_cast<std::size_t>(c)].get<double>(), R(r, c), 5 * bound)
            << model.bodies[i].name;
    }
  }
}

/// Velocities at the start. A driven palm's are those of a spline.
void expect_velocities(const model::Model& model, const json& found) {
  const model::State start = model::initial_state(model);
  for (std::size_t i = 1; i < model.bodies.size() && model.drives.empty(); ++i)
    for (int k = 0; k < 3; ++k) {
      const json& body = found[model.bodies[i].name];
      EXPECT_NEAR(body["v"][static_cast<std::size_t>(k)].get<double>(), start.bodies[i].v[k], 1e-12);
      EXPECT_NEAR(body["w"][static_cast<std::size_t>(k)].get<double>(), start.bodies[i].w[k], 1e-12);
    }
}

// Oracle: the model: poses and velocities at the start, driven palms at later times; OpenSim warns of
// nothing. Bounds: rounding; later the cubic spline through samples every 10 ms.
void expect_scene(const scene::Scene& scene) {
  std::vector<double> times = {0};
  if (!scene.model.drives.empty()) times.insert(times.end(), {0.3, 0.8, 1.1, 18.9, 19.4});
  const json found = ask(scene, Motion(model::Model{}), 0, times);
  ASSERT_FALSE(found.is_null());
  EXPECT_EQ(found["warnings"], json::array());
  expect_velocities(scene.model, found["poses"][0]);
  model::State state = model::initial_state(scene.model);
  const std::vector<double> u(state.q.size(), 0.0), q = state.q;
  for (std::size_t t = 0; t < times.size(); ++t) {
    for (const model::Drive& drive : scene.model.drives) {
      const Pose pose = drive.motion.at(times[t]) * drive.frame.inverse();
      state.bodies[static_cast<std::size_t>(drive.body)].p = pose.p;
      state.bodies[static_cast<std::size_t>(drive.body)].q = pose.q;
    }
    model::place_joints(scene.model, q, u, state);
    expect_poses(scene.model, state, found["poses"][t], t == 0 ? 1e-10 : 1e-5);
  }
}

TEST_P(ScenesInOpenSim, BodiesAreWhereTheSceneHasThem) { expect_scene(shipped_scene(GetParam())); }

INSTANTIATE_TEST_SUITE_P(Shipped, ScenesInOpenSim,
                         testing::Values("dropped_hand", "grasp_pinch", "object_collection", "pose_tracking",
                                         "climb_jug", "stability/pinch_capsules",
                                         "stability/universal_sweep"),
                         [](const auto& each) {
                           std::string name = each.param;
                           std::replace(name.begin(), name.end(), '/', '_');
                           return name;
                         });

TEST(OpenSim, HasBallJoints) {
  if (!opensim_is_there()) GTEST_SKIP() << kNoOpenSim;
  // The link turns about its joint, 0.05 m beside its centre.
  expect_scene(scene::compile_scene(
      parse_yaml("bodies: [{name: link, mass: 0.1, inertia: [8e-5, 1e-5, 8e-5], position: [0, 0.05, 0], "
                 "rotation: {axis: [1, 2, 3],"
                 " angle: 0.7}, angular_velocity: [0.7, 0.2, 1], velocity: [-0.05, 0, 0.035],"
                 " shape: {kind: sphere, radius: 0.01}}]\n"
                 "joints: [{name: cup, type: ball, parent: world, child: link, position: [0, 0, "
                 "0]}]\neffects: []\nduration: 1\n",
                 source("tests/none.yaml").string())));
}

TEST(OpenSim, RefusesLoops) {
  const scene::Scene scene = shipped_scene("slider_crank_iftomm");
  EXPECT_THROW(test::written("osim", scene.model, scene.spec.solver), Error);
}

}  // namespace
}  // namespace handsim::test
