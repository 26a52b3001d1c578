// What cannot be simulated is refused, what diverges is told, and nothing aborts the process.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include <ode/ode.h>

#include "engine/models.h"
#include "handsim/engine/collision/ode_library.h"
#include "handsim/engine/ode/world_resources.h"

namespace handsim::engine {
namespace {

using model::Effect;
using test::settings;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// The error a call throws.
Error error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << "nothing was thrown";
  return input_error("", "", "");
}

struct Defect {
  const char* name;
  std::function<void(model::Model&, Settings&)> spoil;
  const char* said;
};

model::Model universal_pair() {
  model::Model model = model::make_model();
  test::add_body(model, test::body("bob", 0.1, {1e-4, 1e-4, 1e-4}));
  test::add_joint(model, "cross", model::JointKind::universal, 0, 1, {}, {}, {Vec3::UnitX(), Vec3::UnitY()});
  return model;
}

const std::vector<Defect> kDefects = {
    {"ZeroMass", [](model::Model& m, Settings&) { m.bodies[1].mass = 0; }, "bob.mass"},
    {"NanInertia", [](model::Model& m, Settings&) { m.bodies[1].inertia(1, 1) = kNan; }, "bob.inertia"},
    {"ImpossibleInertia", [](model::Model& m, Settings&) { m.bodies[1].inertia(1, 1) = 1; }, "bob.inertia"},
    {"NonUnitAxis", [](model::Model& m, Settings&) { m.joints[0].axes[0].axis *= 2; }, "cross.axis0.axis"},
    {"ZeroAxis", [](model::Model& m, Settings&) { m.joints[0].axes[0].axis.setZero(); }, "cross.axis0.axis"},
    {"ParallelAxes", [](model::Model& m, Settings&) { m.joints[0].axes[1].axis = Vec3::UnitX(); },
     "cross.axes"},
    {"NanStop",
     [](model::Model& m, Settings&) {
       m.joints[0].axes[0].stop = model::Stop{kNan, 1, 0};
     },
     "stop"},
    {"StopsOutOfOrder",
     [](model::Model& m, Settings&) {
       m.joints[0].axes[0].stop = model::Stop{1, -1, 0};
     },
     "stop"},
    {"StopBeyondHalfATurn",
     [](model::Model& m, Settings&) {
       m.joints[0].axes[0].stop = model::Stop{-1, 4, 0};
     },
     "stop"},
    {"WrongFirstDof", [](model::Model& m, Settings&) { m.joints[0].first_dof = 9; }, "first_dof"},
    {"ZeroQuaternion", [](model::Model& m, Settings&) { m.bodies[1].zero_pose.q = Quat(0, 0, 0, 0); },
     "zero_pose"},
    {"ZeroStep", [](model::Model&, Settings& s) { s.step = 0; }, "solver.step"},
    {"NanStep", [](model::Model&, Settings& s) { s.step = kNan; }, "solver.step"},
    {"LongStep", [](model::Model&, Settings& s) { s.step = 1; }, "solver.step"},
    {"NanErp", [](model::Model&, Settings& s) { test::set_erp(s, kNan); }, "solver.erp"},
    {"ZeroCfm", [](model::Model&, Settings& s) { s.ode().cfm = 0; }, "solver.cfm"},
    {"NoIterations", [](model::Model&, Settings& s) { s.ode().iterations = 0; }, "solver.iterations"},
    {"MovingPlane",
     [](model::Model& m, Settings& s) {
       test::add_ground(m);
       m.shapes[0].body = 1;
       s.effects.add(Effect::ground_contact);
     },
     "ground"},
};

class EveryDefect : public testing::TestWithParam<Defect> {};

// Oracle: an input error that names the culprit, from a process that lives.
TEST_P(EveryDefect, IsRefusedByName) {
  model::Model model = universal_pair();
  Settings with = settings({});
  GetParam().spoil(model, with);
  const Error error = error_of([&] { make_engine(model, with); });
  EXPECT_EQ(error.kind(), ErrorKind::input);
  EXPECT_NE(std::string(error.what()).find(GetParam().said), std::string::npos) << error.what();
}

INSTANTIATE_TEST_SUITE_P(Defects, EveryDefect, testing::ValuesIn(kDefects),
                         [](const auto& each) { return each.param.name; });

// Oracle: every later step says the same; an engine beside it keeps the bits of one alone.
TEST(Divergence, OfOneEngineIsFinalForItAndUnknownToOthers) {
  const model::Model model = universal_pair();
  const Settings with = settings({Effect::gravity});
  const auto alone = make_engine(model, with);
  test::run(*alone, 200);
  const auto healthy = make_engine(model, with);
  test::run(*healthy, 100);
  for (const double bad : {kNan, std::numeric_limits<double>::infinity(), 1e300, 1e200, 1e100, 1e12}) {
    const auto sick = make_engine(model, with);
    test::run(*sick, 10);
    const std::vector<std::uint64_t> good = test::bits(sick->state());
    const std::vector<double> tau = {bad, 0};
    const Error error = error_of([&] { sick->step({tau}); });
    ASSERT_EQ(error.kind(), ErrorKind::physics) << bad;
    EXPECT_EQ(error.fault()->where, std::isfinite(bad) ? "bob" : "cross") << error.what();
    EXPECT_NEAR(error.fault()->time, 0.0105, 0.0006);
    EXPECT_STREQ(error_of([&] { sick->step({}); }).what(), error.what());
    EXPECT_EQ(test::bits(sick->state()), good);
  }
  test::run(*healthy, 100);
  EXPECT_EQ(test::bits(healthy->state()), test::bits(alone->state()));
}

// ODE stops in the middle of some of these steps, with work undone that it does not let anyone free.
TEST(Divergence, InTheMiddleOfAStepDoesNotEndTheProcess) {
  const model::Model model = universal_pair();
  for (const double bad : {1e80, 1e150, 1e160, 1e200, 1e300})
    for (int number = 0; number < 6; ++number) {
      const auto engine = make_engine(model, settings({Effect::gravity}));
      model::State state = engine->state();
      (number < 3 ? state.bodies[1].w[number] : state.bodies[1].p[number - 3]) = bad;
      // What is too fast is refused as a state already.
      const auto kind = number < 3 ? ErrorKind::input : ErrorKind::physics;
      const auto go_on = [&] {
        engine->set_state(state);
        engine->step({});
      };
      EXPECT_EQ(error_of(go_on).kind(), kind) << bad << " " << number;
    }
}

// Oracle: the documented bound of 1000 m/s.
TEST(Divergence, NamesTheBodyThatRanAway) {
  model::Model model = model::make_model();
  test::add_body(model, test::body("calm", 0.1, {1e-4, 1e-4, 1e-4}));
  test::add_body(model, test::body("runaway", 0.1, {1e-4, 1e-4, 1e-4}));
  model.bodies[2].initial_velocity = Vec3(1001, 0, 0);
  const auto engine = make_engine(model, settings({}));
  const Error error = error_of([&] { engine->step({}); });
  ASSERT_EQ(error.kind(), ErrorKind::physics);
  EXPECT_EQ(error.fault()->where, "runaway");
  EXPECT_EQ(error.fault()->quantity, "speed [m/s]");
  model.bodies[2].initial_velocity = Vec3(999, 0, 0);
  EXPECT_NO_THROW(make_engine(model, settings({}))->step({}));
}

// Oracle: the contract; a state of another size or not finite, and torques of another number, are input
// errors.
TEST(Inputs, OfTheWrongSizeOrNotFiniteAreRefusedAndTheEngineLives) {
  const model::Model model = universal_pair();
  const auto engine = make_engine(model, settings({}));
  const std::vector<double> tau = {1};
  EXPECT_EQ(error_of([&] { engine->step({tau}); }).kind(), ErrorKind::input);
  model::State state = engine->state();
  state.bodies[1].v.x() = kNan;
  EXPECT_EQ(error_of([&] { engine->set_state(state); }).kind(), ErrorKind::input);
  state.bodies.pop_back();
  EXPECT_EQ(error_of([&] { engine->set_state(state); }).kind(), ErrorKind::input);
  EXPECT_NO_THROW(engine->step({}));
}

// Oracle: ODE's own handler slots; an assertion comes out as the exception, a message is counted, not
// printed.
TEST(Handlers, ThrowErrorsAndCountFailuresOfTheDirectSolver) {
  enter_ode();
  EXPECT_THROW(dError(d_ERR_UASSERT, "one %d", 1), OdeFault);
  EXPECT_THROW(dDebug(d_ERR_IASSERT, "two"), OdeFault);
  const int before = lcp_failures();
  testing::internal::CaptureStderr();
  dMessage(d_ERR_LCP, "three");
  dMessage(d_ERR_UNKNOWN, "four");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(lcp_failures(), before + 1);
}

// Oracle: the generator's own seed.
TEST(Handlers, GiveTheSeedBack) {
  enter_ode();
  dRandSetSeed(123);
  {
    const ode::RandomSeed seed(77);
    EXPECT_EQ(dRandGetSeed(), 77U);
    dRand();
  }
  EXPECT_EQ(dRandGetSeed(), 123U);
}

}  // namespace
}  // namespace handsim::engine
