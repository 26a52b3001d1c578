// Linear and angular momentum of what floats freely on the articulated engine, about a point of the world.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "engine/contact_scenes.h"
#include "engine/shared_motions.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::ShapeKind;
using model::State;
using test::settings;
using test::sized;

/// Rounding of a thousand steps, with a margin; shares of the sums of amounts.
constexpr double kBound = 1e-10;

/// Sums over bodies about a point of the world, and of the amounts that they are made of.
struct Momentum {
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
  double shifts = 0, turns = 0;
};

Momentum momentum(const model::Model& model, const State& state, const Vec3& point = Vec3::Zero()) {
  Momentum out;
  for (std::size_t i = 1; i < model.bodies.size(); ++i) {
    const model::Body& body = model.bodies[i];
    const model::BodyState& at = state.bodies[i];
    const Vec3 p = body.mass * at.v, moment = (at.p - point).cross(p);
    const Vec3 spin = at.q * (body.inertia * (at.q.conjugate() * at.w));
    out.linear += p;
    out.angular += moment + spin;
    out.shifts += p.norm();
    out.turns += moment.norm() + spin.norm();
  }
  return out;
}

/// Largest change of momentum from step to step and since the start, as a share.
class Kept {
 public:
  Kept(const model::Model& model, const State& state) : model_(model), start_(momentum(model, state)) {}
  void update(const State& state, const Vec3& impulse = Vec3::Zero(), const Vec3& moment = Vec3::Zero()) {
    start_.linear += impulse;
    start_.angular += moment;
    const Momentum now = momentum(model_, state);
    start_.shifts = std::max(start_.shifts, now.shifts);
    start_.turns = std::max(start_.turns, now.turns);
    error_ = std::max({error_, (now.linear - start_.linear).norm() / start_.shifts,
                       (now.angular - start_.angular).norm() / start_.turns});
  }
  double error() const { return error_; }

 private:
  const model::Model& model_;
  Momentum start_;
  double error_ = 0;
};

/// A left and a right hand that fly at each other [m/s].
model::Model two_hands(double speed) {
  model::Model out = model::make_model();
  for (const double side : {-1, 1}) {
    hand::Placement placement;
    placement.name = side > 0 ? "right" : "left";
    placement.side = side > 0 ? model::Side::right : model::Side::left;
    placement.mount = hand::Mount::free;
    placement.pose = {Vec3(0.08 * side, 0.02 * side, 0), rotation_quaternion({0.3 * side, 0, 0.2})};
    placement.velocity = Vec3(-speed * side, 0, 0.1);
    placement.angular_velocity = Vec3(1, 2 * side, -1);
    test::add_shipped_hand(out, "anatomical.yaml", placement);
  }
  return out;
}

/// All shapes touch each other.
void touch(model::Model& model) {
  for (int a = 0; a < static_cast<int>(model.groups.size()); ++a)
    for (int b = a; b < static_cast<int>(model.groups.size()); ++b) model.contact_rules.push_back({a, b});
}

void add_box(model::Model& model, const std::string& name, const Vec3& place, const Vec3& v, const Vec3& w) {
  const int box = test::add_solid(model, sized(name, ShapeKind::box, 0, 0, {0.06, 0.04, 0.02}), 0.1,
                                  {place, rotation_quaternion({1, 2, 3})});
  if (model.materials.empty()) model.materials.emplace_back();
  model.shapes.back().group = model.add_group(name);
  model.bodies[static_cast<std::size_t>(box)].initial_velocity = v;
  model.bodies[static_cast<std::size_t>(box)].initial_angular_velocity = w;
}

const std::initializer_list<Effect> kInner = {Effect::joint_stops,  Effect::passive_tissue,
                                              Effect::self_contact, Effect::object_contact,
                                              Effect::friction,     Effect::actuation};

// Oracle: Newton's third law. Hands, fingers, a box, stops, tissue and torques push each other.
TEST(Momentum, IsKeptByHandsAndObjectsThatCollide) {
  for (const double step : {0.25e-3, 1e-3, 5e-3, 20e-3}) {
    model::Model model = two_hands(2);
    add_box(model, "box", {0.06, 0.1, 0.06}, {0, 0, -2}, {10, -20, 30});
    touch(model);
    const auto engine = make_engine(model, settings(kInner, step, ArticulatedMethod::semi_implicit_euler));
    std::vector<double> torques(static_cast<std::size_t>(model.dof_count()), 0.05);
    Kept kept(model, engine->state());
    int contacts = 0;
    for (long i = 0; i < std::lround(0.2 / step); ++i) {
      contacts = std::max(contacts, engine->step({torques}).contacts);
      kept.update(engine->state());
    }
    EXPECT_GT(contacts, 2) << step;
    EXPECT_LT(kept.error(), kBound) << step;
  }
}

// Oracle: the same, of bodies without joints.
TEST(Momentum, IsKeptByObjectsThatCollide) {
  for (const double step : {1e-3, 5e-3}) {
    model::Model model = model::make_model();
    add_box(model, "a", {-0.04, 0, 0}, {2, 0, 0}, {10, -20, 30});
    add_box(model, "b", {0.04, 0.01, 0.01}, {-1, 0, 0}, {-40, 5, 0});
    touch(model);
    const auto engine = make_engine(model, settings({Effect::object_contact, Effect::friction}, step,
                                                    ArticulatedMethod::semi_implicit_euler));
    Kept kept(model, engine->state());
    int contacts = 0;
    for (long i = 0; i < std::lround(0.1 / step); ++i) {
      contacts = std::max(contacts, engine->step({}).contacts);
      kept.update(engine->state());
    }
    EXPECT_GT(contacts, 0) << step;
    EXPECT_LT(kept.error(), kBound) << step;
  }
}

// Oracle: Newton's second law. A force of the world, at a point of a fingertip, and gravity: the point is
// that of the start of a step.
TEST(Momentum, GrowsByTheImpulsesFromOutside) {
  const double step = 2e-3;
  const model::Model model = test::shipped_hand("anatomical.yaml", hand::Mount::free);
  const int tip = static_cast<int>(model.bodies.size()) - 1;
  const auto engine = make_engine(
      model, settings({Effect::gravity, Effect::joint_stops}, step, ArticulatedMethod::semi_implicit_euler));
  double mass = 0;
  for (const model::Body& body : model.bodies) mass += body.kinematic ? 0 : body.mass;
  Kept kept(model, engine->state());
  const Vec3 force(0.2, -0.1, 0.3), moment(1e-3, 2e-3, -1e-3), weight = mass * model.gravity;
  for (int i = 0; i < 200; ++i) {
    const State before = engine->state();
    engine->step({.forces = std::vector<BodyForce>{{tip, force, moment}}});
    // Gravity acts at the mass centre, which moves along with the momentum of the step's end.
    Vec3 centre = Vec3::Zero();
    for (std::size_t k = 1; k < model.bodies.size(); ++k)
      centre += model.bodies[k].mass / mass * before.bodies[k].p;
    kept.update(
        engine->state(), step * (force + weight),
        step * (before.bodies[static_cast<std::size_t>(tip)].p.cross(force) + moment + centre.cross(weight)));
  }
  EXPECT_LT(kept.error(), kBound);
}

// Oracle: conservation. Methods of high order do not keep the momentum of joint coordinates by themselves.
TEST(Momentum, IsKeptByEveryMethodAtLargeSteps) {
  for (const ArticulatedMethod method :
       {ArticulatedMethod::semi_implicit_euler, ArticulatedMethod::rk4, ArticulatedMethod::dormand_prince})
    for (const double step : {1e-3, 10e-3}) {
      const model::Model model = test::shipped_hand("anatomical.yaml", hand::Mount::free);
      Settings with = settings({}, step, method);
      test::set_tolerance(with, 1e-4);
      const auto engine = make_engine(model, with);
      Kept kept(model, engine->state());
      for (long i = 0; i < std::lround(0.3 / step); ++i) {
        engine->step({});
        kept.update(engine->state());
      }
      EXPECT_LT(kept.error(), kBound) << static_cast<int>(method) << " at " << step;
    }
}

// Oracle: conservation. Four bars in a ring of hinges, thrown.
TEST(Momentum, IsKeptByALoopThatFloats) {
  for (const auto method : {ArticulatedMethod::semi_implicit_euler, ArticulatedMethod::dormand_prince}) {
    model::Model model = model::make_model();
    for (int i = 0; i < 4; ++i) {
      const Quat turn = rotation_quaternion(0.5 * M_PI * i * Vec3::UnitZ());
      const std::string name = "bar" + std::to_string(i);
      const Vec3 place = turn * Vec3(0, -0.1, 0);
      test::add_body(model, test::body(name, 0.1 * (i + 1), {1e-4, 3e-4, 4e-4}, {place, turn}));
      // The ring shears as a rhombus does, and turns as a whole.
      const double swing = i % 2 == 0 ? 3 : -3;
      model.bodies.back().initial_angular_velocity = Vec3(5, 0, swing);
      model.bodies.back().initial_velocity =
          Vec3(5, 0, 0).cross(place) + turn * Vec3(-0.1 * std::abs(swing), 0, 0) * (i % 2 == 0 ? 1 : -1);
    }
    const Pose ahead = {Vec3(0.1, 0, 0), Quat::Identity()};
    const Pose behind = {Vec3(-0.1, 0, 0), rotation_quaternion(-0.5 * M_PI * Vec3::UnitZ())};
    for (int i = 0; i < 3; ++i)
      test::add_joint(model, "corner" + std::to_string(i), model::JointKind::hinge, 1 + i, 2 + i, ahead,
                      behind, {Vec3::UnitZ()});
    test::add_joint(model, "last", model::JointKind::hinge, 1, 4, behind, ahead, {Vec3::UnitZ()})
        .closes_loop = true;
    const auto engine = make_engine(model, settings({}, 2e-3, method));
    Kept kept(model, engine->state());
    for (int i = 0; i < 200; ++i) {
      engine->step({});
      kept.update(engine->state());
    }
    EXPECT_LT(kept.error(), kBound) << static_cast<int>(method);
  }
}

}  // namespace
}  // namespace handsim::engine
