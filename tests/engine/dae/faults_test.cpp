// Input that the differential-algebraic engine rejects, and its failures.
#include <gtest/gtest.h>

#include <limits>

#include "engine/models.h"
#include "support/slider_crank.h"

namespace handsim::engine {
namespace {

using model::Effect;
using test::refusal;
using test::settings;

// Oracle: the contract: smooth motion only, with a clear message.
TEST(DaeEngine, RefusesContactsAndStops) {
  model::Model model = test::hinged_body();
  for (const Effect effect : {Effect::object_contact, Effect::self_contact, Effect::ground_contact}) {
    const std::string text = refusal(model, settings({effect}, 1e-3, DaeMethod::stabilised_gear));
    EXPECT_NE(text.find(name(effect)), std::string::npos) << text;
    EXPECT_NE(text.find("no contact with stabilised_gear"), std::string::npos) << text;
  }
  const Settings stops = settings({Effect::joint_stops}, 1e-3, DaeMethod::euler_projected);
  EXPECT_EQ(refusal(model, stops), "");
  model.joints[0].axes[0].stop = model::Stop{-1, 1, 0};
  EXPECT_NE(refusal(model, stops).find("joint_stops"), std::string::npos);
  EXPECT_EQ(refusal(model, settings({}, 1e-3, DaeMethod::euler_projected)), "");
}

// Oracle: the contract.
TEST(DaeEngine, RefusesAToleranceOutOfRange) {
  Settings with = settings({}, 1e-3, DaeMethod::stabilised_gear);
  for (const double bad : {0.0, 1e-13, 0.1, std::numeric_limits<double>::quiet_NaN()}) {
    test::set_tolerance(with, bad);
    EXPECT_NE(refusal(test::hinged_body(), with).find("solver.tolerance"), std::string::npos);
  }
}

// Oracle: geometry: a rod of 0.3 m cannot reach a slider guide 1 m away.
TEST(DaeEngine, RefusesAMechanismThatCannotClose) {
  model::Model model = handsim::test::slider_crank(study::SliderCrankSpec::iftomm());
  model.joints[2].parent_frame.p.z() = -1;
  for (const Method method :
       {DaeMethod::stabilised_gear, DaeMethod::lagrange_penalty, DaeMethod::euler_projected})
    EXPECT_NE(refusal(model, settings({}, 1e-3, method)).find("joint gap"), std::string::npos);
}

// Oracle: the contract: time, joint and quantity; the same error in later steps; state() stays the last valid
// one.
TEST(DaeEngine, NamesTheJointOfATorqueThatIsNotFinite) {
  const model::Model model = test::hinged_body(0.1);
  for (const Method method :
       {DaeMethod::stabilised_gear, DaeMethod::lagrange_penalty, DaeMethod::euler_linearised}) {
    const auto engine = make_engine(model, settings({Effect::gravity}, 1e-3, method));
    test::run(*engine, 3);
    const auto before = test::bits(engine->state());
    const std::vector<double> bad = {std::numeric_limits<double>::infinity()};
    for (int i = 0; i < 2; ++i) try {
        engine->step({bad});
        FAIL();
      } catch (const Error& error) {
        ASSERT_EQ(error.kind(), ErrorKind::physics);
        EXPECT_EQ(error.fault()->where, "pin");
        EXPECT_EQ(error.fault()->time, 0.003);
      }
    EXPECT_EQ(test::bits(engine->state()), before);
  }
}

// Oracle: the contract, for a body that a constant torque accelerates beyond the limit.
TEST(DaeEngine, NamesTheBodyThatIsTooFast) {
  const model::Model model = test::hinged_body();
  for (const Method method : {DaeMethod::stabilised_gear, DaeMethod::lagrange_penalty,
                              DaeMethod::euler_linearised, DaeMethod::euler_projected}) {
    const auto engine = make_engine(model, settings({}, 1e-3, method));
    const std::vector<double> huge = {1e6};
    try {
      for (int i = 0; i < 100; ++i) engine->step({huge});
      FAIL() << name(method);
    } catch (const Error& error) {
      ASSERT_EQ(error.kind(), ErrorKind::physics) << error.what();
      EXPECT_TRUE(error.fault()->where == "bob" || error.fault()->where == "pin") << error.what();
      EXPECT_GE(error.fault()->time, 0);
    }
  }
}

// Oracle: the contract.
TEST(DaeEngine, RefusesTheStateOfAnotherModelAndContinues) {
  const model::Model model = test::hinged_body(0.1);
  const auto engine = make_engine(model, settings({Effect::gravity}, 1e-3, DaeMethod::stabilised_gear));
  EXPECT_THROW(engine->set_state(model::State{}), Error);
  engine->step({});
  EXPECT_EQ(engine->state().time, 1e-3);
  EXPECT_NE(engine->version().find("SUNDIALS 6"), std::string::npos);
}

}  // namespace
}  // namespace handsim::engine
