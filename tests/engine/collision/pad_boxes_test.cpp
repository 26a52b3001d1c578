// Boxes with pads on each other: their forces have no jumps, or a grasp hangs on rounding.
#include <gtest/gtest.h>

#include "engine/contact_scenes.h"
#include "handsim/engine/collision/collider.h"
#include "handsim/engine/collision/ode_library.h"

namespace handsim::engine {
namespace {

using model::Effect;
using model::ShapeKind;

/// A palm with an edge along z that overhangs the end of a bar.
model::Model palm_and_bar() {
  model::Model model = model::make_model();
  model.groups = {{"all"}};
  model.contact_rules = {{0, 0}};
  model.materials = {test::material("pad", 0.8)};
  model.materials[0].compliance = model::Compliance{3000, 10};
  test::add_solid(model, test::sized("bar", ShapeKind::box, 0, 0, Vec3(0.045, 0.045, 0.15)), 0.4, {});
  test::add_solid(model, test::sized("palm", ShapeKind::box, 0, 0, Vec3(0.02, 0.08, 0.09)), 0.4, {});
  return model;
}

struct Wrench {
  double force = 0;
  Vec3 moment = Vec3::Zero();
};

/// Of the springs on the bar, about its centre.
Wrench pressed(const model::Model& model, Collider& collider, const Pose& palm) {
  model::State state = model::initial_state(model);
  state.bodies[2].p = palm.p;
  state.bodies[2].q = palm.q;
  collider.place(state);
  collider.collide(state, {});
  Wrench out;
  for (std::size_t i = 0; i < collider.contacts().size(); ++i) {
    const Contact& contact = collider.contacts()[i];
    const double force = 3000 * collider.shares()[i] * contact.depth;
    out.force += force;
    out.moment += force * contact.position.cross(contact.normal);
  }
  return out;
}

// Oracle: continuity. Between two poses 2 urad apart no point moves by more than 0.2 um, which is 1.2 mN on
// two springs. Points that come and go as the palm tilts, or an edge contact in place of a face's, moved 0.1
// N m.
TEST(PadBoxes, PressWithoutJumpsWhereAnEdgeOverhangsAnEnd) {
  enter_ode();
  const model::Model model = palm_and_bar();
  model::Effects effects;
  effects.add(Effect::object_contact);
  Collider collider(model, effects, false);
  for (const double roll : {0.1, 0.3}) {
    std::optional<Wrench> last;
    double most_force = 0, most_moment = 0;
    for (double tilt = -0.02; tilt < 0.02; tilt += 2e-6) {
      const Quat q = rotation_quaternion({0, 0, roll}) * rotation_quaternion({0, tilt, 0});
      // The palm's edge 2.5 mm inside the bar's face, its end 40 mm beyond the bar's.
      const Vec3 edge = q * Vec3(-0.01, roll > 0 ? 0.04 : -0.04, 0);
      const Wrench now = pressed(model, collider, {Vec3(0.02, 0, 0.07) - edge, q});
      if (last) {
        most_force = std::max(most_force, std::abs(now.force - last->force));
        most_moment = std::max(most_moment, (now.moment - last->moment).norm());
      }
      last = now;
    }
    EXPECT_GT(last->force, 1);
    EXPECT_LT(most_force, 5e-3) << "roll " << roll;
    EXPECT_LT(most_moment, 5e-4) << "roll " << roll;
  }
}

}  // namespace
}  // namespace handsim::engine
