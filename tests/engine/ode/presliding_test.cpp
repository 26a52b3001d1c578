// Friction that holds a position under quick_step, which leaves a residual that would let surfaces creep.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/models.h"
#include "handsim/engine/ode/friction.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::ShapeKind;

using test::kG;

Settings quick(int iterations = 50) {
  Settings how = test::settings({Effect::gravity, Effect::ground_contact, Effect::friction}, 1e-3,
                                OdeMethod::quick_step);
  how.ode().iterations = iterations;
  return how;
}

/// A cube of 40 mm and 0.1 kg on a floor; the floor is the first of their pair, or the second.
model::Model cube_on_floor(const Quat& tilt, bool floor_first, double friction = 0.5) {
  model::Model model = model::make_model();
  if (floor_first) test::add_ground(model, friction, tilt);
  const double moment = 0.1 * 2 * 0.0016 / 12;
  const int cube = test::add_body(
      model, test::body("cube", 0.1, {moment, moment, moment}, {tilt * Vec3(0, 0, 0.02), tilt}));
  model::Shape shape = test::shape("cube", ShapeKind::box, cube);
  shape.edges = Vec3::Constant(0.04);
  model.shapes.push_back(shape);
  if (!floor_first) test::add_ground(model, friction, tilt);
  return model;
}

void make_pads(model::Model& model) {
  for (model::Material& material : model.materials) material.compliance = model::Compliance{3000, 10};
}

// Oracle: Coulomb in closed form, friction angle 26.57 deg: as the direct solver is tested, of rigid surfaces
// and of pads, which settle first.
TEST(Presliding, SticksAndSlidesOnAnInclineAsCoulombSays) {
  for (const bool pads : {false, true})
    for (const bool floor_first : {true, false})
      for (const double degrees : {26.0, 27.5}) {
        const double angle = degrees * M_PI / 180;
        model::Model model =
            cube_on_floor(rotation_quaternion(angle * Vec3(std::cos(0.4), std::sin(0.4), 0)), floor_first);
        if (pads) make_pads(model);
        const auto engine = make_engine(model, quick());
        test::run(*engine, 500);
        const model::BodyState start = engine->state().bodies[1];
        test::run(*engine, 1000);
        const model::BodyState& end = engine->state().bodies[1];
        const double want = std::max(0.0, kG * (std::sin(angle) - 0.5 * std::cos(angle)));
        if (want > 0)
          EXPECT_NEAR(end.v.norm() - start.v.norm(), want, 5e-3 * want) << degrees << " deg, pads " << pads;
        else
          EXPECT_LT((end.p - start.p).norm(), 1e-6) << degrees << " deg, pads " << pads;
      }
}

// Oracle: statics; at ten iterations quick_step leaves a residual, which is what lets surfaces creep.
TEST(Presliding, HoldsWhereTheSolverHasNotConverged) {
  const model::Model model = cube_on_floor(rotation_quaternion({0.4, 0, 0}), true);
  const auto engine = make_engine(model, quick(10));
  test::run(*engine, 1000);
  const Vec3 start = engine->state().bodies[1].p;
  test::run(*engine, 5000);
  EXPECT_LT((engine->state().bodies[1].p - start).norm(), 1e-5);
}

// Oracle: kinematics; rolling is no sliding, so a rolling ball keeps its speed.
TEST(Presliding, LeavesRollingAlone) {
  model::Model model = model::make_model();
  test::add_ground(model, 0.8);
  const double moment = 0.4 * 0.1 * 9e-4;
  model::Body body = test::body("ball", 0.1, {moment, moment, moment}, {Vec3(0, 0, 0.03), Quat::Identity()});
  body.initial_velocity = Vec3(1, 0, 0);
  body.initial_angular_velocity = Vec3(0, 1 / 0.03, 0);
  const int ball = test::add_body(model, body);
  model::Shape shape = test::shape("ball", ShapeKind::sphere, ball);
  shape.radius = 0.03;
  model.shapes.push_back(shape);
  const auto engine = make_engine(model, quick());
  test::run(*engine, 2000);
  EXPECT_NEAR(engine->state().bodies[1].v.x(), 1, 1e-3);
}

// Oracle: the bound of the displacement: a cube that slid springs back by no more when it has stopped.
TEST(Presliding, SpringsBackByNoMoreThanItsBound) {
  for (const bool pads : {false, true}) {
    model::Model model = cube_on_floor(Quat::Identity(), true);
    if (pads) make_pads(model);
    model.bodies[1].initial_velocity = Vec3(1, 0, 0);
    const auto engine = make_engine(model, quick());
    double farthest = 0;
    double sole = 0;  // a pad lets the cube rock above it
    for (int i = 0; i < 1000; ++i) {
      engine->step({});
      sole = (engine->state().bodies[1].pose() * Vec3(0, 0, -0.02)).x();
      farthest = std::max(farthest, sole);
    }
    EXPECT_NEAR(farthest, 1 / (2 * 0.5 * kG), pads ? 5e-3 : 1e-3);
    EXPECT_LT(farthest - sole, 1.1 * (pads ? ode::kLongestPadShift : ode::kLongestRigidShift));
  }
}

// Oracle: closed form; the moment rho N of a pad that touches in one point slows a ball's spin, and a
// constant moment of half that does not turn it.
TEST(Presliding, HoldsTheTurnOfAPadUpToItsMoment) {
  constexpr double kRadius = 0.03, kRho = 0.003;
  for (const bool floor_first : {true, false})
    for (const double share : {0.5, 1.5}) {
      model::Model model = model::make_model();
      if (floor_first) test::add_ground(model, 0.8);
      const double moment = 0.4 * 0.1 * kRadius * kRadius;
      const int ball = test::add_body(
          model, test::body("ball", 0.1, {moment, moment, moment}, {Vec3(0, 0, kRadius), Quat::Identity()}));
      model::Shape shape = test::shape("ball", ShapeKind::sphere, ball);
      shape.radius = kRadius;
      model.shapes.push_back(shape);
      const int top = test::add_body(
          model, test::body("top", 1e-3, {1e-7, 1e-7, 1e-7}, {Vec3(0, 0, kRadius), Quat::Identity()}));
      // A hinge about the vertical gives the moment; its light other half spins away in the air.
      test::add_joint(model, "axle", model::JointKind::hinge, ball, top, {}, {}, {Vec3::UnitZ()});
      if (!floor_first) test::add_ground(model, 0.8);
      make_pads(model);
      for (model::Material& material : model.materials) material.spinning_friction = kRho;
      Settings how = quick();
      how.effects.add(Effect::actuation);
      const auto engine = make_engine(model, how);
      const double limit = kRho * 0.101 * kG;
      const double torque = share * limit;
      test::run(*engine, 500);
      const double before = engine->state().bodies[1].w.z();
      for (int i = 0; i < 20; ++i) engine->step({.torques = std::span(&torque, 1)});
      const double rate = engine->state().bodies[1].w.z() - before;
      const double want = share > 1 ? -(torque - limit) / moment * 0.02 : 0;
      EXPECT_NEAR(rate, want, 0.02 * limit / moment * 0.02) << share << ", floor first " << floor_first;
    }
}

// Oracle: bit equality with a run that went on; without what was saved the two part, so it holds the creep.
TEST(Presliding, GoesOnFromWhatTheEngineSaved) {
  const model::Model model = cube_on_floor(rotation_quaternion({0.4, 0, 0}), true);
  const auto engine = make_engine(model, quick(5));
  test::run(*engine, 500);
  ArchiveWriter saved;
  engine->save(saved);
  const auto other = make_engine(model, quick(5)), forgetful = make_engine(model, quick(5));
  test::resume(*other, engine->state(), saved.bytes());
  forgetful->set_state(engine->state());
  for (Engine* each : {engine.get(), other.get(), forgetful.get()}) test::run(*each, 500);
  EXPECT_EQ(test::bits(engine->state()), test::bits(other->state()));
  EXPECT_NE(test::bits(engine->state()), test::bits(forgetful->state()));
}

}  // namespace
}  // namespace handsim::engine
