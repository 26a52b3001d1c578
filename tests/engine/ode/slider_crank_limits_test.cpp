// The slider-crank where solvers have trouble: started and driven through dead centre, with redundant joints,
// at ten times its speed. Every method stays finite; which of them hold the contract of 0.01 mm at 1 ms, and
// what gap the others are left with, is told apart.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/models.h"
#include "support/sanitized.h"
#include "support/slider_crank.h"

namespace handsim::engine {
namespace {

using handsim::test::kSlider;
using model::Effect;
using study::SliderCrankSpec;

constexpr double kContract = 1e-5;  ///< [m], at 1 ms

struct CrankCase {
  std::string name;
  model::Model model;
  double torque = 0;               ///< on the crank [N m]
  double duration = 1;             ///< [s]
  double nearest = 0;              ///< dead centre of the slider [m]
  std::optional<double> farthest;  ///< the other, where the crank gets there [m]
};

/// In one plane the dead centres are rod less crank and rod and crank.
constexpr double kNearest = 0.3 - 0.08, kFarthest = 0.3 + 0.08;

/// Started at rest in one line, where a force on the slider would not move it, and driven by a torque.
CrankCase dead_centre() {
  return {"dead centre", handsim::test::planar_slider_crank(Quat::Identity(), M_PI / 2, 0), 0.1, 1, kNearest,
          kFarthest};
}

/// Three hinges with parallel axes and a slider: 20 rows, of which 17 are independent.
CrankCase redundant() {
  return {"redundant", handsim::test::planar_slider_crank(), 0, 1, kNearest, kFarthest};
}

/// The same across the axes of the world, where rounding makes the redundant rows contradict each other;
/// gravity turns the crank back before the far dead centre.
CrankCase tilted() {
  const Quat tilt = rotation_quaternion({0.7, -0.4, 1.1});
  return {"tilted", handsim::test::planar_slider_crank(tilt), 0, 1, kNearest, {}};
}

/// The dead centres are where the pin is farthest from the slider's axis and nearest to it.
CrankCase spatial(const char* name, double speed, double duration) {
  SliderCrankSpec spec = SliderCrankSpec::iftomm();
  spec.speed = speed;
  const double axis = std::hypot(spec.axis_y, spec.axis_z);
  const auto slider = [&](double pin) { return std::sqrt(spec.rod_length * spec.rod_length - pin * pin); };
  return {name,     handsim::test::slider_crank(spec), 0,
          duration, slider(axis + spec.crank_length),  slider(axis - spec.crank_length)};
}

CrankCase ordinary() { return spatial("ordinary speed", 6, 5); }
CrankCase fast() { return spatial("ten times the speed", 60, 0.5); }

struct Figures {
  double gap = 0;  ///< largest of any joint [m]
  /// Bound of the centripetal acceleration with which two anchors leave each other's path [m/s^2].
  double bend = 0;
  double nearest = INFINITY, farthest = 0;  ///< of the slider from the start of its axis [m]
};

double bend(const model::Joint& joint, const model::State& state) {
  const auto at_anchor = [&](int body, const Pose& frame) {
    return state.bodies[static_cast<std::size_t>(body)].w.squaredNorm() * frame.p.norm();
  };
  return at_anchor(joint.parent, joint.parent_frame) + at_anchor(joint.child, joint.child_frame);
}

Figures follow(const CrankCase& of, const Settings& settings) {
  const auto engine = make_engine(of.model, settings);
  std::vector<double> torques(static_cast<std::size_t>(of.model.dof_count()), 0.0);
  torques[0] = of.torque;
  Figures out;
  for (long i = 0; i < std::lround(of.duration / settings.step); ++i) {
    // Throws where a number is not finite.
    engine->step({torques});
    out.gap = std::max(out.gap, handsim::test::largest_gap(of.model, engine->state()));
    const double x = engine->state().bodies[kSlider].p.norm();
    out.nearest = std::min(out.nearest, x), out.farthest = std::max(out.farthest, x);
    for (const model::Joint& joint : of.model.joints)
      out.bend = std::max(out.bend, bend(joint, engine->state()));
  }
  return out;
}

Settings with(Method method, double step = 1e-3, double erp = 0.2) {
  Settings out = test::settings({Effect::gravity, Effect::actuation}, step, method);
  test::set_erp(out, erp);
  return out;
}

Settings projected(Method method) {
  Settings out = with(method);
  out.ode().projection = true;
  return out;
}

// Oracle: the contract; dead centres in closed form, to what a step of 1 ms can pass over (the crank's 50
// rad/s make it (50 * 0.5e-3)^2 / 2 * 0.08 m).
TEST(SliderCrankLimits, AreHeldByTheMethodsThatCloseTheirJoints) {
  HANDSIM_SKIP_WITH_SANITIZER("tests of the methods step the same mechanism");
  for (const CrankCase& each : {dead_centre(), redundant(), tilted(), ordinary(), fast()})
    for (const Settings& settings : {projected(OdeMethod::world_step), projected(OdeMethod::quick_step),
                                     with(DaeMethod::stabilised_gear), with(DaeMethod::lagrange_penalty),
                                     with(DaeMethod::euler_projected)}) {
      SCOPED_TRACE(each.name + ", " + std::string(name(settings.method())));
      const Figures figures = follow(each, settings);
      EXPECT_LE(figures.gap, kContract);
      EXPECT_NEAR(figures.nearest, each.nearest, 2.5e-5);
      if (each.farthest) {
        EXPECT_NEAR(figures.farthest, *each.farthest, 2.5e-5);
      }
    }
}

// Oracle: what velocity-level constraints must leave behind. Within a step the anchors leave each other by
// bend h^2 / 2, of what has gathered a step takes `erp` back: bend h^2 / (2 erp) stays. At 1 ms and ERP 0.2
// that is more than the contract (0.12 mm at ordinary speed, 1.6 mm at ten times), and even at ERP 1 (0.024
// mm).
TEST(SliderCrankLimits, LeaveVelocityLevelMethodsTheGapOfTheirOrder) {
  HANDSIM_SKIP_WITH_SANITIZER("tests of the methods step the same mechanism");
  for (const CrankCase& each : {dead_centre(), redundant(), tilted(), ordinary(), fast()})
    for (const Method method :
         std::initializer_list<Method>{OdeMethod::world_step, DaeMethod::euler_linearised})
      for (const double erp : {0.2, 0.8, 1.0}) {
        SCOPED_TRACE(each.name + ", " + std::string(name(method)));
        const Figures figures = follow(each, with(method, 1e-3, erp));
        EXPECT_LE(figures.gap, figures.bend * 1e-6 / (2 * erp));
        EXPECT_GT(figures.gap, kContract) << "it holds the contract: say so";
      }
}

// Oracle: the contract, at the settings that the rule above says hold it.
TEST(SliderCrankLimits, AreHeldByVelocityLevelMethodsAtErp0_8AndSmallerSteps) {
  HANDSIM_SKIP_WITH_SANITIZER("tests of the methods step the same mechanism");
  for (const Method method :
       std::initializer_list<Method>{OdeMethod::world_step, DaeMethod::euler_linearised}) {
    for (const CrankCase& each : {dead_centre(), redundant(), ordinary()})
      EXPECT_LE(follow(each, with(method, 5e-4, 0.8)).gap, kContract) << each.name;
    EXPECT_LE(follow(fast(), with(method, 1e-4, 0.8)).gap, kContract);
  }
}

// quick_step's 20 iterations leave more than the rule: 0.26 mm at ordinary speed, 2 mm at ten times. Oracle:
// a crank of 80 mm that is still a crank.
TEST(SliderCrankLimits, LeaveQuickStepFiniteAndTheCrankACrank) {
  HANDSIM_SKIP_WITH_SANITIZER("tests of the methods step the same mechanism");
  for (const CrankCase& each : {dead_centre(), redundant(), tilted(), ordinary()})
    EXPECT_LE(follow(each, with(OdeMethod::quick_step)).gap, 6e-4) << each.name;
  EXPECT_LE(follow(fast(), with(OdeMethod::quick_step)).gap, 2.5e-3);
}

/// RMS error of the slider's velocity over 0.5 s [m/s].
double velocity_error(const Settings& settings) {
  const SliderCrankSpec spec = SliderCrankSpec::iftomm();
  const model::Model model = handsim::test::slider_crank(spec);
  const auto engine = make_engine(model, settings);
  const auto reference = study::SliderCrankReference(spec).series(0.5, settings.step);
  double sum = 0;
  for (std::size_t i = 1; i < reference.size(); ++i) {
    engine->step({});
    sum += std::pow(engine->state().bodies[kSlider].v.x() - reference[i].vx, 2);
  }
  return std::sqrt(sum / static_cast<double>(reference.size() - 1));
}

// Oracle: first order in the step, as a symplectic Euler method must be.
TEST(Projection, ConvergesAtFirstOrderFromTenMillisecondsOn) {
  HANDSIM_SKIP_WITH_SANITIZER("shorter tests project a hand");
  for (const Method method : {OdeMethod::world_step, OdeMethod::quick_step}) {
    const auto error = [&](double step) {
      Settings settings = projected(method);
      settings.step = step;
      return velocity_error(settings);
    };
    const double coarse = error(1e-2), middle = error(1e-3), fine = error(1e-4);
    EXPECT_NEAR(std::log10(coarse / middle), 1, 0.1);
    EXPECT_NEAR(std::log10(middle / fine), 1, 0.05);
  }
}

/// Largest change of energy over 5 s, relative to the largest kinetic energy.
double energy_error(const Settings& settings) {
  const model::Model model = handsim::test::slider_crank(SliderCrankSpec::iftomm());
  const auto engine = make_engine(model, settings);
  const double start = handsim::test::energy(model, engine->state());
  double change = 0, largest = 0;
  for (long i = 0; i < std::lround(5 / settings.step); ++i) {
    engine->step({});
    change = std::max(change, std::abs(handsim::test::energy(model, engine->state()) - start));
    largest = std::max(largest, model::kinetic_energy(model, engine->state()));
  }
  return change / largest;
}

// Oracle: conservation of energy, to first order in the step. Without projection a step of 10 ms is beyond
// any order: all energy is lost.
TEST(Projection, KeepsTheEnergyThatLongStepsLose) {
  HANDSIM_SKIP_WITH_SANITIZER("shorter tests project a hand");
  Settings settings = projected(OdeMethod::world_step);
  EXPECT_LT(energy_error(settings), 0.012);
  settings.step = 1e-2;
  EXPECT_LT(energy_error(settings), 0.12);
  settings.ode().projection = false;
  EXPECT_GT(energy_error(settings), 0.5);
}

// Oracle: bit equality: a run that goes on from a saved state.
TEST(Projection, GoesOnFromASavedStateToTheBit) {
  const model::Model model = test::five_fingers(true, true);
  const Settings settings = projected(OdeMethod::world_step);
  const auto whole = make_engine(model, settings), resumed = make_engine(model, settings);
  test::run(*whole, 100);
  resumed->set_state(whole->state());
  test::run(*whole, 100);
  test::run(*resumed, 100);
  EXPECT_EQ(test::bits(whole->state()), test::bits(resumed->state()));
}

// Oracle: the contract: hands, whose palm has no ODE body, are closed as well.
TEST(Projection, ClosesTheJointsOfAHand) {
  const model::Model model = test::five_fingers(true, true);
  const auto engine = make_engine(model, projected(OdeMethod::world_step));
  for (int i = 0; i < 300; ++i) {
    engine->step({});
    ASSERT_LE(handsim::test::largest_gap(model, engine->state()), 1e-12);
  }
}

}  // namespace
}  // namespace handsim::engine
