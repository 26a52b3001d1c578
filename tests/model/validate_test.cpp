#include "handsim/model/validate.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "model/shape_samples.h"

namespace handsim::model {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Joint universal(const std::string& name, int parent, int child, int first_dof) {
  Joint out;
  out.name = name;
  out.kind = JointKind::universal;
  out.parent = parent;
  out.child = child;
  out.first_dof = first_dof;
  for (const int k : {0, 1}) {
    JointAxis axis;
    axis.name = k == 0 ? "a" : "b";
    axis.axis = Vec3::Unit(k);
    axis.stop = Stop{-1, 2};
    axis.tissue = Tissue{0.1, 0.01, 0.2};
    out.axes.push_back(axis);
  }
  return out;
}

/// A model with a part of every kind: a driven palm `p`, and `b` and `c` on it by joints `j` and `k`.
Model sound() {
  Model model = make_model();
  for (const char* name : {"p", "b", "c"}) {
    Body body;
    body.name = name;
    body.mass = 1;
    body.inertia = Mat3::Identity();
    body.kinematic = model.bodies.size() == 1;
    model.bodies.push_back(body);
  }
  model.joints = {universal("j", 1, 2, 0), universal("k", 2, 3, 2)};
  model.groups = {{"g"}};
  model.contact_rules = {{0, 0, 0}};
  Material material;
  material.name = "m";
  material.compliance = Compliance{1000, 10};
  model.materials = {material};
  model.shapes = {test::box_of({0.1, 0.1, 0.1}),
                  test::shape_of(ShapeKind::sphere, {}, 0.1),
                  test::shape_of(ShapeKind::cylinder, {}, 0.1, 0.2),
                  test::shape_of(ShapeKind::capsule, {}, 0.1, 0.2),
                  test::shape_of(ShapeKind::convex_mesh, {}, 0),
                  test::shape_of(ShapeKind::plane, {}, 0)};
  model.shapes[4].mesh = std::make_shared<const ConvexMesh>(box_polyhedron({0.1, 0.1, 0.1}));
  for (Shape& shape : model.shapes) shape.name = "s";
  Muscle muscle;
  muscle.name = "f";
  muscle.path = {{{0, {0.01}}, {3, {0.02}}}, {{0, 1, 1, 1, 1e-3}}};
  muscle.force = 100;
  muscle.fibre_length = 0.05;
  muscle.length = 0.3;
  muscle.slack_length = 0.25;
  muscle.tendon_strain = 0.05;
  model.muscles = {muscle};
  model.bands = {{"n", muscle.path, 100, 1, 0.1}};
  model.drives = {{1, {}, {{{0, {}}, {1, {}}}, Interpolation::linear, {{0, 2, 3, Vec3(0.01, 0, 0)}}}}};
  return model;
}

TEST(Defects, SoundModelsHaveNone) { EXPECT_TRUE(defects(sound()).empty()); }

/// The key of the only defect after a change, or how many there are.
template <class Change>
std::string defect(Change change) {
  Model model = sound();
  change(model);
  const std::vector<Problem> found = defects(model);
  return found.size() == 1 ? found[0].key : std::to_string(found.size()) + " defects";
}

// Oracle: definition: one change is one problem, which names the part and its quantity; `sound` has none.
TEST(Defects, OfBodiesAreNamed) {
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].mass = 0; }), "b.mass");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].mass = kNan; }), "b.mass");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].inertia(0, 0) = 5; }), "b.inertia");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].inertia(0, 0) = -1; }), "b.inertia");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].inertia(0, 0) = kNan; }), "b.inertia");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].inertia(0, 1) = 0.1; }), "b.inertia");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].zero_pose.q.coeffs() *= 0; }), "b.zero_pose.rotation");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].zero_pose.q.coeffs() *= 1 + 1e-8; }), "b.zero_pose.rotation");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].zero_pose.p.y() = 2e6; }), "b.zero_pose.position");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].initial_velocity.x() = kNan; }), "b.initial_velocity");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].initial_angular_velocity.x() = kInfinity; }),
            "b.initial_angular_velocity");
  EXPECT_EQ(defect([](Model& m) { m.gravity.z() = kInfinity; }), "gravity");
  EXPECT_EQ(defects({}).size(), 1U);
  EXPECT_EQ(defects({})[0].key, "bodies");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].inertia = Vec3(1, 1, 2.001).asDiagonal(); }), "b.inertia");
  // A flat plate and a thin rod are the limits of a rigid body.
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].inertia = Vec3(1, 1, 2).asDiagonal(); }), "0 defects");
  EXPECT_EQ(defect([](Model& m) { m.bodies[2].inertia = Vec3(1, 1, 1e-6).asDiagonal(); }), "0 defects");
}

TEST(Defects, OfJointsAreNamed) {
  EXPECT_EQ(defect([](Model& m) { m.joints[1].axes[1].axis = m.joints[1].axes[0].axis; }), "k.axes");
  EXPECT_EQ(defect([](Model& m) { m.joints[1].axes[1].axis.z() = 1e-4; }), "k.b.axis");
  EXPECT_EQ(defect([](Model& m) { m.joints[1].axes.pop_back(); }), "k.axes");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].kind = JointKind::slider; }), "2 defects");
  EXPECT_EQ(defect([](Model& m) { m.joints[1].kind = JointKind::ball; }), "k.axes");
  EXPECT_EQ(defect([](Model& m) { m.joints[1].first_dof = 3; }), "k.first_dof");
  EXPECT_EQ(defect([](Model& m) { m.joints[1].parent_frame.p.x() = kNan; }), "k.parent_frame.position");
  EXPECT_EQ(defect([](Model& m) { m.joints[1].child_frame.q.w() = 0.5; }), "k.child_frame.rotation");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[0].initial = kNan; }), "j.a.initial");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[0].stop = Stop{1, -1}; }), "j.a.stop");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[0].stop = Stop{1, 1}; }), "j.a.stop");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[0].stop = Stop{kNan, 1}; }), "j.a.stop");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[0].stop = Stop{-1, 3.2}; }), "j.a.stop");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[0].stop = Stop{-1, kInfinity}; }), "0 defects");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[1].stop->restitution = 1.1; }), "j.b.stop.restitution");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[1].stop->motor_share = -0.1; }), "j.b.stop.motor_share");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[1].tissue->stiffness = -1; }), "j.b.tissue.stiffness");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[1].tissue->damping = kNan; }), "j.b.tissue.damping");
  EXPECT_EQ(defect([](Model& m) { m.joints[0].axes[1].tissue->rest = kInfinity; }), "j.b.tissue.rest");
}

TEST(Defects, OfTheTreeAreNamed) {
  EXPECT_EQ(defect([](Model& m) { m.joints[1].parent = 3; }), "2 defects");  // itself, and it comes later
  EXPECT_EQ(defect([](Model& m) { m.joints[1].parent = 9; }), "k");
  EXPECT_EQ(defect([](Model& m) { m.joints[1].parent = -1; }), "k");
  EXPECT_EQ(defect([](Model& m) { m.joints[1].child = kWorld; }), "k");
  EXPECT_EQ(defect([](Model& m) { m.joints[1].child = 2, m.joints[1].parent = 1; }), "k");
  EXPECT_EQ(
      defect([](Model& m) { m.joints[1].child = 2, m.joints[1].parent = 1, m.joints[1].closes_loop = true; }),
      "0 defects");
  // Children first.
  EXPECT_EQ(defect([](Model& m) {
              std::swap(m.joints[0], m.joints[1]);
              m.joints[0].first_dof = 0, m.joints[1].first_dof = 2;
            }),
            "k");
}

TEST(Defects, OfShapesAndMaterialsAreNamed) {
  EXPECT_EQ(defect([](Model& m) { m.shapes[0].edges.y() = 0; }), "s.edges");
  EXPECT_EQ(defect([](Model& m) { m.shapes[0].pose.p.x() = kNan; }), "s.pose.position");
  EXPECT_EQ(defect([](Model& m) { m.shapes[1].radius = kNan; }), "s.radius");
  EXPECT_EQ(defect([](Model& m) { m.shapes[2].radius = -1; }), "s.radius");
  EXPECT_EQ(defect([](Model& m) { m.shapes[2].length = 0; }), "s.length");
  EXPECT_EQ(defect([](Model& m) { m.shapes[3].radius = 2e4; }), "s.radius");
  EXPECT_EQ(defect([](Model& m) { m.shapes[3].length = 0; }), "s.length");
  EXPECT_EQ(defect([](Model& m) { m.shapes[4].mesh = nullptr; }), "s.mesh");
  EXPECT_EQ(defect([](Model& m) { m.shapes[4].mesh = std::make_shared<const ConvexMesh>(); }), "s.mesh");
  EXPECT_EQ(defect([](Model& m) { m.shapes[5].body = 4; }), "s");
  EXPECT_EQ(defect([](Model& m) { m.shapes[5].group = 1; }), "s");
  EXPECT_EQ(defect([](Model& m) { m.shapes[5].material = -1; }), "s");
  EXPECT_EQ(defect([](Model& m) { m.materials[0].friction = -0.1; }), "m.friction");
  EXPECT_EQ(defect([](Model& m) { m.materials[0].restitution = 1.1; }), "m.restitution");
  EXPECT_EQ(defect([](Model& m) { m.materials[0].restitution_speed = -1; }), "m.restitution_speed");
  EXPECT_EQ(defect([](Model& m) { m.materials[0].rolling_friction = -1; }), "m.rolling_friction");
  EXPECT_EQ(defect([](Model& m) { m.materials[0].spinning_friction = kNan; }), "m.spinning_friction");
  EXPECT_EQ(defect([](Model& m) { m.materials[0].compliance->stiffness = 0; }), "m.stiffness");
  EXPECT_EQ(defect([](Model& m) { m.materials[0].compliance->damping = -1; }), "m.damping");
  EXPECT_EQ(defect([](Model& m) { m.contact_rules[0].group_b = 3; }), "contact_rules");
  EXPECT_EQ(defect([](Model& m) { m.contact_rules[0].material = 1; }), "contact_rules");
}

TEST(Defects, OfDrivesAreNamed) {
  EXPECT_EQ(defect([](Model& m) { m.drives[0].body = 2; }), "b.drive");
  EXPECT_EQ(defect([](Model& m) { m.drives[0].body = kWorld; }), "world.drive");
  EXPECT_EQ(defect([](Model& m) { m.drives[0].body = 9; }), "drive");
  EXPECT_EQ(defect([](Model& m) { m.drives[0].frame.p.x() = kNan; }), "p.drive.frame.position");
  EXPECT_EQ(defect([](Model& m) { m.drives[0].motion.keys.clear(); }), "p.drive.motion");
  EXPECT_EQ(defect([](Model& m) { m.drives[0].motion.keys[1].time = 0; }), "p.drive.motion");
  EXPECT_EQ(defect([](Model& m) { m.drives[0].motion.keys[0].pose.q.w() = 2; }), "p.drive.motion.rotation");
  EXPECT_EQ(defect([](Model& m) { m.drives[0].motion.keys[1].time = kInfinity; }), "p.drive.motion.time");
  EXPECT_EQ(defect([](Model& m) { m.drives[0].motion.shakes[0].frequency = 0; }), "p.drive.motion.shake");
  EXPECT_EQ(defect([](Model& m) { m.drives[0].motion.shakes[0].amplitude.z() = kNan; }),
            "p.drive.motion.shake");
  EXPECT_EQ(defect([](Model& m) { m.drives[0].motion.shakes[0].cycles = 0; }), "p.drive.motion.shake");
}

TEST(Defects, OfMusclesAndBandsAreNamed) {
  EXPECT_EQ(defect([](Model& m) { m.muscles[0].path.arms[1].dof = 4; }), "f.arms");
  EXPECT_EQ(defect([](Model& m) { m.muscles[0].path.arms[1].dof = 0; }), "f.arms");
  EXPECT_EQ(defect([](Model& m) { m.muscles[0].path.arms[1].c[2] = kNan; }), "f.arms");
  EXPECT_EQ(defect([](Model& m) { m.bands[0].path.products[0].b = 2; }), "n.products");
  EXPECT_EQ(defect([](Model& m) { m.bands[0].path.products[0].b = 0; }), "n.products");
  EXPECT_EQ(defect([](Model& m) { m.bands[0].path.products[0].power_a = 0; }), "n.products");
  EXPECT_EQ(defect([](Model& m) { m.bands[0].path.products[0].power_b = 6; }), "n.products");
  EXPECT_EQ(defect([](Model& m) { m.bands[0].path.products[0].factor = kNan; }), "n.products");
  EXPECT_EQ(defect([](Model& m) { m.bands[0].stiffness = -1; }), "n.stiffness");
  EXPECT_EQ(defect([](Model& m) { m.bands[0].damping = kNan; }), "n.damping");
  EXPECT_EQ(defect([](Model& m) { m.bands[0].rest = kInfinity; }), "n.rest");
  const std::pair<const char*, double Muscle::*> quantities[] = {
      {"f.force", &Muscle::force},
      {"f.fibre_length", &Muscle::fibre_length},
      {"f.length", &Muscle::length},
      {"f.pennation", &Muscle::pennation},
      {"f.activation_time", &Muscle::activation_time},
      {"f.deactivation_time", &Muscle::deactivation_time},
      {"f.max_speed", &Muscle::max_speed},
      {"f.initial", &Muscle::initial},
      {"f.excitable", &Muscle::excitable}};
  for (const auto& each : quantities)
    for (const double bad : {-1.0, kNan, kInfinity})
      EXPECT_EQ(defect([&](Model& m) { m.muscles[0].*each.second = bad; }), each.first) << bad;
  EXPECT_EQ(defect([](Model& m) { m.muscles[0].tendon_strain = 0.6; }), "f.tendon_strain");
  // A rigid tendon may have no length, an elastic one must.
  EXPECT_EQ(defect([](Model& m) { m.muscles[0].slack_length = 0; }), "f.slack_length");
  EXPECT_EQ(defect([](Model& m) { m.muscles[0].slack_length = 0, m.muscles[0].tendon_strain.reset(); }),
            "0 defects");
}

// Oracle: definition: each part has the place with which it was added, those of no file have none, and of
// several defects each has its own.
TEST(Defects, HaveThePlaceOfTheirPart) {
  Model model = make_model();
  Origins origins;
  origins.add(model, std::nullopt);
  const Model whole = sound();
  model.bodies.assign(whole.bodies.begin(), whole.bodies.begin() + 3);
  model.joints = {whole.joints[0]};
  origins.add(model, Place{"first", 3, 1});
  model = whole;
  origins.add(model, Place{"second", 7, 5});
  EXPECT_TRUE(defects(model, origins).empty());
  model.bodies[2].mass = 0;
  model.bodies[3].mass = 0;
  model.joints[0].axes[0].initial = kNan;
  model.materials[0].friction = -1;
  model.bands[0].rest = kNan;
  const std::vector<Problem> found = defects(model, origins);
  const std::pair<const char*, const char*> want[] = {
      {"b.mass", "first"}, {"c.mass", "second"}, {"j.a.initial", "first"}, {"m.friction", "second"}};
  ASSERT_EQ(found.size(), 5U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(found[i].key, want[i].first);
    ASSERT_TRUE(found[i].place) << found[i].key;
    EXPECT_EQ(found[i].place->file, want[i].second);
  }
  EXPECT_EQ(found[4].key, "n.rest");
  EXPECT_FALSE(found[4].place);
}

}  // namespace
}  // namespace handsim::model
