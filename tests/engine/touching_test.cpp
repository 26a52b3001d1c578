// Every pair of shapes at a gap of 0 when the run begins, aligned and tilted, on both engines.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "engine/contact_scenes.h"
#include "handsim/engine/collision/penetration.h"
#include "handsim/model/convex_mesh.h"

namespace handsim::engine::touching {
namespace {

using model::ShapeKind;

constexpr double kHalf = 0.02, kTie = 1e-12;
constexpr int kSteps = 50;
const std::vector<std::string> kSolids = {"sphere", "capsule", "box", "cylinder", "mesh", "compound"};

/// A pyramid of five corners, about its centroid.
std::shared_ptr<const model::ConvexMesh> pyramid() {
  const std::vector<Vec3> corners = {
      {-0.03, -0.02, 0}, {0.03, -0.02, 0}, {0.03, 0.025, 0}, {-0.03, 0.025, 0}, {0.005, 0.002, 0.08}};
  Vec3 centroid;
  return std::make_shared<const model::ConvexMesh>(
      model::make_convex_mesh(corners, {{0, 3, 2, 1}, {0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}}, centroid));
}

/// The shapes of a solid, in its body's frame.
std::vector<model::Shape> shapes_of(const std::string& solid) {
  const auto one = [](ShapeKind kind, double radius, double length, Vec3 edges = Vec3::Zero()) {
    return test::sized("part", kind, radius, length, edges);
  };
  if (solid == "sphere") return {one(ShapeKind::sphere, kHalf, 0)};
  if (solid == "capsule") return {one(ShapeKind::capsule, 0.015, 0.04)};
  if (solid == "box") return {one(ShapeKind::box, 0, 0, Vec3::Constant(2 * kHalf))};
  if (solid == "cylinder") return {one(ShapeKind::cylinder, kHalf, 2 * kHalf)};
  model::Shape mesh = one(ShapeKind::convex_mesh, 0, 0);
  mesh.mesh = pyramid();
  if (solid == "mesh") return {mesh};
  // As the halves of a bottle: a mesh below, a ball in it above.
  model::Shape ball = one(ShapeKind::sphere, 0.01, 0);
  ball.pose.p = {0, 0, 0.02};
  return {mesh, ball};
}

/// The middle of the points of a shape that are farthest in a direction, in the shape's frame.
Vec3 farthest(const model::Shape& shape, const Vec3& along) {
  const auto end = [](double slope) { return std::abs(slope) < kTie ? 0.0 : std::copysign(1.0, slope); };
  const Vec3 across(along.x(), along.y(), 0);
  const Vec3 rim = across.norm() < kTie ? Vec3(Vec3::Zero()) : Vec3(across.normalized());
  switch (shape.kind) {
    case ShapeKind::sphere:
      return shape.radius * along;
    case ShapeKind::capsule:
      return shape.radius * along + Vec3(0, 0, 0.5 * shape.length * end(along.z()));
    case ShapeKind::cylinder:
      return shape.radius * rim + Vec3(0, 0, 0.5 * shape.length * end(along.z()));
    case ShapeKind::box:
      return 0.5 * shape.edges.cwiseProduct(along.unaryExpr(end));
    case ShapeKind::convex_mesh: {
      const double most = shape.mesh->support(along);
      Vec3 sum = Vec3::Zero();
      int count = 0;
      for (const Vec3& vertex : shape.mesh->vertices)
        if (vertex.dot(along) > most - kTie) sum += vertex, ++count;
      return sum / count;
    }
    case ShapeKind::plane:
      break;
  }
  return Vec3::Zero();
}

/// The same of a solid, in its body's frame.
Vec3 farthest(const std::vector<model::Shape>& shapes, const Vec3& along) {
  Vec3 best = Vec3::Zero();
  for (const model::Shape& shape : shapes) {
    const Vec3 point = shape.pose * farthest(shape, shape.pose.q.conjugate() * along);
    if (&shape == &shapes.front() || point.dot(along) > best.dot(along)) best = point;
  }
  return best;
}

/// A fixed solid, or `plane`, and a free one whose lowest point is where the fixed one has its highest.
model::Model model_of(const std::string& below, const Quat& turn_below, const std::string& above,
                      const Quat& turn_above, const Quat& tilt) {
  model::Model model = model::make_model();
  test::add_ground(model, 0.5, tilt);
  Vec3 top = Vec3::Zero();
  if (below != "plane") {
    model.shapes.clear();
    const std::vector<model::Shape> fixed = shapes_of(below);
    top = turn_below * farthest(fixed, turn_below.conjugate() * Vec3::UnitZ());
    for (model::Shape shape : fixed) {
      shape.name = "fixed" + std::to_string(model.shapes.size());
      shape.pose = Pose{Vec3::Zero(), tilt * turn_below} * shape.pose;
      model.shapes.push_back(shape);
    }
  }
  const std::vector<model::Shape> free = shapes_of(above);
  const Vec3 low = turn_above * farthest(free, turn_above.conjugate() * -Vec3::UnitZ());
  const Pose start{tilt * (top - low), tilt * turn_above};
  const int body = test::add_body(model, test::body("free", 0.1, Vec3::Constant(0.1 * kHalf * kHalf), start));
  for (model::Shape shape : free) {
    shape.name = "free" + std::to_string(model.shapes.size());
    shape.body = body;
    model.shapes.push_back(shape);
  }
  return model;
}

using Pair = std::tuple<Method, std::string, std::string>;

class AtNoGap : public testing::TestWithParam<Pair> {
 protected:
  /// Steps the pair; nothing but gravity, and what drives surfaces apart, gives the body speed.
  void run(const Quat& turn_below, const Quat& turn_above, const Quat& tilt, bool rests) const {
    const auto& [method, below, above] = GetParam();
    const model::Model model = model_of(below, turn_below, above, turn_above, tilt);
    const auto engine = make_engine(model, test::settings(test::kContact, 1e-3, method));
    const Vec3 start = engine->state().bodies[1].p;
    int contacts = 0;
    for (int i = 1; i <= kSteps; ++i) {
      ASSERT_NO_THROW(contacts += engine->step({}).contacts) << "step " << i;
      for (const Contact& contact : engine->contacts()) {
        ASSERT_NEAR(contact.normal.norm(), 1, 1e-9);
      }
      const double fall = 1e-3 * i * test::kG;
      ASSERT_LE(engine->state().bodies[1].v.norm(), fall + kMaxCorrectingSpeed) << "step " << i;
    }
    // On a slope a corner slides off a corner without another touch.
    EXPECT_GT(contacts, tilt.vec().isZero() ? 0 : -1);
    if (!rests) return;
    EXPECT_NEAR(engine->state().bodies[1].p.z(), start.z(), 5e-5);
  }
};

// Oracle: two surfaces at a gap of 0 push each other with the weight between them. So no step fails, normals
// are unit vectors, the body never has more than the speed of free fall and that at which surfaces are driven
// apart, and what lies flat rests where it was, to 0.05 mm.
TEST_P(AtNoGap, StartsWithoutAFaultAndWithoutAJump) {
  const std::string& below = std::get<1>(GetParam());
  const bool flat = below == "plane" || below == "box" || below == "cylinder";
  for (const Vec3& turn_below : {Vec3(0, 0, 0), Vec3(0.5, 0, 0), Vec3(M_PI / 2, 0, 0)})
    for (const Vec3& turn_above :
         {Vec3(0, 0, 0), Vec3(0.5, 0, 0), Vec3(0, 0.3, 0), Vec3(M_PI / 2, 0, 0), Vec3(M_PI, 0, 0),
          Vec3(0, 0, 0.4), Vec3(0.3, 0.6, 0.15), Vec3(7e-4, 7e-4, 0)})
      for (const Vec3& tilt : {Vec3(0, 0, 0), Vec3(0.3, -0.2, 0)}) {
        SCOPED_TRACE(testing::Message() << turn_below.transpose() << " under " << turn_above.transpose()
                                        << ", tilted by " << tilt.transpose());
        const bool rests = flat && turn_below.isZero() && turn_above.head<2>().isZero() && tilt.isZero();
        run(rotation_quaternion(turn_below), rotation_quaternion(turn_above), rotation_quaternion(tilt),
            rests);
        if (HasFatalFailure()) return;
      }
}

std::vector<Pair> pairs() {
  std::vector<Pair> out;
  for (const Method method : {Method(OdeMethod::world_step), Method(ArticulatedMethod::semi_implicit_euler)})
    for (const std::string& above : kSolids) {
      out.emplace_back(method, "plane", above);
      for (const std::string& below : kSolids) out.emplace_back(method, below, above);
    }
  return out;
}

std::string name_of(const testing::TestParamInfo<Pair>& each) {
  const bool ode = std::holds_alternative<OdeMethod>(std::get<0>(each.param));
  return std::get<2>(each.param) + "_on_" + std::get<1>(each.param) + (ode ? "_ode" : "_articulated");
}

INSTANTIATE_TEST_SUITE_P(Pairs, AtNoGap, testing::ValuesIn(pairs()), name_of);

}  // namespace
}  // namespace handsim::engine::touching
