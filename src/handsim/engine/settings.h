// Settings with which an engine advances a model. Step, contact forces and effects are common to all engines;
// each engine has further settings of its own. Depends on no engine.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <variant>
#include <vector>

#include "handsim/core/error.h"
#include "handsim/core/fields.h"
#include "handsim/core/units.h"
#include "handsim/model/effects.h"

namespace handsim::engine {

inline constexpr double kMinStep = 1e-6, kMaxStep = 0.1;  ///< [s]
inline constexpr int kMaxIterations = 100000;
inline constexpr double kMinTolerance = 1e-11, kMaxTolerance = 1e-2;

/// In the order of the alternatives of Settings::own.
enum class EngineKind {
  ode,          ///< Open Dynamics Engine: contacts, stops, speed
  dae,          ///< differential-algebraic solver: the reference for motion without contacts and stops
  articulated,  ///< recursive algorithms in joint coordinates: the fastest
};

enum class OdeMethod {
  world_step,  ///< direct LCP solver (Dantzig): exact, cost grows with the cube of the rows
  quick_step,  ///< iterative solver (projected SOR): cost grows with rows times iterations
};

enum class DaeMethod {
  /// Variable-order, variable-step BDF on the stabilised index-2 form (Gear, Gupta & Leimkuhler 1985), with
  /// error control to `tolerance`; the method of Adams's GSTIFF SI2.
  stabilised_gear,
  /// Augmented Lagrangian (Bayo & Ledesma 1996) with second-order backward differences; the method of MeVEA.
  lagrange_penalty,
  /// Linearised implicit Euler at velocity level; `erp` corrects joint gaps. A method of Chrono.
  euler_linearised,
  /// The step of euler_linearised, after which positions are projected onto the joints. A method of Chrono.
  euler_projected,
};

enum class ArticulatedMethod {
  /// First order; springs, dampers, servos and stops implicit: stable at any step; exact Coulomb cone.
  semi_implicit_euler,
  rk4,  ///< the classical fourth-order Runge-Kutta method, for motion without stops
  /// Dormand and Prince's eighth-order Runge-Kutta method, error-controlled to `tolerance`; without stops.
  dormand_prince,
};

/// A method; the alternative of the variant is the engine.
using Method = std::variant<OdeMethod, DaeMethod, ArticulatedMethod>;

/// `method == OdeMethod::quick_step`.
template <class M>
requires std::same_as<M, OdeMethod> || std::same_as<M, DaeMethod> || std::same_as<M, ArticulatedMethod>
bool operator==(const Method& a, M b) { return a == Method(b); }

inline constexpr std::array<std::string_view, 3> kEngineNames = {"ode", "dae", "articulated"};
inline constexpr std::array<std::string_view, 2> kOdeMethodNames = {"world_step", "quick_step"};
inline constexpr std::array<std::string_view, 4> kDaeMethodNames = {"stabilised_gear", "lagrange_penalty",
                                                                    "euler_linearised", "euler_projected"};
inline constexpr std::array<std::string_view, 3> kArticulatedMethodNames = {"semi_implicit_euler", "rk4",
                                                                            "dormand_prince"};

/// Names of all methods of an engine; the argument selects the engine by its type.
constexpr std::span<const std::string_view> method_names(OdeMethod) { return kOdeMethodNames; }
constexpr std::span<const std::string_view> method_names(DaeMethod) { return kDaeMethodNames; }
constexpr std::span<const std::string_view> method_names(ArticulatedMethod) {
  return kArticulatedMethodNames;
}

inline std::string_view name(EngineKind kind) { return kEngineNames[static_cast<std::size_t>(kind)]; }
inline std::string_view name(const Method& method) {
  return std::visit([](auto own) { return method_names(own)[static_cast<std::size_t>(own)]; }, method);
}

inline constexpr Quantity kStepRange = {Dimension::time, kMinStep, kMaxStep};
inline constexpr Quantity kErpRange = {Dimension::none, 0, 1};
inline constexpr Quantity kToleranceRange = {Dimension::none, kMinTolerance, kMaxTolerance};
inline constexpr WholeRange kSeedRange = {0, 2'147'483'647};

// The lists of the engines' keys (core/fields.h). A condition after the range: the settings with which the
// key acts.

/// Iterations of quick_step for a hand with muscles: with 20, a strong muscle turns a light fingertip 75 deg
/// past its stop.
inline constexpr int kMuscleIterations = 100;

struct OdeSettings {
  OdeMethod method = OdeMethod::world_step;
  /// Error reduction parameter: share of a joint's position error that one step corrects, 0..1. Too low:
  /// joint gaps grow under load; too high (above about 0.8): jitter, and rebound at stops.
  double erp = 0.2;
  /// Constraint force mixing (compliance of every row), above 0 to 1. Too low: the LCP solver fails at
  /// redundant rows; too high: compliant joints.
  double cfm = 1e-9;
  int iterations = 20;  ///< of quick_step
  /// After every step joint impulses close the joints to 1e-13 m, in positions and velocities (SHAKE). The
  /// impulses ignore contacts and stops. Off: gaps of the order of step^2 acceleration / erp.
  bool projection = false;
  std::uint64_t seed = 1;  ///< quick_step shuffles its rows with ODE's random generator
  /// Speculative contacts: two shapes that approach by more than half the smaller of their smallest radii in
  /// a step get contacts before they touch. Off: such shapes penetrate or pass through each other.
  bool speculative = true;
  /// world_step solves a step at most so many times, until friction is within 0.1 % of its limit, of rigid
  /// contacts within 1 %, or comes no nearer; 1: friction limits use the normal forces of the last step.
  int friction_passes = 3;

  template <class Visit>
  static void fields(Visit&& visit) {
    constexpr auto kIterates = [](const OdeSettings& of) { return of.method != OdeMethod::world_step; };
    visit("method", &OdeSettings::method, Words{kOdeMethodNames});
    visit("erp", &OdeSettings::erp, kErpRange);
    visit("speculative", &OdeSettings::speculative);
    visit("cfm", &OdeSettings::cfm, Quantity{Dimension::none, 0, 1, true});
    visit("iterations", &OdeSettings::iterations, WholeRange{1, kMaxIterations}, kIterates);
    visit("projection", &OdeSettings::projection);
    visit("seed", &OdeSettings::seed, kSeedRange, kIterates);
  }
};

struct DaeSettings {
  DaeMethod method = DaeMethod::stabilised_gear;
  double erp = 0.2;  ///< euler_linearised: as OdeSettings::erp
  /// stabilised_gear: intended error of smooth motion over some seconds, relative, and absolute in units of 1
  /// m, 1 m/s, 1 rad, 1 rad/s; the error test of each internal step uses a share of it. 1e-11 to 1e-2. A
  /// tenth takes 1.2 to 1.9 times as long. Too high: energy drifts; below the range, rounding dominates.
  double tolerance = 1e-9;

  template <class Visit>
  static void fields(Visit&& visit) {
    visit("method", &DaeSettings::method, Words{kDaeMethodNames});
    visit("erp", &DaeSettings::erp, kErpRange,
          [](const DaeSettings& of) { return of.method == DaeMethod::euler_linearised; });
    visit("tolerance", &DaeSettings::tolerance, kToleranceRange,
          [](const DaeSettings& of) { return of.method == DaeMethod::stabilised_gear; });
  }
};

struct ArticulatedSettings {
  ArticulatedMethod method = ArticulatedMethod::semi_implicit_euler;
  /// Share of the angle beyond a stop, and of a contact's depth, that one step corrects, 0..1.
  double erp = 0.2;
  double tolerance = 1e-9;  ///< dormand_prince: as DaeSettings::tolerance
  bool speculative = true;  ///< semi_implicit_euler: as OdeSettings::speculative

  template <class Visit>
  static void fields(Visit&& visit) {
    constexpr auto kImplicit = [](const ArticulatedSettings& of) {
      return of.method == ArticulatedMethod::semi_implicit_euler;
    };
    visit("method", &ArticulatedSettings::method, Words{kArticulatedMethodNames});
    visit("erp", &ArticulatedSettings::erp, kErpRange, kImplicit);
    visit("tolerance", &ArticulatedSettings::tolerance, kToleranceRange,
          [](const ArticulatedSettings& of) { return of.method == ArticulatedMethod::dormand_prince; });
    visit("speculative", &ArticulatedSettings::speculative, kImplicit);
  }
};

struct Settings {
  double step = 1e-3;  ///< [s], above 0 to 0.1
  /// Contacts report their forces; this takes some percent of the time of a step with contacts.
  bool contact_forces = false;
  model::Effects effects;
  std::variant<OdeSettings, DaeSettings, ArticulatedSettings> own;  ///< settings of the selected engine

  EngineKind engine() const { return static_cast<EngineKind>(own.index()); }
  Method method() const {
    return std::visit([](const auto& of_engine) { return Method(of_engine.method); }, own);
  }
  double erp() const {
    return std::visit([](const auto& of_engine) { return of_engine.erp; }, own);
  }
  /// Selects an engine with its defaults; keeps the settings if it is selected already.
  void use(EngineKind engine);
  /// Selects a method and its engine.
  void use(const Method& method);
  /// Settings of the selected engine. @throws std::bad_variant_access if another one is selected.
  OdeSettings& ode() { return std::get<OdeSettings>(own); }
  const OdeSettings& ode() const { return std::get<OdeSettings>(own); }
  DaeSettings& dae() { return std::get<DaeSettings>(own); }
  const DaeSettings& dae() const { return std::get<DaeSettings>(own); }
  ArticulatedSettings& articulated() { return std::get<ArticulatedSettings>(own); }
  const ArticulatedSettings& articulated() const { return std::get<ArticulatedSettings>(own); }
};

/// Calls visit(key, value, range, condition) for each key of the selected engine, as far as the key has the
/// last two.
template <class Visit>
void each_setting(const Settings& of, const Visit& visit) {
  std::visit(
      [&](const auto& own) {
        own.fields([&](std::string_view key, auto member, const auto&... form) {
          visit(key, own.*member, form...);
        });
      },
      of.own);
}

/// False for a key of the selected engine that its method does not use.
bool uses(const Settings& settings, std::string_view key);

/// `speculative` of the selected engine; null if the engine has none.
bool* speculative(Settings& settings);

/// The problem of a method whose library is not in this program: stabilised_gear is engine/dae's by SUNDIALS.
std::optional<Problem> missing_library(const Settings& settings);

/// Settings out of range, or a missing library.
std::vector<Problem> defects(const Settings& settings);

/// Effects that the engine or its method does not have, under the key `effects`.
/// @param with_stops true if the model has joint stops; without stops, the effect joint_stops is accepted
std::vector<Problem> missing_effects(const Settings& settings, bool with_stops);

}  // namespace handsim::engine
