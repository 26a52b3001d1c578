// Exported models in MuJoCo: it loads them without a word and computes the same dynamics as the articulated
// engine.
#include <gtest/gtest.h>

#include <mujoco/mujoco.h>

#include <cmath>
#include <fstream>
#include <random>

#include "handsim/engine/articulated/dynamics/joint_space.h"
#include "handsim/model/kinematics.h"
#include "scene_files.h"
#include "support/written.h"

namespace handsim::test {
namespace {

using engine::articulated::JointSpace;
using engine::articulated::LaneSlot;
using engine::articulated::Mechanism;

int warnings = 0;
void count_warning(const char* text) {
  ++warnings;
  ADD_FAILURE() << text;
}

struct Freed {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using OwnedModel = std::unique_ptr<mjModel, Freed>;
using OwnedData = std::unique_ptr<mjData, Freed>;

OwnedModel load(const std::string& text, const char* name) {
  mju_user_warning = count_warning;
  const TemporaryFolder folder;
  const std::string path = (folder.path() / name).string();
  std::ofstream(path) << text;
  char error[1000] = {};
  OwnedModel out(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
  EXPECT_STREQ(error, "");
  return out;
}

scene::Scene hand(const std::string& model, const std::string& mount) {
  return shipped_scene(
      "two_hands",
      {"hands.0.model=" + source("handmodels/" + model + ".yaml").string(),
       "hands.1.model=" + source("handmodels/" + model + ".yaml").string(), "hands.0.pose={}",
       "hands.1.pose={}", "hands.0.tissue={}", "hands.1.tissue={}", "hands.0.wrist.mount=" + mount,
       model == "prototype" ? "effects=[gravity, joint_stops]"
                            : "effects=[gravity, joint_stops, passive_tissue]"});
}

/// Where a node's rates stand in MuJoCo.
struct Match {
  std::size_t u = 0;
  int dof = 0;
  int q = 0;
  bool free = false;
};

std::vector<Match> matches(const Mechanism& mechanism, const model::Model& model, const mjModel& other) {
  std::vector<Match> out;
  for (std::size_t i = 0; i < mechanism.topology().nodes.size(); ++i) {
    const auto& node = mechanism.topology().nodes[i];
    const bool free = node.kind == engine::articulated::NodeKind::free;
    std::string name;
    if (free) {
      name = model.bodies[static_cast<std::size_t>(*node.body)].name;
    } else {
      const model::Joint& joint = model.joints[static_cast<std::size_t>(*node.joint)];
      name = joint.name + "." + joint.axes[static_cast<std::size_t>(node.axis_index)].name;
    }
    const int id = mj_name2id(&other, mjOBJ_JOINT, name.c_str());
    EXPECT_GE(id, 0) << name;
    out.push_back({mechanism.slot(i).u, other.jnt_dofadr[id], other.jnt_qposadr[id], free});
  }
  return out;
}

class InMujoco : public testing::TestWithParam<std::pair<const char*, const char*>> {};

/// Largest difference of two vectors over the largest entry.
double apart(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / std::max(1e-300, b.cwiseAbs().maxCoeff());
}

// Oracle: MuJoCo. Bound: 1e-9 relative, at 1000 random states.
TEST_P(InMujoco, TheSameDynamicsComeOut) {
  const scene::Scene scene = hand(GetParam().first, GetParam().second);
  const OwnedModel other = load(test::written("mjcf", scene.model, scene.spec.solver), "hand.xml");
  ASSERT_TRUE(other);
  const OwnedData data(mj_makeData(other.get()));
  other->opt.disableflags |= mjDSBL_CONSTRAINT;
  Mechanism mechanism(scene.model, scene.spec.solver, engine::articulated::kernels().front());
  mechanism.load_state(model::initial_state(scene.model));
  JointSpace space(mechanism);
  const int n = space.size();
  ASSERT_EQ(other->nv, n);
  const std::vector<Match> all = matches(mechanism, scene.model, *other);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(-1, 1);
  double forward = 0, inertia = 0, inverse = 0;
  std::vector<double> torques(static_cast<std::size_t>(scene.model.dof_count()));
  for (int sample = 0; sample < 1000; ++sample) {
    for (double& torque : torques) torque = 0.01 * u(random);
    mechanism.set_torques(torques);
    // The turn from MuJoCo's rates to the tree's: a free body's order, and its axes.
    Eigen::MatrixXd turn = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd theirs = Eigen::VectorXd::Zero(n);
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Match& match = all[i];
      const auto& node = mechanism.topology().nodes[i];
      const auto row = static_cast<Eigen::Index>(match.u);
      if (!match.free) {
        const double q = 1.2 * u(random);
        mechanism.q()[mechanism.slot(i).q] = data->qpos[match.q] = q;
        turn(row, match.dof) = 1;
        theirs[match.dof] = 5 * u(random);
        const model::Joint& joint = scene.model.joints[static_cast<std::size_t>(*node.joint)];
        data->qfrc_applied[match.dof] = torques[static_cast<std::size_t>(joint.first_dof + node.axis_index)];
        continue;
      }
      const Quat q_WB = rotation_quaternion(Vec3(u(random), u(random), u(random)) * 2);
      const Quat q_WL = q_WB * node.q_LB.conjugate();
      const double p[3] = {u(random), u(random), u(random)};
      for (std::size_t k = 0; k < 3; ++k)
        mechanism.q()[mechanism.slot(i).q + k] = data->qpos[match.q + static_cast<int>(k)] = p[k];
      const double w[4] = {q_WB.w(), q_WB.x(), q_WB.y(), q_WB.z()};
      for (int k = 0; k < 4; ++k) {
        mechanism.q()[mechanism.slot(i).q + 3 + static_cast<std::size_t>(k)] = q_WL.coeffs()[k];
        data->qpos[match.q + 3 + k] = w[k];
      }
      turn.block<3, 3>(row, match.dof + 3) = q_WB.toRotationMatrix();
      turn.block<3, 3>(row + 3, match.dof) = Mat3::Identity();
      for (int k = 0; k < 6; ++k) theirs[match.dof + k] = 2 * u(random);
    }
    const Eigen::VectorXd mine = turn * theirs;
    std::copy_n(mine.data(), n, mechanism.u().begin());
    std::copy_n(theirs.data(), n, data->qvel);
    mechanism.update_bases();
    mechanism.kernel().kinematics(mechanism.tree());
    mechanism.kernel().prepare_smooth(mechanism.tree());
    mechanism.kernel().solve(mechanism.tree());
    mj_forward(other.get(), data.get());
    const Eigen::Map<Eigen::VectorXd> du(mechanism.du().data(), n), qacc(data->qacc, n);
    forward = std::max(forward, apart(turn.transpose() * du, qacc));
    // Inertia.
    space.compute_inertia();
    Eigen::MatrixXd H(n, n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) H(i, j) = space.inertia(std::max(i, j), std::min(i, j));
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> full(n, n);
    mj_fullM(other.get(), full.data(), data->qM);
    const Eigen::MatrixXd turned = turn.transpose() * H * turn;
    inertia = std::max(inertia, (turned - full).cwiseAbs().maxCoeff() / full.cwiseAbs().maxCoeff());
    // Inverse dynamics at MuJoCo's accelerations: MuJoCo's own includes the tissue.
    const Eigen::VectorXd acceleration = turn * qacc;
    Eigen::VectorXd tau(n);
    space.inverse_dynamics({acceleration.data(), static_cast<std::size_t>(n)},
                           {tau.data(), static_cast<std::size_t>(n)});
    mj_inverse(other.get(), data.get());
    const Eigen::Map<Eigen::VectorXd> found(data->qfrc_inverse, n), passive(data->qfrc_passive, n);
    inverse = std::max(inverse, apart(turn.transpose() * tau, found + passive));
  }
  RecordProperty("forward", std::to_string(forward * 1e12) + "e-12");
  RecordProperty("inertia", std::to_string(inertia * 1e12) + "e-12");
  RecordProperty("inverse", std::to_string(inverse * 1e12) + "e-12");
  EXPECT_LT(forward, 1e-9);
  EXPECT_LT(inertia, 1e-9);
  EXPECT_LT(inverse, 1e-9);
  EXPECT_EQ(warnings, 0);
}

INSTANTIATE_TEST_SUITE_P(Hands, InMujoco,
                         testing::Values(std::pair("anatomical", "fixed"),
                                         std::pair("anatomical", "universal"),
                                         std::pair("anatomical", "free"), std::pair("prototype", "fixed"),
                                         std::pair("prototype", "free")),
                         [](const auto& each) {
                           return std::string(each.param.first) + "_" + each.param.second;
                         });

double total_mass(const model::Model& model) {
  double sum = 0;
  for (const model::Body& body : model.bodies) sum += body.mass;
  return sum;
}

// Oracle: MuJoCo's readers, and the model: bodies, masses, ranges, the start.
TEST(Export, EveryShippedSceneLoadsAsMjcf) {
  for (const char* name : {"two_hands", "dropped_hand", "resting_hand", "pose_tracking", "prototype_poses"}) {
    const scene::Scene scene = shipped_scene(name);
    const OwnedModel other = load(test::written("mjcf", scene.model, scene.spec.solver), "scene.xml");
    ASSERT_TRUE(other) << name;
    EXPECT_EQ(other->nbody, static_cast<int>(scene.model.bodies.size()));
    EXPECT_EQ(other->ngeom, static_cast<int>(scene.model.shapes.size()));
    const OwnedData data(mj_makeData(other.get()));
    mj_resetDataKeyframe(other.get(), data.get(), 0);
    mj_kinematics(other.get(), data.get());
    const model::State start = model::initial_state(scene.model);
    for (std::size_t i = 1; i < scene.model.bodies.size(); ++i) {
      const model::Body& body = scene.model.bodies[i];
      const int id = mj_name2id(other.get(), mjOBJ_BODY, body.name.c_str());
      ASSERT_GE(id, 0) << body.name;
      EXPECT_NEAR(other->body_mass[id], body.mass, 1e-15);
      const Vec3 p(data->xpos[3 * id], data->xpos[3 * id + 1], data->xpos[3 * id + 2]);
      EXPECT_LT((p - start.bodies[i].p).norm(), 1e-12) << name << " " << body.name;
    }
    for (const model::Joint& joint : scene.model.joints)
      for (const model::JointAxis& axis : joint.axes) {
        const int id = mj_name2id(other.get(), mjOBJ_JOINT, (joint.name + "." + axis.name).c_str());
        ASSERT_GE(id, 0);
        EXPECT_GE(mj_name2id(other.get(), mjOBJ_ACTUATOR, (joint.name + "." + axis.name).c_str()), 0);
        EXPECT_EQ(other->jnt_range[2 * id], axis.stop->low);
        EXPECT_EQ(other->jnt_range[2 * id + 1], axis.stop->high);
      }
  }
}

// Oracle: MuJoCo's reader, which makes the hull again, and the model: mass, inertia and corners of convex
// meshes. It keeps corners as 32-bit numbers.
TEST(Export, ConvexMeshesAreWhatTheyAreInMujoco) {
  const scene::Scene scene = scene::compile_scene(parse_yaml(
      "objects:\n"
      "  - {name: stone, shape: convex_mesh, mesh: icosahedron.obj, mass: 0.3, position: [0.1, 0.2, 0.3],\n"
      "     rotation: {axis: [1, 2, 3], angle: 0.7}}\n"
      "  - {name: rock, shape: convex_mesh, mesh: icosahedron.stl, scale: 0.001, density: 2500, position: "
      "[1, 0, "
      "0.3]}\n"
      "ground: {friction: 0.5}\nduration: 1\n",
      source("tests/data/meshes/scene.yaml").string()));
  warnings = 0;
  const OwnedModel other = load(test::written("mjcf", scene.model, scene.spec.solver), "meshes.xml");
  ASSERT_TRUE(other);
  EXPECT_EQ(warnings, 0);
  const OwnedData data(mj_makeData(other.get()));
  mj_resetDataKeyframe(other.get(), data.get(), 0);
  mj_kinematics(other.get(), data.get());
  const model::State start = model::initial_state(scene.model);
  int meshes = 0;
  for (const model::Shape& shape : scene.model.shapes) {
    if (shape.kind != model::ShapeKind::convex_mesh) continue;
    ++meshes;
    const auto index = static_cast<std::size_t>(shape.body);
    const model::Body& body = scene.model.bodies[index];
    const int id = mj_name2id(other.get(), mjOBJ_BODY, body.name.c_str());
    ASSERT_GE(id, 0);
    EXPECT_NEAR(other->body_mass[id], body.mass, 1e-12 * body.mass);
    const mjtNum* q = other->body_iquat + 4 * id;
    const Mat3 R = Quat(q[0], q[1], q[2], q[3]).toRotationMatrix();
    const Mat3 inertia =
        R * Eigen::Map<const Vec3>(other->body_inertia + 3 * id).asDiagonal() * R.transpose();
    EXPECT_LT((inertia - body.inertia).cwiseAbs().maxCoeff(), 1e-9 * body.inertia.trace());
    const int geom = mj_name2id(other.get(), mjOBJ_GEOM, shape.name.c_str());
    ASSERT_GE(geom, 0);
    const int mesh = other->geom_dataid[geom];
    const Eigen::Map<const Vec3> p(data->geom_xpos + 3 * geom);
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> turn(data->geom_xmat + 9 * geom);
    ASSERT_EQ(other->mesh_vertnum[mesh], static_cast<int>(shape.mesh->vertices.size()));
    for (std::size_t i = 0; i < shape.mesh->vertices.size(); ++i) {
      const Vec3 want = start.bodies[index].pose() * (shape.pose * shape.mesh->vertices[i]);
      double nearest = 1;
      for (int k = 0; k < other->mesh_vertnum[mesh]; ++k) {
        const float* v = other->mesh_vert + 3 * (other->mesh_vertadr[mesh] + k);
        nearest = std::min(nearest, (p + turn * Vec3(v[0], v[1], v[2]) - want).norm());
      }
      EXPECT_LT(nearest, 1e-6 * shape.mesh->reach + 1e-7);
    }
  }
  EXPECT_EQ(meshes, 2);
}

TEST(Export, HandsLoadAsUrdf) {
  for (const char* name : {"two_hands", "dropped_hand", "pose_tracking"}) {
    const scene::Scene scene = shipped_scene(name);
    // Old versions of MuJoCo count the touching parts at the start, and warn of more than 100.
    std::string text = test::written("urdf", scene.model, scene.spec.solver);
    text.insert(text.find('>', text.find("<robot")) + 1, "<mujoco><size nconmax=\"1000\"/></mujoco>");
    const OwnedModel other = load(text, "scene.urdf");
    ASSERT_TRUE(other) << name;
    double sum = 0;
    for (int i = 0; i < other->nbody; ++i) sum += other->body_mass[i];
    double moving = 0;
    for (const model::Body& body : scene.model.bodies) moving += body.kinematic ? 0 : body.mass;
    // MuJoCo may melt bodies that are fixed into the world.
    EXPECT_TRUE(std::abs(sum - moving) < 1e-9 || std::abs(sum - total_mass(scene.model)) < 1e-9);
    for (const model::Joint& joint : scene.model.joints)
      for (const model::JointAxis& axis : joint.axes) {
        const int id = mj_name2id(other.get(), mjOBJ_JOINT, (joint.name + "." + axis.name).c_str());
        ASSERT_GE(id, 0) << joint.name;
        EXPECT_NEAR(other->jnt_range[2 * id], axis.stop->low, 1e-12);
        EXPECT_NEAR(other->jnt_range[2 * id + 1], axis.stop->high, 1e-12);
      }
  }
}

TEST(Export, SaysWhatAFormatCannot) {
  const scene::Scene scene = shipped_scene("slider_crank_iftomm");
  EXPECT_THROW(test::written("urdf", scene.model, scene.spec.solver), Error);
}

}  // namespace
}  // namespace handsim::test
