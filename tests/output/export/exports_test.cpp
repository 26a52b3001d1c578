// Exported files, read by another XML reader. Oracle: body poses computed from the file are those of the
// model's kinematics; masses, ranges and pairs of shapes that can touch are those of the model.
#include <gtest/gtest.h>

#include <map>
#include <pugixml.hpp>
#include <random>
#include <sstream>

#include "handsim/engine/collision/pair_table.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/markers.h"
#include "scene_files.h"
#include "support/written.h"

namespace handsim::test {
namespace {

template <int n>
Eigen::Matrix<double, n, 1> vector(const pugi::xml_node& node, const char* name) {
  Eigen::Matrix<double, n, 1> out = Eigen::Matrix<double, n, 1>::Zero();
  std::istringstream text(node.attribute(name).value());
  for (double& value : out) EXPECT_TRUE(text >> value) << node.name() << "." << name;
  return out;
}

std::string name(const pugi::xml_node& node, const char* attribute = "name") {
  return node.attribute(attribute).value();
}

pugi::xml_document parse(const std::string& text) {
  pugi::xml_document out;
  EXPECT_TRUE(out.load_string(text.c_str()));
  return out;
}

/// Names of the model's coordinates in both formats.
std::map<std::string, std::size_t> coordinates(const model::Model& model) {
  std::map<std::string, std::size_t> out;
  for (const model::Joint& joint : model.joints)
    for (std::size_t i = 0; i < joint.axes.size(); ++i)
      out[joint.name + "." + joint.axes[i].name] = static_cast<std::size_t>(joint.first_dof) + i;
  return out;
}

/// Random coordinates within the stops.
std::vector<double> drawn_coordinates(const model::Model& model, std::mt19937& random) {
  std::vector<double> out(static_cast<std::size_t>(model.dof_count()));
  std::uniform_real_distribution<double> angle(-1.5, 1.5);
  for (double& q : out) q = angle(random);
  return out;
}

/// Compares the poses of a body in the file and in the model. Bounds: rounding errors in chains of six
/// rotations.
void expect_at(const Pose& found, const Pose& expected, const std::string& body) {
  EXPECT_LT((found.p - expected.p).norm(), 1e-12) << body;
  EXPECT_LT(found.q.angularDistance(expected.q), 1e-7) << body;  // acos near 1
}

scene::Scene hands(const std::string& model) {
  const std::string file = source("handmodels/" + model + ".yaml").string();
  const bool tissue = model == "anatomical";
  return shipped_scene(
      "two_hands", {"hands.0.model=" + file, "hands.1.model=" + file, "hands.0.pose={}", "hands.1.pose={}",
                    "hands.0.tissue={}", "hands.1.tissue={}", "hands.0.wrist.mount=free",
                    tissue ? "effects=[gravity, self_contact, friction, joint_stops, passive_tissue]"
                           : "effects=[gravity, self_contact, friction, joint_stops]"});
}

class Exports : public testing::TestWithParam<const char*> {
 protected:
  scene::Scene scene_ = hands(GetParam());
  const model::Model& model_ = scene_.model;
  std::map<std::string, std::size_t> coordinates_ = coordinates(model_);

  std::size_t body(const std::string& name) const {
    for (std::size_t i = 0; i < model_.bodies.size(); ++i)
      if (model_.bodies[i].name == name) return i;
    ADD_FAILURE() << "no body " << name;
    return 0;
  }
  const model::JointAxis& axis(const std::string& name) const {
    for (const model::Joint& joint : model_.joints)
      for (const model::JointAxis& each : joint.axes)
        if (joint.name + "." + each.name == name) return each;
    throw input_error("axis", name, "one of the model's");
  }
};

INSTANTIATE_TEST_SUITE_P(Hands, Exports, testing::Values("anatomical", "prototype"));

// MJCF: pos and quat are the pose of a body in its parent; the body rotates about the axis of each joint
// through the joint's pos, in the order of the file.
struct MjcfBodies {
  const std::map<std::string, std::size_t>& coordinates;
  const std::vector<double>& q;
  std::map<std::string, Pose> poses;

  void add(const pugi::xml_node& parent, const Pose& at) {
    for (const pugi::xml_node& node : parent.children("body")) {
      const Eigen::Vector4d w = vector<4>(node, "quat");
      Pose pose = at * Pose{vector<3>(node, "pos"), Quat(w[0], w[1], w[2], w[3])};
      for (const pugi::xml_node& joint : node.children("joint")) {
        const Vec3 anchor = vector<3>(joint, "pos");
        const Quat turn(Eigen::AngleAxisd(q[coordinates.at(name(joint))], vector<3>(joint, "axis")));
        pose = pose * Pose{anchor - turn * anchor, turn};
      }
      poses[name(node)] = pose;
      add(node, pose);
    }
  }
};

TEST_P(Exports, MjcfPutsBodiesWhereTheModelHasThem) {
  const auto document = parse(test::written("mjcf", model_, scene_.spec.solver));
  std::mt19937 random(3);
  for (int sample = 0; sample < 20; ++sample) {
    const std::vector<double> q = drawn_coordinates(model_, random);
    MjcfBodies found{coordinates_, q, {}};
    found.add(document.child("mujoco").child("worldbody"), Pose{});
    ASSERT_EQ(found.poses.size() + 1, model_.bodies.size());
    const model::State expected = model::state_at(model_, q);
    const model::State start = model::initial_state(model_);
    for (const auto& [name, pose] : found.poses) {
      // A free hand has its initial pose, not the zero pose.
      const std::size_t root = body(name.substr(0, name.find('.')) + ".palm");
      const Pose moved = start.bodies[root].pose() * expected.bodies[root].pose().inverse();
      expect_at(pose, moved * expected.bodies[body(name)].pose(), name);
    }
  }
}

TEST_P(Exports, MjcfHasTheModelsMassesRangesTissueAndStart) {
  const auto document = parse(test::written("mjcf", model_, scene_.spec.solver));
  for (const auto& found : document.select_nodes("//body")) {
    const model::Body& expected = model_.bodies[body(name(found.node()))];
    const pugi::xml_node inertial = found.node().child("inertial");
    EXPECT_EQ(inertial.attribute("mass").as_double(), expected.mass);
    const Eigen::Vector4d q = vector<4>(inertial, "quat");
    const Mat3 axes = Quat(q[0], q[1], q[2], q[3]).toRotationMatrix();
    const Mat3 found_inertia = axes * vector<3>(inertial, "diaginertia").asDiagonal() * axes.transpose();
    EXPECT_LT((found_inertia - expected.inertia).norm(), 1e-14 * expected.inertia.norm());
  }
  const bool tissue = scene_.spec.solver.effects.has(model::Effect::passive_tissue);
  const auto joints = document.select_nodes("//body/joint");
  EXPECT_EQ(joints.size(), coordinates_.size());
  for (const auto& found : joints) {
    const model::JointAxis& expected = axis(name(found.node()));
    ASSERT_TRUE(expected.stop);
    EXPECT_EQ(vector<2>(found.node(), "range"), Eigen::Vector2d(expected.stop->low, expected.stop->high));
    EXPECT_EQ(found.node().attribute("stiffness").as_double(),
              tissue && expected.tissue ? expected.tissue->stiffness : 0);
    EXPECT_EQ(found.node().attribute("damping").as_double(),
              tissue && expected.tissue ? expected.tissue->damping : 0);
  }
  // One free hand: 7 numbers of its pose before those of its joints.
  std::istringstream start(document.select_node("//key").node().attribute("qpos").value());
  const std::vector<double> numbers{std::istream_iterator<double>(start), {}};
  EXPECT_EQ(numbers.size(), static_cast<std::size_t>(model_.dof_count()) + 7);
}

TEST_P(Exports, MjcfLetsTheSameShapesTouch) {
  const auto document = parse(test::written("mjcf", model_, scene_.spec.solver));
  int meeting = 0;
  std::map<std::string, std::pair<unsigned, unsigned>> bits;
  for (const auto& found : document.select_nodes("//geom"))
    bits[name(found.node())] = {found.node().attribute("contype").as_uint(),
                                found.node().attribute("conaffinity").as_uint()};
  ASSERT_EQ(bits.size(), model_.shapes.size());
  const engine::PairTable rules(model_);
  for (const model::Shape& a : model_.shapes)
    for (const model::Shape& b : model_.shapes) {
      const auto& [type_a, affinity_a] = bits.at(a.name);
      const auto& [type_b, affinity_b] = bits.at(b.name);
      EXPECT_EQ((type_a & affinity_b) != 0 || (type_b & affinity_a) != 0, rules.meet(a.group, b.group))
          << a.name << " and " << b.name;
      meeting += rules.meet(a.group, b.group) ? 1 : 0;
    }
  EXPECT_GT(meeting, 0);
}

Pose origin(const pugi::xml_node& node) {
  const pugi::xml_node found = node.child("origin");
  const Vec3 a = vector<3>(found, "rpy");
  return {vector<3>(found, "xyz"),
          Quat(Eigen::AngleAxisd(a[2], Vec3::UnitZ()) * Eigen::AngleAxisd(a[1], Vec3::UnitY()) *
               Eigen::AngleAxisd(a[0], Vec3::UnitX()))};
}

/// URDF: a joint's origin is its pose in the parent link, and it rotates about its axis; the link has the
/// joint's frame, the body that of `inertial`.
TEST_P(Exports, UrdfPutsBodiesWhereTheModelHasThem) {
  const auto document = parse(test::written("urdf", model_, scene_.spec.solver));
  const pugi::xml_node robot = document.child("robot");
  std::mt19937 random(4);
  for (int sample = 0; sample < 20; ++sample) {
    const std::vector<double> q = drawn_coordinates(model_, random);
    std::map<std::string, Pose> links = {{"world", Pose{}}};
    for (const pugi::xml_node& joint : robot.children("joint")) {
      const std::string parent = name(joint.child("parent"), "link");
      ASSERT_TRUE(links.contains(parent)) << parent << " comes after its children";
      Pose pose = links[parent] * origin(joint);
      if (joint.child("axis"))
        pose = pose * Pose{Vec3::Zero(), Quat(Eigen::AngleAxisd(q[coordinates_.at(name(joint))],
                                                                vector<3>(joint.child("axis"), "xyz")))};
      links[name(joint.child("child"), "link")] = pose;
    }
    const model::State expected = model::state_at(model_, q);
    const model::State start = model::initial_state(model_);
    std::size_t seen = 1;
    for (const pugi::xml_node& link : robot.children("link")) {
      if (name(link) == "world" || name(link).ends_with(".middle")) continue;
      ++seen;
      const model::Body& mine = model_.bodies[body(name(link))];
      const std::size_t root = body(name(link).substr(0, name(link).find('.')) + ".palm");
      const Pose moved = start.bodies[root].pose() * expected.bodies[root].pose().inverse();
      expect_at(links.at(name(link)) * origin(link.child("inertial")),
                moved * expected.bodies[body(name(link))].pose(), name(link));
      EXPECT_EQ(link.child("inertial").child("mass").attribute("value").as_double(), mine.mass);
    }
    EXPECT_EQ(seen, model_.bodies.size());
  }
}

TEST_P(Exports, UrdfHasTheModelsRangesAndShapes) {
  const auto document = parse(test::written("urdf", model_, scene_.spec.solver));
  const pugi::xml_node robot = document.child("robot");
  std::size_t axes = 0, collisions = 0;
  for (const pugi::xml_node& joint : robot.children("joint")) {
    if (!joint.child("axis")) continue;
    ++axes;
    const model::JointAxis& expected = axis(name(joint));
    EXPECT_EQ(joint.child("limit").attribute("lower").as_double(), expected.stop->low);
    EXPECT_EQ(joint.child("limit").attribute("upper").as_double(), expected.stop->high);
  }
  EXPECT_EQ(axes, coordinates_.size());
  for (const pugi::xml_node& link : robot.children("link"))
    collisions += static_cast<std::size_t>(
        std::distance(link.children("collision").begin(), link.children("collision").end()));
  std::size_t expected = 0;
  for (const model::Shape& shape : model_.shapes) expected += shape.kind == model::ShapeKind::capsule ? 3 : 1;
  EXPECT_EQ(collisions, expected);
}

// Oracle: the plan's torque limits; 1000 stands for none.
TEST(Urdf, EffortIsTheTorqueLimitOfTheDrive) {
  const scene::Scene scene = shipped_scene("every_pose");
  ASSERT_TRUE(scene.control);
  const auto document = parse(test::written("urdf", scene.model, scene.spec.solver, &*scene.control));
  std::map<std::string, double> efforts;
  for (const pugi::xml_node& joint : document.child("robot").children("joint"))
    if (joint.child("axis")) efforts[name(joint)] = joint.child("limit").attribute("effort").as_double();
  EXPECT_EQ(efforts.size(), static_cast<std::size_t>(scene.model.dof_count()));
  for (const control::DrivenAxis& axis : scene.control->axes) {
    EXPECT_EQ(efforts[axis.name], axis.torque_limit) << axis.name;
    efforts.erase(axis.name);
  }
  for (const auto& [joint, effort] : efforts) EXPECT_EQ(effort, 1000) << joint;
  const auto undriven = parse(test::written("urdf", scene.model, scene.spec.solver));
  EXPECT_EQ(undriven.select_node("//limit").node().attribute("effort").as_double(), 1000);
}

// Oracle: the effects: without friction nothing sticks, whatever the surfaces are.
TEST(Mjcf, WithoutTheEffectOfFrictionEveryContactIsSmooth) {
  const scene::Scene scene =
      scene::without_effect(shipped_scene("object_collection"), model::Effect::friction);
  const auto document = parse(test::written("mjcf", scene.model, scene.spec.solver));
  int geoms = 0;
  for (const auto& found : document.select_nodes("//geom | //pair")) {
    ++geoms;
    EXPECT_EQ(found.node().attribute("condim").as_int(), 1);
  }
  EXPECT_GT(geoms, 0);
}

// Oracle: the hand model's lengths of segments for this person, which end at the next joint's centre or the
// fingertip; mirrored sides; one marker for each wrist, joint and finger. Bound: rounding.
TEST(Markers, SpanTheHand) {
  const scene::Scene scene = hands("anatomical");
  const model::State straight = model::state_at(
      scene.model, std::vector<double>(static_cast<std::size_t>(scene.model.dof_count()), 0.0));
  std::map<std::string, Vec3> found;
  for (const model::Marker& marker : model::hand_markers(scene.model)) {
    const int side = marker.name.starts_with("right.") ? 0 : 1;
    const model::HandIndex& hand = scene.model.hands[static_cast<std::size_t>(side)];
    const Pose wrist = straight.bodies[static_cast<std::size_t>(hand.palm)].pose() * hand.wrist_frame;
    found[marker.name] =
        wrist.inverse() * (straight.bodies[static_cast<std::size_t>(marker.body)].pose() * marker.point);
  }
  EXPECT_EQ(found.size(), 2u * (1 + 15 + 5));
  EXPECT_LT(found.at("right.wrist").norm(), 1e-12);
  for (const hand::SegmentSpec& segment : scene.spec.hands[0].model->segments) {
    const std::string joint = "right." + segment.joint.name, body = "right." + segment.name;
    Vec3 end = Vec3::Zero();
    if (!segment.has_child) end = found.at(body + ".tip");
    for (const hand::SegmentSpec& next : scene.spec.hands[0].model->segments)
      if (next.parent && scene.spec.hands[0].model->segments[*next.parent].name == segment.name)
        end = found.at("right." + next.joint.name);
    EXPECT_NEAR((end - found.at(joint)).norm(), segment.length.value(scene.hands[0].size), 1e-12) << body;
  }
  for (const auto& [name, point] : found) {
    if (!name.starts_with("right.")) continue;
    EXPECT_LT((mirrored(found.at("left." + name.substr(6))) - point).norm(), 1e-12) << name;
  }
}

}  // namespace
}  // namespace handsim::test
