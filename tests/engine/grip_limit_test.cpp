// What a grip can carry, against a reference that knows nothing of steps: balls press on a box with given
// forces, so that normal forces are known, and the largest load is a small problem with friction cones that
// can be solved to rounding.
#include <gtest/gtest.h>

#include <cmath>
#include <ostream>

#include "engine/contact_scenes.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::JointKind;
using model::ShapeKind;

constexpr double kEdge = 0.06, kBall = 0.01, kBoxMass = 0.2, kBallMass = 1e-3, kFingerFriction = 0.6;
/// Lengths by which rotations are made speeds [m].
constexpr double kLength = 0.03;

/// Two balls that press with one force on opposite faces.
struct Fingers {
  int axis = 0;         ///< of the faces' normals
  double y = 0, z = 0;  ///< of the contacts along the next two axes, from the middle of the face [m]
  double force = 0;     ///< [N]
};

struct GripCase {
  std::string name;
  std::vector<Fingers> fingers;
  Vec3 gravity = Vec3::Zero();  ///< [m/s^2]
};
void PrintTo(const GripCase& what, std::ostream* out) { *out << what.name; }

using Twist = Eigen::Matrix<double, 6, 1>;

/// A contact of the reference, in the frame of the box.
struct Point {
  Vec3 at = Vec3::Zero(), into = Vec3::Zero();  ///< place; unit, into the box
  double force = 0;                             ///< normal [N]
};

std::vector<Point> points_of(const GripCase& of) {
  std::vector<Point> out;
  for (const Fingers& pair : of.fingers)
    for (const double side : {-1.0, 1.0}) {
      Vec3 at;
      at[pair.axis] = side * kEdge / 2;
      at[(pair.axis + 1) % 3] = pair.y;
      at[(pair.axis + 2) % 3] = pair.z;
      out.push_back({at, -side * Vec3::Unit(pair.axis), pair.force});
    }
  return out;
}

/// Tangential velocity at a contact, by the box's velocity and kLength times its rotation.
Eigen::Matrix<double, 3, 6> slip_rows(const Point& point) {
  Eigen::Matrix<double, 3, 6> rows;
  rows.leftCols<3>().setIdentity();
  rows.rightCols<3>() << 0, point.at.z(), -point.at.y(), -point.at.z(), 0, point.at.x(), point.at.y(),
      -point.at.x(), 0;
  rows.rightCols<3>() /= kLength;
  return rows - point.into * (point.into.transpose() * rows);
}

struct Limit {
  double load = 0;             ///< the largest multiple of the load
  std::vector<Vec3> friction;  ///< on the box there [N]
  std::vector<bool> slides;    ///< so that this friction is the only one that balances
  double unbalanced = 0;       ///< largest component of what these forces leave over [N]
  double more = 0;             ///< no multiple is larger by more than this
};

/// Friction within discs that balances the largest multiple of a load: a convex problem, as the normal forces
/// are given. An interior-point method: |friction|^2 < limit^2 by a barrier, which is made ever smaller; each
/// time Newton's method on forces, multiple and the balance's multipliers at once. These are a motion with
/// power 1 of the load, and what friction takes in it bounds every multiple (limit analysis, Hill 1951).
Limit limit_of(const std::vector<Point>& points, const Twist& load) {
  const auto count = static_cast<Eigen::Index>(points.size()), n = 2 * count + 1;
  Eigen::MatrixXd balance(6, n);
  std::vector<Eigen::Matrix<double, 3, 2>> across;
  for (Eigen::Index i = 0; i < count; ++i) {
    const Point& point = points[static_cast<std::size_t>(i)];
    auto& tangents = across.emplace_back();
    tangents << point.into.unitOrthogonal(), point.into.cross(point.into.unitOrthogonal());
    balance.middleCols<2>(2 * i) = slip_rows(point).transpose() * tangents;
  }
  balance.col(n - 1) = load;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n), multipliers;
  const auto room = [&](const Eigen::VectorXd& of, Eigen::Index i) {
    const double limit = kFingerFriction * points[static_cast<std::size_t>(i)].force;
    return limit * limit - of.segment<2>(2 * i).squaredNorm();
  };
  for (double barrier = 1; barrier > 1e-13; barrier /= 2)
    for (int round = 0; round < 20; ++round) {
      Eigen::MatrixXd system = Eigen::MatrixXd::Zero(n + 6, n + 6);
      Eigen::VectorXd right = Eigen::VectorXd::Zero(n + 6);
      for (Eigen::Index i = 0; i < count; ++i) {
        const Eigen::Vector2d f = x.segment<2>(2 * i);
        const double left = room(x, i);
        right.segment<2>(2 * i) = -2 * barrier / left * f;
        system.block<2, 2>(2 * i, 2 * i) =
            2 * barrier / left * (Eigen::Matrix2d::Identity() + 2 / left * f * f.transpose());
      }
      right[n - 1] = 1;
      right.tail<6>() = -balance * x;
      system.topRightCorner(n, 6) = balance.transpose();
      system.bottomLeftCorner(6, n) = balance;
      const Eigen::VectorXd solved = system.completeOrthogonalDecomposition().solve(right);
      const Eigen::VectorXd step = solved.head(n);
      multipliers = solved.tail<6>();
      double share = 1;
      for (Eigen::Index i = 0; i < count; ++i)
        while (room(x + share * step, i) <= 0.1 * room(x, i)) share /= 2;
      x += share * step;
      if (share == 1 && step.norm() < 1e-9 * x.norm()) break;
    }
  Limit out;
  out.load = x[n - 1];
  out.unbalanced = (balance * x).cwiseAbs().maxCoeff();
  const Twist motion = multipliers / load.dot(multipliers);
  double taken = 0, fastest = 0;
  for (const Point& point : points) fastest = std::max(fastest, (slip_rows(point) * motion).norm());
  for (std::size_t i = 0; i < points.size(); ++i) {
    out.friction.emplace_back(across[i] * x.segment<2>(2 * static_cast<Eigen::Index>(i)));
    const double slip = (slip_rows(points[i]) * motion).norm();
    taken += kFingerFriction * points[i].force * slip;
    out.slides.push_back(slip > 1e-3 * fastest);
  }
  out.more = taken - out.load;
  return out;
}

model::Model gripped_box(const GripCase& of) {
  model::Model model = model::make_model();
  model.gravity = of.gravity;
  model.groups = {{"box"}, {"balls"}};
  model.contact_rules = {{0, 1}};
  model.materials = {test::material("pad", kFingerFriction)};
  model.materials[0].compliance = model::Compliance{1e5, 100};
  test::add_solid(model, test::sized("box", ShapeKind::box, 0, 0, Vec3::Constant(kEdge)), kBoxMass, {});
  for (const Point& point : points_of(of)) {
    const std::string name = "ball" + std::to_string(model.bodies.size());
    const int ball = test::add_body(model, test::body(name, kBallMass, Vec3::Constant(1e-6)));
    test::add_joint(model, name, JointKind::slider, 0, ball,
                    {point.at - kBall * point.into, Quat::Identity()}, {}, {point.into});
    model::Shape shape = test::sized(name, ShapeKind::sphere, kBall, 0);
    shape.body = ball;
    shape.group = 1;
    model.shapes.push_back(shape);
  }
  return model;
}

const std::vector<GripCase> kCases = {
    {"TwoPairsBesideTheMiddle", {{0, 0.01, 0.005, 4}, {0, 0.02, -0.015, 4}}, {0, 0, -9.81}},
    {"ThreePairsOfUnlikeForce",
     {{0, 0.02, 0.02, 1.5}, {0, -0.005, -0.02, 3}, {0, -0.02, 0.01, 2}},
     {0, -4, -8}},
    {"TwoPairsWithOneAcross", {{0, 0.015, 0, 3}, {0, 0.01, 0.02, 2}, {1, 0.02, -0.01, 2}}, {0, 0, -9.81}},
    {"PairsAboutAllAxes", {{0, 0.015, 0.01, 3}, {1, 0.02, -0.02, 3}, {2, 0.01, 0.02, 3}}, {5, -4, -7}},
    {"FivePairs",
     {{0, 0.02, 0.02, 1}, {0, -0.02, 0.02, 1.5}, {0, 0.02, -0.02, 0.5}, {0, 0, 0.01, 2}, {1, 0, 0.02, 1}},
     {0, 0, -9.81}}};

class GripLimit : public testing::TestWithParam<std::tuple<GripCase, Method>> {};
INSTANTIATE_TEST_SUITE_P(, GripLimit,
                         testing::Combine(testing::ValuesIn(kCases),
                                          testing::Values(Method(OdeMethod::world_step),
                                                          Method(ArticulatedMethod::semi_implicit_euler))),
                         [](const auto& of) {
                           return std::get<0>(of.param).name + "_" + std::string(name(std::get<1>(of.param)));
                         });

/// Largest movement of a corner of the box [m].
double moved(const model::BodyState& from, const model::BodyState& to) {
  double most = 0;
  for (const double x : {-0.5, 0.5})
    for (const double y : {-0.5, 0.5})
      for (const double z : {-0.5, 0.5}) {
        const Vec3 corner = kEdge * Vec3(x, y, z);
        most = std::max(most, (to.pose() * corner - from.pose() * corner).norm());
      }
  return most;
}

Settings grip_settings(Method method) {
  Settings out = test::settings({Effect::gravity, Effect::object_contact, Effect::friction}, 1e-3, method);
  out.contact_forces = true;
  return out;
}

/// Forces of the sliders, with their share of the balls' weight taken off.
std::vector<double> pressing(const GripCase& of, double press) {
  std::vector<double> out;
  for (const Point& point : points_of(of))
    out.push_back(press * point.force - kBallMass * point.into.dot(of.gravity));
  return out;
}

// Oracle: what dry friction holds does not move: less than 0.2 um in 1 s where the balls press half as much
// again as they must.
TEST_P(GripLimit, HoldsStillAboveIt) {
  const auto& [of, method] = GetParam();
  Twist load = Twist::Zero();
  load.head<3>() = kBoxMass * of.gravity;
  const std::vector<double> forces = pressing(of, 1.5 / limit_of(points_of(of), load).load);
  const model::Model model = gripped_box(of);
  const auto engine = make_engine(model, grip_settings(method));
  for (int i = 0; i < 500; ++i) engine->step({forces});
  const model::BodyState start = engine->state().bodies[1];
  for (int i = 0; i < 1000; ++i) engine->step({forces});
  EXPECT_LT(moved(start, engine->state().bodies[1]), 2e-7);
}

// Oracle: limit analysis, solved to 1e-10 of the load by a method of its own: friction that balances the load
// within all cones, and a motion that shows that none balances more. While all presses fall together the box
// stays until they pass the limit, to 0.5 %; there friction is the reference's, to 5 % of its limit, where it
// is unique.
TEST_P(GripLimit, IsThatOfAReferenceWithoutSteps) {
  const auto& [of, method] = GetParam();
  const std::vector<Point> points = points_of(of);
  Twist load = Twist::Zero();
  load.head<3>() = kBoxMass * of.gravity;
  const Limit limit = limit_of(points, load);
  ASSERT_LT(limit.unbalanced, 1e-10 * load.norm());
  ASSERT_LT(std::abs(limit.more), 1e-10 * limit.load);

  const model::Model model = gripped_box(of);
  const auto engine = make_engine(model, grip_settings(method));
  const double least = 1 / limit.load;
  model::BodyState start;
  double press = 0;
  std::vector<Vec3> friction(points.size(), Vec3::Zero());
  // Presses fall by 0.1 % in 10 ms: in the 30 ms in which the box falls by 5 um by 0.3 %.
  for (int i = 0; i < 3000; ++i) {
    press = i < 300 ? 1.15 * least : (1.15 - 1e-4 * (i - 300)) * least;
    engine->step({pressing(of, press)});
    if (i == 1300) start = engine->state().bodies[1];
    if (i > 1300 && moved(start, engine->state().bodies[1]) > 5e-6) break;
  }
  EXPECT_NEAR(press, least, 0.005 * least);
  for (const Contact& contact : engine->contacts()) {
    const auto body = [&](int shape) { return model.shapes[static_cast<std::size_t>(shape)].body; };
    const bool first = body(contact.shape_a) == 1;
    const auto ball = static_cast<std::size_t>(body(first ? contact.shape_b : contact.shape_a) - 2);
    friction[ball] += (first ? 1 : -1) * contact.friction_force();
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!limit.slides[i]) continue;
    EXPECT_LT((friction[i] - least * limit.friction[i]).norm(),
              0.05 * kFingerFriction * least * points[i].force)
        << "ball " << i << ": " << friction[i].transpose() << ", reference "
        << least * limit.friction[i].transpose();
  }
}

}  // namespace
}  // namespace handsim::engine
