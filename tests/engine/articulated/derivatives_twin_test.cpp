// A step and its derivatives against a twin: a finger of two links that touches a ball, in a plane, written
// here from the laws alone, in dual numbers that go through a Newton iteration of its own.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/articulated/step_differences.h"
#include "engine/contact_scenes.h"
#include "handsim/engine/articulated/articulated_engine.h"

namespace handsim::engine::articulated {
namespace {

using model::Effect;

/// Coordinates: two angles about y, the ball's turn about y, its place x and z. Unknowns: the changes of
/// their rates, and an impulse of friction.
constexpr int kCoordinates = 5, kUnknowns = 6, kInputs = 2 * kCoordinates + 2;

/// A number and its derivatives by (q, u, torques), then by the unknowns.
struct Dual {
  double value = 0;
  std::array<double, kInputs + kUnknowns> by{};
  Dual(double number = 0) : value(number) {}  // NOLINT: numbers are constants
};
Dual chain(double value, const Dual& a, double by_a, const Dual& b = {}, double by_b = 0) {
  Dual out(value);
  for (std::size_t i = 0; i < out.by.size(); ++i) out.by[i] = by_a * a.by[i] + by_b * b.by[i];
  return out;
}
Dual operator+(const Dual& a, const Dual& b) { return chain(a.value + b.value, a, 1, b, 1); }
Dual operator-(const Dual& a, const Dual& b) { return chain(a.value - b.value, a, 1, b, -1); }
Dual operator*(const Dual& a, const Dual& b) { return chain(a.value * b.value, a, b.value, b, a.value); }
Dual inverse(const Dual& a) { return chain(1 / a.value, a, -1 / (a.value * a.value)); }
Dual sin(const Dual& a) { return chain(std::sin(a.value), a, std::cos(a.value)); }
Dual cos(const Dual& a) { return chain(std::cos(a.value), a, -std::sin(a.value)); }
Dual sqrt(const Dual& a) { return chain(std::sqrt(a.value), a, 0.5 / std::sqrt(a.value)); }
Dual within(double most, const Dual& a) {
  return std::abs(a.value) > most ? Dual(std::copysign(most, a.value)) : a;
}

struct Vec2 {
  Dual x, z;
};
Vec2 operator+(const Vec2& a, const Vec2& b) { return {a.x + b.x, a.z + b.z}; }
Vec2 operator*(const Dual& s, const Vec2& a) { return {s * a.x, s * a.z}; }
Vec2 operator-(const Vec2& a, const Vec2& b) { return a + Dual(-1) * b; }
Dual dot(const Vec2& a, const Vec2& b) { return a.x * b.x + a.z * b.z; }
/// Velocity at r of a turn about y.
Vec2 turned(const Vec2& r) { return {r.z, Dual(-1) * r.x}; }
/// A point so far below the joint in a link at an angle.
Vec2 below(const Dual& angle, double way) { return {Dual(-way) * sin(angle), Dual(-way) * cos(angle)}; }

/// The active set is what the engine's step has to find, too.
struct Case {
  bool sticks = false;  ///< friction holds; else it is at its limit
  bool lands = false;   ///< the second joint, on its stop
  double friction = 0.3, servo_limit = 1, low = -2;
  double share = 0.3;  ///< place of the contact along the pad; 1: its end
  double angle = 0.8;  ///< direction of the ball
  std::array<double, kCoordinates> u = {};
};

constexpr double kStep = 1e-3, kMass[] = {0.02, 0.01}, kInertia[] = {4e-6, 1.5e-6}, kLength[] = {0.05, 0.04};
constexpr double kRadius = 0.007, kSegment = 0.026;  // of the pad's capsule, in the middle of the second link
constexpr double kBallMass = 0.03, kBall = 0.02, kStiffness = 1500, kDamping = 3;
constexpr std::array<double, 2> kTorques = {0.02, -0.01};
const model::Tissue kTissue = {0.05, 1e-3, 0.2};  // of the first joint

std::array<model::Servo, 2> servos_of(const Case& of) {
  return {model::Servo{0.8, 0.01, -0.1, -0.01, of.servo_limit},
          model::Servo{0.4, 0.004, -0.05, -0.01, of.servo_limit}};
}

using Values = std::array<Dual, kUnknowns>;

/// What has to vanish.
Values residual(const Case& of, const Values& x, const Values& q, const Values& u, const Values& torque) {
  const Dual h = kStep, angle[] = {q[0], q[0] + q[1]}, spin[] = {u[0], u[0] + u[1]};
  Values end, out;
  for (std::size_t i = 0; i < kCoordinates; ++i) end[i] = u[i] + x[i];
  const Vec2 knuckle = below(angle[0], kLength[0]), tip = knuckle + below(angle[1], kLength[1] / 2);
  for (int i = 0; i < 2; ++i) {
    const Vec2 centre = i ? tip : below(angle[0], kLength[0] / 2);
    const Vec2 by[] = {turned(centre), i ? turned(tip - knuckle) : Vec2{}};
    // Towards the joints by the rates at the start.
    const Vec2 inward =
        i ? spin[0] * spin[0] * knuckle + spin[1] * spin[1] * (tip - knuckle) : spin[0] * spin[0] * centre;
    const Vec2 change = x[0] * by[0] + x[1] * by[1] - h * inward + Vec2{0, h * engine::test::kG};
    const Dual turn = Dual(kInertia[i]) * (x[0] + Dual(i) * x[1]);
    out[0] = out[0] + Dual(kMass[i]) * dot(by[0], change) + turn;
    out[1] = out[1] + Dual(kMass[i]) * dot(by[1], change) + Dual(i) * turn;
  }
  for (std::size_t k = 0; k < 2; ++k) {
    const model::Servo servo = servos_of(of)[k];
    const Dual pull = Dual(servo.feed + servo.stiffness * servo.error) -
                      Dual(std::max(kStep * servo.stiffness, servo.damping)) * end[k];
    out[k] = out[k] - h * (torque[k] + within(servo.limit, pull));
  }
  out[0] = out[0] + h * (Dual(kTissue.stiffness) * (q[0] + h * end[0] - kTissue.rest) +
                         Dual(kTissue.damping) * end[0]);
  out[2] = Dual(0.4 * kBallMass * kBall * kBall) * x[2];
  out[3] = Dual(kBallMass) * x[3];
  out[4] = Dual(kBallMass) * (x[4] + h * engine::test::kG);

  // The capsule's nearest point, and the contact midway between both surfaces.
  const Vec2 ball{q[3], q[4]}, along = below(angle[1], 1);
  const Vec2 nearest = tip + within(kSegment / 2, dot(along, ball - tip)) * along, apart = nearest - ball;
  const Dual distance = sqrt(dot(apart, apart));
  const Vec2 normal = inverse(distance) * apart, across = turned(normal);
  const Vec2 point = nearest + Dual(0.5) * (Dual(kBall - kRadius) - distance) * normal;
  const Vec2 by[] = {turned(point), turned(point - knuckle), turned(ball - point), {-1, 0}, {0, -1}};
  Vec2 v;
  for (std::size_t k = 0; k < kCoordinates; ++k) v = v + end[k] * by[k];
  // A spring at the step's start, damped by h k at least; surfaces keep a layer of 10 um.
  const Dual depth = Dual(kRadius + kBall - 1e-5) - distance, away = dot(v, normal), slip = dot(v, across);
  const Dual push = h * (Dual(kStiffness) * depth - Dual(std::max(kStep * kStiffness, kDamping)) * away);
  out[5] = of.sticks ? slip : x[5] + Dual(std::copysign(of.friction, slip.value)) * push;
  for (std::size_t k = 0; k < kCoordinates; ++k) out[k] = out[k] - dot(by[k], push * normal + x[5] * across);
  if (of.lands) out[1] = end[1] - Dual(1 / kStep) * (Dual(of.low) - q[1]);
  return out;
}

/// Newton's method: the iterations after the last change bring the derivatives.
Values solved(const Case& of, const Values& q, const Values& u, const Values& torque) {
  Values x;
  for (std::size_t i = 0; i < kUnknowns; ++i) x[i].by[kInputs + i] = 1;
  for (int iteration = 0; iteration < 12; ++iteration) {
    const Values F = residual(of, x, q, u, torque);
    Eigen::Matrix<double, kUnknowns, 1 + kInputs + kUnknowns> rows;
    for (int i = 0; i < kUnknowns; ++i) {
      rows(i, 0) = F[as_index(i)].value;
      for (int j = 0; j < kInputs + kUnknowns; ++j) rows(i, 1 + j) = F[as_index(i)].by[as_index(j)];
    }
    const Eigen::MatrixXd change =
        rows.rightCols<kUnknowns>().partialPivLu().solve(rows.leftCols<1 + kInputs>());
    for (int i = 0; i < kUnknowns; ++i) {
      x[as_index(i)].value -= change(i, 0);
      for (int j = 0; j < kInputs; ++j) x[as_index(i)].by[as_index(j)] -= change(i, 1 + j);
    }
  }
  return x;
}

model::Model model_of(const Case& of) {
  model::Model out = model::make_model();
  out.groups = {{"all"}};
  out.materials = {engine::test::material("pad", of.friction)};
  out.materials[0].compliance = model::Compliance{kStiffness, kDamping};
  out.contact_rules = {{0, 0, 0}};
  for (int i = 0; i < 2; ++i) {
    const int child = engine::test::add_body(
        out, engine::test::body(i ? "tip" : "link", kMass[i], Vec3::Constant(kInertia[i])));
    engine::test::add_joint(out, i ? "second" : "first", model::JointKind::hinge, child - 1, child,
                            {Vec3(0, 0, i ? -kLength[0] / 2 : 0), Quat::Identity()},
                            {Vec3(0, 0, kLength[i] / 2), Quat::Identity()}, {Vec3::UnitY()});
  }
  out.joints[0].axes[0].tissue = kTissue;
  out.joints[1].axes[0].stop = model::Stop{of.low, 2, 0};
  model::Shape pad = engine::test::sized("pad", model::ShapeKind::capsule, kRadius, kSegment);
  pad.body = 2;
  out.shapes.push_back(pad);
  engine::test::add_solid(out, engine::test::sized("ball", model::ShapeKind::sphere, kBall, 0), kBallMass,
                          {});
  return out;
}

/// The step and its derivatives are those of the twin, relative to the largest number of those of positions
/// and of rates by positions, rates and torques. The ball lies 0.1 mm inside the pad.
void expect_twins(const Case& of, double step_error, double error) {
  const double a = 0.8, way = kLength[1] / 2 + of.share * kSegment / 2, reach = kRadius + kBall - 1e-4;
  const std::array<double, kCoordinates> start = {
      0.3, a - 0.3, 0, -kLength[0] * std::sin(0.3) - way * std::sin(a) + reach * std::cos(of.angle),
      -kLength[0] * std::cos(0.3) - way * std::cos(a) - reach * std::sin(of.angle)};
  // Places of the coordinates among the engine's.
  const std::array<int, kCoordinates> place = {0, 1, 3, 5, 7};
  Values q, u, torque;
  Eigen::VectorXd change = Eigen::VectorXd::Zero(16), twin = change;
  for (std::size_t i = 0; i < kCoordinates; ++i) {
    change[place[i]] = start[i], change[8 + place[i]] = of.u[i];
    q[i] = start[i], u[i] = of.u[i];
    q[i].by[i] = u[i].by[kCoordinates + i] = 1;
  }
  for (std::size_t i = 0; i < 2; ++i) torque[i] = kTorques[i], torque[i].by[2 * kCoordinates + i] = 1;
  const Values x = solved(of, q, u, torque);

  const model::Model model = model_of(of);
  ArticulatedEngine engine(
      model, engine::test::settings({Effect::gravity, Effect::object_contact, Effect::friction,
                                     Effect::passive_tissue, Effect::actuation, Effect::joint_stops},
                                    kStep, ArticulatedMethod::semi_implicit_euler));
  const test::Coordinates coordinates(model);
  const model::State origin = model::initial_state(model);
  engine.set_state(coordinates.moved(origin, change));
  StepDerivatives found;
  engine.derive(&found);
  const std::array<model::Servo, 2> servos = servos_of(of);
  engine.step({.torques = kTorques, .servos = servos});
  engine.derive(nullptr);
  EXPECT_EQ(found.notes, std::vector<std::string>());

  Eigen::MatrixXd oracle = Eigen::MatrixXd::Zero(16, kInputs), slopes = oracle;
  for (std::size_t i = 0; i < kCoordinates; ++i) {
    const Dual rate = u[i] + x[i], position = q[i] + Dual(kStep) * rate;
    twin[place[i]] = position.value, twin[8 + place[i]] = rate.value;
    for (int j = 0; j < kInputs; ++j) {
      oracle(place[i], j) = position.by[as_index(j)], oracle(8 + place[i], j) = rate.by[as_index(j)];
    }
    slopes.col(static_cast<int>(i)) = found.by_state.col(place[i]);
    slopes.col(kCoordinates + static_cast<int>(i)) = found.by_state.col(8 + place[i]);
  }
  slopes.rightCols<2>() = found.by_torque.leftCols<2>();
  EXPECT_LT(test::error(coordinates.apart(engine.state(), origin), twin), step_error);
  for (const int row : {0, 8})
    for (const auto& [first, count] : {std::pair(0, 5), {5, 5}, {10, 2}}) {
      const Eigen::MatrixXd want = oracle.block(row, first, 8, count);
      EXPECT_LT((slopes.block(row, first, 8, count) - want).lpNorm<Eigen::Infinity>(),
                error * want.lpNorm<Eigen::Infinity>());
    }
}

TEST(DerivativesTwin, OfAPadThatSlidesOnABall) {
  expect_twins({.u = {-0.4, -1, 3, 0.2, 0.5}}, 1e-12, 1e-9);
  expect_twins({.share = 1, .angle = 1.6, .u = {-0.4, -1, 3, 0.2, 0.5}}, 1e-12, 1e-9);
}

// 1e-7: the creep that friction's regularisation allows (tuning.h), which the twin does not have.
TEST(DerivativesTwin, OfAPadThatSticks) {
  expect_twins({.sticks = true, .friction = 2, .share = 1, .angle = 1.6, .u = {0, 0, 0, 0, 0.3}}, 1e-7, 1e-7);
}

TEST(DerivativesTwin, OfAJointThatLandsAndAServoAtItsLimit) {
  expect_twins({.lands = true, .servo_limit = 0.03, .low = 0.499, .u = {-0.4, -3, 3, 0.2, 0.5}}, 1e-12, 1e-9);
}

}  // namespace
}  // namespace handsim::engine::articulated
