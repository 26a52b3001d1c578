// Contact of the articulated engine: the solver by itself, rest, forces, impact, friction, pads, hands
// on objects; against closed forms and against the ODE engine as the step shrinks.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include <Eigen/Dense>

#include "engine/models.h"
#include "handsim/engine/articulated/contact_newton.h"
#include "support/slider_crank.h"

namespace handsim::engine {
namespace {

using articulated::ContactNewton;
using articulated::ContactRows;
using articulated::NewtonReport;
using model::Effect;
using model::ShapeKind;

constexpr double kG = 9.80665;
const std::initializer_list<Effect> kAll = {Effect::gravity, Effect::object_contact, Effect::friction};

Settings settings(std::initializer_list<Effect> effects, double step = 1e-3) {
  return test::settings(effects, step, Method::semi_implicit_euler);
}

model::Shape sized(const std::string& name, ShapeKind kind, double radius, double length,
                   Vec3 edges = Vec3::Zero()) {
  model::Shape out = test::shape(name, kind, 0);
  out.radius = radius;
  out.length = length;
  out.edges = edges;
  return out;
}

/// Adds a free solid of uniform density with one shape.
int add_solid(model::Model& model, model::Shape shape, double mass, const Pose& at) {
  Vec3 inertia = Vec3::Constant(0.4 * mass * shape.radius * shape.radius);
  if (shape.kind == ShapeKind::box) {
    const Vec3 e = shape.edges.cwiseAbs2();
    inertia = mass / 12 * Vec3(e.y() + e.z(), e.z() + e.x(), e.x() + e.y());
  } else if (shape.kind != ShapeKind::sphere) {
    const double across = mass * (shape.radius * shape.radius / 4 + shape.length * shape.length / 12);
    inertia = Vec3(across, across, mass * shape.radius * shape.radius / 2);
  }
  shape.body = test::add_body(model, test::body(shape.name, mass, inertia, at));
  model.shapes.push_back(shape);
  return shape.body;
}

// Oracle: the law's own conditions, put to random problems: signs, complementarity, the disc, and slip
// against friction. 12 dofs and 8 contacts, so that impulses are not unique, as where a hand holds an object.
TEST(ContactNewton, MeetsCoulombsLawOnRandomProblems) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  constexpr double kSoftness = 1e-5;
  int sticking = 0, sliding = 0, open = 0;
  for (int trial = 0; trial < 200; ++trial) {
    constexpr int kContacts = 8, kDofs = 12;
    const Eigen::MatrixXd J =
        Eigen::MatrixXd::NullaryExpr(3 * kContacts, kDofs, [&] { return normal(random); });
    // A velocity that the dofs can have, so that a solution exists.
    const Eigen::VectorXd b = J * Eigen::VectorXd::NullaryExpr(kDofs, [&] { return normal(random); });
    ContactNewton solver;
    solver.resize({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11});
    solver.begin();
    std::vector<int> dofs(kDofs);
    for (int i = 0; i < kDofs; ++i) {
      dofs[static_cast<std::size_t>(i)] = i;
      solver.inertia(i, i) = 1;
    }
    for (int i = 0; i < kContacts; ++i) {
      ContactRows& rows = solver.add(dofs, 3);
      rows.open = false;
      rows.softness = kSoftness;
      rows.giving = rows.discs[0].giving = 1;
      rows.disc_count = 1;
      rows.discs[0].coefficient = 0.4;
      rows.discs[0].softness = kSoftness;
      for (int k = 0; k < 3; ++k) {
        rows.start[static_cast<std::size_t>(k)] = b[3 * i + k];
        for (int j = 0; j < kDofs; ++j)
          solver.jacobian(rows)[static_cast<std::size_t>(k * kDofs + j)] = J(3 * i + k, j);
      }
    }
    const NewtonReport report = solver.solve(1e-9);
    ASSERT_TRUE(report.solved) << trial << ": " << report.residual;
    EXPECT_LT(report.iterations, 150);
    Eigen::VectorXd p(3 * kContacts), x(kDofs);
    for (int i = 0; i < kDofs; ++i) x[i] = solver.x()[static_cast<std::size_t>(i)];
    for (int i = 0; i < 3 * kContacts; ++i)
      p[i] = solver.contacts()[static_cast<std::size_t>(i / 3)].impulse[static_cast<std::size_t>(i % 3)];
    EXPECT_LT((x - J.transpose() * p).cwiseAbs().maxCoeff(), 1e-7);
    const Eigen::VectorXd v = b + J * x;
    for (int i = 0; i < kContacts; ++i) {
      const Vec3 v_i = v.segment<3>(3 * i), p_i = p.segment<3>(3 * i);
      const double bound = 0.4 * p_i.x(), friction = p_i.tail<2>().norm(), slip = v_i.tail<2>().norm();
      const double give = kSoftness * p_i.norm() + 1e-9;
      EXPECT_GE(p_i.x(), 0);
      EXPECT_GT(v_i.x(), -give);
      EXPECT_LT(p_i.x() * v_i.x(), 1e-8);
      EXPECT_LE(friction, bound * (1 + 1e-12));
      if (p_i.x() == 0) {
        ++open;
      } else if (friction < bound * (1 - 1e-9)) {
        EXPECT_LT(slip, give);
        ++sticking;
      } else {
        EXPECT_LT(v_i.tail<2>().dot(p_i.tail<2>()), -(1 - 1e-6) * slip * friction + 1e-9);
        ++sliding;
      }
    }
  }
  EXPECT_GT(std::min({sticking, sliding, open}), 10);
}

// Oracle: statics: the forces carry the weights within 0.1 %, and push only.
TEST(ArticulatedContact, CarriesTheWeightAtRest) {
  for (const double step : {1e-3, 5e-3}) {
    model::Model model = model::make_model();
    test::add_ground(model, 0.8);
    add_solid(model, sized("block", ShapeKind::box, 0, 0, Vec3(0.04, 0.03, 0.02)), 0.2,
              {Vec3(0, 0, 0.01), Quat::Identity()});
    add_solid(model, sized("finger", ShapeKind::capsule, 0.008, 0.02), 0.05,
              {Vec3(0, 0, 0.028), rotation_quaternion({0, M_PI / 2, 0})});
    add_solid(model, sized("ball", ShapeKind::sphere, 0.02, 0), 0.1, {Vec3(0.2, 0, 0.02), Quat::Identity()});
    Settings how = settings(kAll, step);
    how.contact_forces = true;
    const auto engine = make_engine(model, how);
    int sweeps = 0;
    for (int i = 0; i < static_cast<int>(2 / step); ++i) {
      const StepReport report = engine->step({});
      sweeps += report.contact_sweeps;
      EXPECT_EQ(report.lcp_failures, 0);
      EXPECT_LE(report.contact_residual, 1e-4 * step);
    }
    // Warm starts: hardly any work at rest.
    EXPECT_LT(sweeps * step / 2, 10);
    std::array<Vec3, 3> on = {Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
    for (const Contact& contact : engine->contacts()) {
      EXPECT_GE(contact.normal_force(), 0);
      // Shape 0 is the ground; the force on b is the opposite of that on a.
      on[static_cast<std::size_t>(contact.shape_b - 1)] -= contact.force;
    }
    EXPECT_NEAR(on[0].z(), 0.25 * kG, 1e-3 * 0.25 * kG);
    EXPECT_NEAR(on[1].z(), 0.05 * kG, 1e-3 * 0.05 * kG);
    EXPECT_NEAR(on[2].z(), 0.1 * kG, 1e-3 * 0.1 * kG);
    EXPECT_LT(on[0].head<2>().norm(), 1e-3 * kG);
  }
}

// Oracle: statics; rms speed at most 10 um/s, depth at most 50 um.
TEST(ArticulatedContact, CapsuleRestsStillOnABox) {
  for (const double yaw : {0.0, 0.2, M_PI / 4})
    for (const double step : {1e-3, 5e-3}) {
      model::Model model = model::make_model();
      test::add_ground(model, 0.8);
      model.shapes[0] = sized("box", ShapeKind::box, 0, 0, Vec3(0.06, 0.06, 0.02));
      const Quat turned = rotation_quaternion({0, 0, yaw}) * rotation_quaternion({0, M_PI / 2, 0});
      add_solid(model, sized("capsule", ShapeKind::capsule, 0.008, 0.04), 0.01,
                {Vec3(0.01, 0, 0.018), turned});
      const auto engine = make_engine(model, settings(kAll, step));
      test::run(*engine, static_cast<int>(1 / step));
      double square = 0;
      const int steps = static_cast<int>(4 / step);
      for (int i = 0; i < steps; ++i) {
        engine->step({});
        square += engine->state().bodies[1].v.squaredNorm();
      }
      EXPECT_LT(std::sqrt(square / steps), 1e-5) << "yaw " << yaw << ", step " << step;
      for (const Contact& contact : engine->contacts()) EXPECT_LT(contact.depth, 5e-5);
    }
}

// Oracle: Coulomb in closed form, friction angle 26.57 deg for 0.5: at 26 deg the box creeps by at most 1
// um in 1 s, at 27.5 deg its speed after 1 s is g (sin a - mu cos a) within 0.5 %, in any direction; and it
// slides straight down.
TEST(ArticulatedContact, InclineSticksAndSlidesAlikeInEveryDirection) {
  for (int k = 0; k < 8; ++k) {
    const double heading = k * M_PI / 8;
    for (const double degrees : {26.0, 27.5}) {
      const double angle = degrees * M_PI / 180;
      model::Model model = model::make_model();
      const Quat tilt = rotation_quaternion(angle * Vec3(std::cos(heading), std::sin(heading), 0));
      test::add_ground(model, 0.5, tilt);
      add_solid(model, sized("box", ShapeKind::box, 0, 0, Vec3::Constant(0.04)), 0.1,
                {tilt * Vec3(0, 0, 0.02), tilt});
      const auto engine = make_engine(model, settings(kAll));
      test::run(*engine, 100);
      const model::BodyState start = engine->state().bodies[1];
      test::run(*engine, 1000);
      const model::BodyState& end = engine->state().bodies[1];
      const double want = std::max(0.0, kG * (std::sin(angle) - 0.5 * std::cos(angle)));
      if (want > 0) {
        EXPECT_NEAR(end.v.norm() - start.v.norm(), want, 5e-3 * want) << degrees << ", " << heading;
        const Vec3 across(std::cos(heading), std::sin(heading), 0);
        EXPECT_LT(std::abs((end.p - start.p).dot(across)), 1e-4 * (end.p - start.p).norm()) << heading;
      } else {
        EXPECT_LT((end.p - start.p).norm(), 1e-6) << degrees << " deg, heading " << heading;
      }
    }
  }
}

// Oracle: Newton's law of restitution.
TEST(ArticulatedContact, BouncesByItsRestitution) {
  for (const double erp : {0.2, 0.8})
    for (const double restitution : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9}) {
      model::Model model = model::make_model();
      test::add_ground(model, 0);
      model.materials[0].restitution = restitution;
      add_solid(model, sized("ball", ShapeKind::sphere, 0.02, 0), 0.1, {Vec3(0, 0, 1.02), Quat::Identity()});
      Settings how = settings(kAll);
      how.erp = erp;
      const auto engine = make_engine(model, how);
      double impact = 0, rebound = 0;
      while (engine->state().time < 0.6) {
        const Vec3 v = engine->state().bodies[1].v;
        impact = std::max(impact, -v.z());
        rebound = std::max(rebound, v.z());
        engine->step({});
      }
      EXPECT_NEAR(impact, std::sqrt(2 * kG), 0.01);
      EXPECT_NEAR(rebound / impact, restitution, 0.05) << "erp " << erp;
    }
}

// Oracle: closed forms. A ball set sliding at v rolls in the end at 5/7 v. One that rolls under rolling
// friction rho is slowed by rho g / r / (1 + 2/5); spinning friction rho brings a spin down by rho m g / I.
TEST(ArticulatedContact, BallsRollAndSpinAsInClosedForm) {
  constexpr double kRadius = 0.03, kRho = 0.0015;
  for (const int kind : {0, 1, 2}) {
    model::Model model = model::make_model();
    test::add_ground(model, 0.8);
    if (kind == 1) model.materials[0].rolling_friction = kRho;
    if (kind == 2) model.materials[0].spinning_friction = kRho;
    const int ball = add_solid(model, sized("ball", ShapeKind::sphere, kRadius, 0), 0.1,
                               {Vec3(0, 0, kRadius), Quat::Identity()});
    model::Body& body = model.bodies[static_cast<std::size_t>(ball)];
    if (kind < 2) body.initial_velocity = Vec3(1, 0, 0);
    if (kind == 1) body.initial_angular_velocity = Vec3(0, 1 / kRadius, 0);
    if (kind == 2) body.initial_angular_velocity = Vec3(0, 0, 50);
    const auto engine = make_engine(model, settings(kAll));
    test::run(*engine, 1000);
    const model::BodyState& now = engine->state().bodies[1];
    const double want = kind == 0 ? 5.0 / 7 : 1 - kRho * kG / kRadius / 1.4;
    if (kind < 2) {
      EXPECT_NEAR(now.v.x(), want, 5e-3);
      EXPECT_NEAR(now.w.y() * kRadius, want, 5e-3);
    } else {
      EXPECT_NEAR(now.w.z(), 50 - kRho * kG / (0.4 * kRadius * kRadius), 0.3);
    }
  }
}

// Oracle: Hooke; a block on a pad of stiffness k sinks by m g / k beyond the layer, however many points carry
// it.
TEST(ArticulatedContact, PadSinksByWeightOverStiffness) {
  model::Model model = model::make_model();
  test::add_ground(model, 0.8);
  model.materials[0].compliance = model::Compliance{4000, 40};
  add_solid(model, sized("block", ShapeKind::box, 0, 0, Vec3::Constant(0.04)), 0.5,
            {Vec3(0, 0, 0.02), Quat::Identity()});
  const auto engine = make_engine(model, settings(kAll));
  test::run(*engine, 3000);
  EXPECT_NEAR(0.02 - engine->state().bodies[1].p.z(), 1e-5 + 0.5 * kG / 2000, 1e-6);
  EXPECT_LT(engine->state().bodies[1].v.norm(), 1e-7);
}

/// Five fingers of capsules that close on a ball, palm down above the ground.
model::Model hand_on_ball() {
  model::Model model = test::five_fingers(true, true, true);
  model::Shape ball = sized("ball", ShapeKind::sphere, 0.025, 0);
  add_solid(model, ball, 0.05, {Vec3(0.01, 0.09, 0.035), Quat::Identity()});
  return model;
}

// Oracle: ODE world_step. Both are of first order: a step four times smaller brings them together at least
// twice as near. Without friction, and with so much that nothing slides (at a friction of 0.8,
// where ODE's pyramid is wider than the cone off its edges, the two stay 15 um apart at any step). On
// pads; rigid surfaces without restoring speed, which is as large as the depth that the last step before an
// impact happens to leave, whatever the step.
TEST(ArticulatedContact, HandClosingOnABallAgreesWithOdeAsTheStepShrinks) {
  struct Case {
    bool pads;
    double friction;
  };
  for (const Case& c : {Case{true, 0}, Case{false, 0}, Case{true, 20}}) {
    model::Model model = hand_on_ball();
    model.materials[0].friction = c.friction;
    if (c.pads) model.materials[0].compliance = model::Compliance{2000, 5};
    const auto run = [&](Method method, double h) {
      Settings how = test::settings(
          {Effect::gravity, Effect::object_contact, Effect::friction, Effect::passive_tissue}, h, method);
      if (!c.pads) how.erp = 0;
      const auto engine = make_engine(model, how);
      std::vector<double> torques(static_cast<std::size_t>(model.dof_count()), 0.0);
      for (std::size_t i = 0; i < torques.size(); i += 4) torques[i] = torques[i + 2] = 0.01;
      int touching = 0;
      for (long i = 0; i < std::lround(0.06 / h); ++i)
        touching = std::max(touching, engine->step({torques}).contacts);
      EXPECT_GT(touching, 1);
      return engine->state();
    };
    const auto distance = [&](double h) {
      const model::State a = run(Method::semi_implicit_euler, h), b = run(Method::world_step, h);
      double out = 0;
      for (std::size_t i = 0; i < a.bodies.size(); ++i)
        out = std::max(out, (a.bodies[i].p - b.bodies[i].p).norm());
      return out;
    };
    const double coarse = distance(2.5e-4), fine = distance(6.25e-5), finest = distance(1.5625e-5);
    EXPECT_LT(coarse, 5e-5);
    EXPECT_LT(fine, 0.5 * coarse) << c.pads << ' ' << c.friction;
    EXPECT_LT(finest, 0.5 * fine) << c.pads << ' ' << c.friction;
  }
}

// Oracle: ODE world_step; of first order both: steps four times smaller bring the two within a third. A
// closed loop, the slider-crank, pushes a block over a floor with friction; the loop stays whole.
TEST(ArticulatedContact, SliderCrankPushingABlockAgreesWithOdeAsTheStepShrinks) {
  using handsim::test::kSlider;
  model::Model model = handsim::test::slider_crank(study::SliderCrankSpec::iftomm());
  model.groups = {{"slider"}, {"block"}, {"floor"}};
  model.materials = {test::material("smooth", 0), test::material("rough", 0.3)};
  model.materials[0].compliance = model::Compliance{2e4, 50};
  model.contact_rules = {{0, 1, 0}, {1, 2, 1}};
  model.shapes = {sized("slider", ShapeKind::box, 0, 0, Vec3(0.04, 0.02, 0.02)),
                  test::shape("floor", ShapeKind::plane, 0)};
  model.shapes[0].body = kSlider;
  model.shapes[1].group = 2;
  model.shapes[1].pose.p = Vec3(0, 0, -0.02);
  const auto block =
      static_cast<std::size_t>(add_solid(model, sized("block", ShapeKind::box, 0, 0, Vec3(0.06, 0.04, 0.04)),
                                         0.3, {Vec3(0.26, 0, 0), Quat::Identity()}));
  model.shapes[2].group = 1;
  const auto run = [&](Method method, double h) {
    Settings how = test::settings(
        {Effect::gravity, Effect::object_contact, Effect::ground_contact, Effect::friction}, h, method);
    if (method == Method::world_step) how.erp = 0.8;
    const auto engine = make_engine(model, how);
    for (long i = 0; i < std::lround(0.2 / h); ++i) {
      EXPECT_EQ(engine->step({}).lcp_failures, 0);
      if (method == Method::world_step) continue;
      for (const model::Joint& joint : model.joints)
        EXPECT_LT(model::joint_gap(joint, engine->state()), 1e-12);
    }
    return engine->state();
  };
  std::vector<double> distances;
  for (const double h : {1e-3, 2.5e-4, 6.25e-5}) {
    const model::State a = run(Method::semi_implicit_euler, h), b = run(Method::world_step, h);
    EXPECT_GT(a.bodies[block].p.x(), 0.29);
    distances.push_back(std::max((a.bodies[block].p - b.bodies[block].p).norm(),
                                 (a.bodies[kSlider].p - b.bodies[kSlider].p).norm()));
  }
  EXPECT_LT(distances[0], 1e-5);
  EXPECT_LT(distances[1], distances[0] / 3);
  EXPECT_LT(distances[2], distances[1] / 3);
}

// Oracle: bit equality of two runs, and of a run after others in the same process.
TEST(ArticulatedContact, RepeatsItselfToTheBit) {
  const model::Model model = hand_on_ball();
  const auto run = [&] {
    const auto engine =
        make_engine(model, settings({Effect::gravity, Effect::object_contact, Effect::friction,
                                     Effect::passive_tissue, Effect::joint_stops}));
    test::run(*engine, 300);
    return test::bits(engine->state());
  };
  EXPECT_EQ(run(), run());
}

// Oracle: the effects' definition.
TEST(ArticulatedContact, NoCollisionCodeRunsWithoutAContactEffectAndRule) {
  model::Model model = hand_on_ball();
  const auto without = make_engine(model, settings({Effect::gravity, Effect::friction}));
  EXPECT_FALSE(without->tests_contacts());
  const StepReport report = without->step({});
  EXPECT_EQ(report.collide_calls + report.contacts, 0);
  EXPECT_EQ(report.collide_ns, 0);
  EXPECT_TRUE(make_engine(model, settings({Effect::object_contact}))->tests_contacts());
  model.contact_rules.clear();
  EXPECT_FALSE(make_engine(model, settings({Effect::object_contact}))->tests_contacts());
}

/// A bar along x, hinged at its end, that gravity turns down onto the ground.
model::Model bar(std::optional<model::Stop> stop) {
  model::Model model = model::make_model();
  test::add_ground(model, 0);
  test::add_body(model, test::body("bar", 0.1, {1e-5, 1e-4, 1e-4}));
  // The ground is not the world's own: jointed bodies are not tested against each other.
  model::Body table = test::body("table", 1, {1, 1, 1});
  table.kinematic = true;
  model.shapes[0].body = test::add_body(model, table);
  test::add_joint(model, "pin", model::JointKind::hinge, 0, 1, {Vec3(0, 0, 0.05), Quat::Identity()},
                  {Vec3(-0.05, 0, 0), Quat::Identity()}, {Vec3::UnitY()});
  model.joints[0].axes[0].stop = stop;
  model::Shape ball = test::shape("tip", ShapeKind::sphere, 1);
  ball.radius = 0.01;
  ball.pose.p = Vec3(0.05, 0, 0);
  model.shapes.push_back(ball);
  return model;
}

// Oracles: geometry and statics: the tip stops the bar where it touches the ground, at sin q = (0.05 - 0.01)
// / 0.1, with m g/2 on it; a stop above the ground leaves nothing for the contact; and a stop and a contact
// at once let neither be passed.
TEST(ArticulatedContact, SharesTheLoadWithStops) {
  const double touch = std::asin(0.4);
  for (const double stop_at : {1.0, touch + 1e-7, 0.3}) {
    const model::Model model = bar(model::Stop{-0.5, stop_at, 0, 1});
    Settings how = settings({Effect::gravity, Effect::ground_contact, Effect::joint_stops});
    how.contact_forces = true;
    const auto engine = make_engine(model, how);
    StepReport report;
    for (int i = 0; i < 1500; ++i) report = engine->step({});
    const double q = model::coordinates(model, engine->state())[0];
    EXPECT_LE(q, stop_at + 1e-12);
    EXPECT_NEAR(q, std::min(touch, stop_at), 3e-4);
    double force = 0;
    for (const Contact& contact : engine->contacts()) force += contact.force.norm();
    if (stop_at == 1.0) {
      EXPECT_NEAR(force, 0.05 * kG, 1e-3 * 0.05 * kG);
    }
    if (stop_at == 0.3) {
      EXPECT_EQ(force, 0);
      EXPECT_EQ(report.stop_rows, 1);
    }
  }
}

// Oracle: statics: a servo at its torque limit presses the tip down with limit / (0.1 cos q), and one far
// below it with its spring's torque; the weight's part is known.
TEST(ArticulatedContact, KeepsTorqueLimitsWhilePressing) {
  const model::Model model = bar(std::nullopt);
  const double q = std::asin(0.4), arm = 0.1 * std::cos(q);
  for (const double limit : {0.02, 1.0}) {
    Settings how = settings({Effect::gravity, Effect::ground_contact, Effect::actuation});
    how.contact_forces = true;
    const auto engine = make_engine(model, how);
    for (int i = 0; i < 1500; ++i) {
      const double now = model::coordinates(model, engine->state())[0];
      const model::Servo servo{1, 0.02, 0.5 - now, 0, limit};
      engine->step({.servos = std::span(&servo, 1)});
    }
    const double at_rest = model::coordinates(model, engine->state())[0];
    const double torque = std::min(limit, 0.5 - at_rest);
    ASSERT_EQ(engine->contacts().size(), 1U);
    EXPECT_NEAR(engine->contacts()[0].normal_force(), torque / arm + 0.05 * kG, 2e-3 * (torque / arm));
  }
}

// Oracle: Coulomb: two fingers of a kinematic palm squeeze a ball between them and hold it up against gravity
// by friction alone; without friction it falls.
TEST(ArticulatedContact, PinchHoldsABallByFriction) {
  for (const bool friction : {true, false}) {
    model::Model model = model::make_model();
    model.groups = {{"all"}};
    model.contact_rules = {{0, 0}};
    model.materials = {test::material("rubber", 0.8)};
    model.materials[0].spinning_friction = 0.002;
    model::Body palm = test::body("palm", 0.3, {3e-4, 3e-4, 5e-4});
    palm.kinematic = true;
    test::add_body(model, palm);
    for (const double side : {-1.0, 1.0}) {
      const std::string name = side < 0 ? "left" : "right";
      const int finger = test::add_body(model, test::body(name, 0.02, {4e-6, 4e-6, 1e-6}));
      test::add_joint(model, name + "_slide", model::JointKind::slider, 1, finger,
                      {Vec3(side * 0.04, 0, 0), Quat::Identity()}, {}, {Vec3::UnitX()});
      model::Shape box = sized(name + "_box", ShapeKind::box, 0, 0, Vec3(0.02, 0.04, 0.04));
      box.body = finger;
      model.shapes.push_back(box);
    }
    add_solid(model, sized("ball", ShapeKind::sphere, 0.0299, 0), 0.1, {Vec3::Zero(), Quat::Identity()});
    model.gravity = Vec3(0, 0, -kG);
    Settings how = settings({Effect::gravity, Effect::object_contact});
    if (friction) how.effects.add(Effect::friction);
    const auto engine = make_engine(model, how);
    const std::vector<double> torques = {2, -2};
    for (int i = 0; i < 100; ++i) engine->step({torques});
    const double z = engine->state().bodies[4].p.z();
    for (int i = 0; i < 500; ++i) engine->step({torques});
    if (friction)
      EXPECT_NEAR(engine->state().bodies[4].p.z(), z, 1e-6);
    else
      EXPECT_LT(engine->state().bodies[4].p.z(), z - 0.02);
  }
}

}  // namespace
}  // namespace handsim::engine
