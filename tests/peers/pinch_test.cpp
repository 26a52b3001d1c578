// The same pinch here and in MuJoCo: two pads on slides press an object of 45 g with 1.05 to 38 times the
// force that friction needs. Oracle: MuJoCo at the settings that its documentation gives against slip, in the
// same run. Skipped where it is not built; HANDSIM_NEED_PEERS names it where it has to be there.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "engine/models.h"
#include "scene_files.h"

namespace handsim::engine {
namespace {

namespace fs = std::filesystem;
using model::Effect;
using model::ShapeKind;

constexpr double kG = 9.80665, kMass = 0.045, kFriction = 0.7;
constexpr double kSettle = 1, kHold = 10, kStep = 1e-3;

struct Pinch {
  const char* name;
  ShapeKind shape;
};
constexpr Pinch kShapes[] = {{"sphere", ShapeKind::sphere},
                             {"capsule", ShapeKind::capsule},
                             {"cylinder", ShapeKind::cylinder},
                             {"box", ShapeKind::box}};

struct Held {
  double slip = 0;  ///< mean speed of fall [m/s]
  double tilt = 0;  ///< [rad]
};

void add_pad(model::Model& model, const std::string& name, double x) {
  const int body = test::add_body(
      model, test::body(name, 0.05, {3e-5, 1.7e-5, 1.7e-5}, {Vec3(x, 0, 0.5), Quat::Identity()}));
  model::Shape shape = test::shape(name, ShapeKind::box, body);
  shape.edges = Vec3(0.02, 0.06, 0.06);
  model.shapes.push_back(shape);
  test::add_joint(model, name + "_slide", model::JointKind::slider, model::kWorld, body,
                  {Vec3(x, 0, 0.5), Quat::Identity()}, {}, {Vec3::UnitX()});
}

model::Model pinch(ShapeKind kind) {
  model::Model model = model::make_model();
  model.groups = {{"all"}};
  model.contact_rules = {{0, 0}};
  model.materials = {test::material("pad", kFriction)};
  add_pad(model, "left", -0.03);
  add_pad(model, "right", 0.03);
  model::Shape shape = test::shape("object", kind, 0);
  shape.radius = 0.02;
  shape.length = 0.04;
  shape.edges = Vec3::Constant(0.04);
  if (kind == ShapeKind::capsule || kind == ShapeKind::cylinder)
    shape.pose.q = rotation_quaternion({M_PI / 2, 0, 0});
  // Of a solid sphere of that radius: MuJoCo's inertias differ with the shape, and none turns.
  const double moment = 0.4 * kMass * 4e-4;
  shape.body = test::add_body(
      model, test::body("object", kMass, Vec3::Constant(moment), {Vec3(0, 0, 0.5), Quat::Identity()}));
  model.shapes.push_back(shape);
  return model;
}

Held hold_here(ShapeKind kind, double force, Method method) {
  const model::Model model = pinch(kind);
  Settings how = test::settings(
      {Effect::gravity, Effect::object_contact, Effect::friction, Effect::actuation}, kStep, method);
  how.ode().iterations = 50;
  const auto engine = make_engine(model, how);
  const std::vector<double> forces = {force, -force};
  const auto run = [&](double time) {
    for (long i = 0; i < std::lround(time / kStep); ++i) engine->step({.torques = forces});
  };
  run(kSettle);
  const model::BodyState before = engine->state().bodies.back();
  run(kHold);
  const model::BodyState& after = engine->state().bodies.back();
  return {(before.p.z() - after.p.z()) / kHold, rotation_vector(after.q * before.q.conjugate()).norm()};
}

/// MuJoCo's answer to a request.
Held hold_there(const fs::path& folder, const nlohmann::json& option, const Pinch& pinch, double force) {
  const nlohmann::json request = {{"shape", pinch.name}, {"mass", kMass},   {"friction", kFriction},
                                  {"force", force},      {"step", kStep},   {"settle", kSettle},
                                  {"hold", kHold},       {"option", option}};
  std::ofstream(folder / "request.json") << request;
  const std::string command = std::string(HANDSIM_PEERS_FOLDER) + "/peer_mujoco_pinch < " +
                              (folder / "request.json").string() + " > " + (folder / "answer.json").string();
  if (std::system(command.c_str()) != 0) throw std::runtime_error("peer_mujoco_pinch failed");
  std::ifstream answer(folder / "answer.json");
  const nlohmann::json said = nlohmann::json::parse(answer);
  return {said.at("slip"), said.at("tilt")};
}

class MujocoPinch : public testing::TestWithParam<Pinch> {};
INSTANTIATE_TEST_SUITE_P(, MujocoPinch, testing::ValuesIn(kShapes),
                         [](const auto& pinch) { return std::string(pinch.param.name); });

TEST_P(MujocoPinch, SlipsNoLessThanOurs) {
  if (!fs::exists(fs::path(HANDSIM_PEERS_FOLDER) / "peer_mujoco_pinch")) {
    const char* needed = std::getenv("HANDSIM_NEED_PEERS");
    ASSERT_FALSE(needed && std::string(needed).find("mujoco") != std::string::npos) << "MuJoCo is needed";
    GTEST_SKIP() << "peer_mujoco_pinch is not built";
  }
  const handsim::test::TemporaryFolder folder;
  const double needed = kMass * kG / (2 * kFriction);
  for (const double ratio : {1.05, 1.5, 5.0, 38.0}) {
    const double force = ratio * needed;
    const Held direct = hold_here(GetParam().shape, force, OdeMethod::world_step);
    const Held iterative = hold_here(GetParam().shape, force, OdeMethod::quick_step);
    const Held plain = hold_there(folder.path(), {{"cone", "elliptic"}}, GetParam(), force);
    const Held stiff =
        hold_there(folder.path(), {{"cone", "elliptic"}, {"impratio", "10"}}, GetParam(), force);
    const Held noslip =
        hold_there(folder.path(), {{"cone", "elliptic"}, {"impratio", "10"}, {"noslip_iterations", "3"}},
                   GetParam(), force);
    std::printf(
        "%-8s %5.2f  slip um/s: world_step %.3g, quick_step 50 %.3g; elliptic %.3g, impratio 10 %.3g, "
        "noslip 3 %.3g; tilt deg: %.2g %.2g; %.2g %.2g %.2g\n",
        GetParam().name, ratio, 1e6 * direct.slip, 1e6 * iterative.slip, 1e6 * plain.slip, 1e6 * stiff.slip,
        1e6 * noslip.slip, direct.tilt * 180 / M_PI, iterative.tilt * 180 / M_PI, plain.tilt * 180 / M_PI,
        stiff.tilt * 180 / M_PI, noslip.tilt * 180 / M_PI);
    for (const Held& theirs : {plain, stiff, noslip}) {
      EXPECT_LE(std::abs(direct.slip), std::abs(theirs.slip)) << GetParam().name << " at " << ratio;
      // Within 5 % of the limit quick_step's residual decides: it may lose the object.
      if (ratio > 1.4) {
        EXPECT_LE(std::abs(iterative.slip), std::abs(theirs.slip)) << GetParam().name << " at " << ratio;
      }
    }
  }
}

}  // namespace
}  // namespace handsim::engine
