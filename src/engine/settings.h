// How an engine advances a model: what scenes state and engines apply. Each engine has settings of its own,
// under keys of its own; step, contact forces and effects are common to all. Knows no engine.
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
#include "handsim/model/effects.h"

namespace handsim::engine {

inline constexpr double kMinStep = 1e-6, kMaxStep = 0.1;  ///< [s]
inline constexpr int kMaxIterations = 100000;
inline constexpr double kMinTolerance = 1e-11, kMaxTolerance = 1e-2;

/// In the order of Settings::own.
enum class EngineKind {
  ode,          ///< Open Dynamics Engine: contacts, stops, speed
  dae,          ///< differential-algebraic solver: the reference for motion without contacts and stops
  articulated,  ///< recursive algorithms in joint coordinates: the fastest
};

enum class OdeMethod {
  world_step,  ///< direct LCP solver (Dantzig): exact, cost grows with the cube of the rows
  quick_step,  ///< iterative solver (projected SOR): cost grows with rows times iterations
  /// Each step the cheaper of the two above, by the rows of each group of bodies that touch or are jointed
  /// and a measured cost of both (not by the clock: runs stay reproducible). YAML: `auto`.
  automatic,
};

enum class DaeMethod {
  /// Variable order and step on the stabilised index-2 form (Gear, Gupta & Leimkuhler 1985), to `tolerance`.
  /// What Adams's GSTIFF SI2 does.
  stabilised_gear,
  /// Augmented Lagrangian (Bayo & Ledesma 1996) with second-order backward differences. MeVEA's way.
  lagrange_penalty,
  /// Linearised implicit Euler at velocity level, gaps pulled back by `erp` a step. Chrono's.
  euler_linearised,
  /// The same with positions projected onto the joints after every step. Chrono's.
  euler_projected,
};

enum class ArticulatedMethod {
  /// First order; springs, dampers, servos and stops evaluated at the step's end, stable at any step;
  /// contacts with Coulomb's cone.
  semi_implicit_euler,
  rk4,  ///< the classical fourth-order Runge-Kutta method, for motion without stops
  /// Dormand and Prince's eighth-order Runge-Kutta method with error control to `tolerance`, for motion
  /// without stops.
  dormand_prince,
};

/// A method of an engine: the alternative names the engine.
using Method = std::variant<OdeMethod, DaeMethod, ArticulatedMethod>;

/// `method == OdeMethod::quick_step`.
template <class M>
requires std::same_as<M, OdeMethod> || std::same_as<M, DaeMethod> || std::same_as<M, ArticulatedMethod>
bool operator==(const Method& a, M b) { return a == Method(b); }

inline constexpr std::array<std::string_view, 3> kEngineNames = {"ode", "dae", "articulated"};
inline constexpr std::array<std::string_view, 3> kOdeMethodNames = {"world_step", "quick_step", "auto"};
inline constexpr std::array<std::string_view, 4> kDaeMethodNames = {"stabilised_gear", "lagrange_penalty",
                                                                    "euler_linearised", "euler_projected"};
inline constexpr std::array<std::string_view, 3> kArticulatedMethodNames = {"semi_implicit_euler", "rk4",
                                                                            "dormand_prince"};

/// Names of all methods of a method's engine.
constexpr std::span<const std::string_view> names_beside(OdeMethod) { return kOdeMethodNames; }
constexpr std::span<const std::string_view> names_beside(DaeMethod) { return kDaeMethodNames; }
constexpr std::span<const std::string_view> names_beside(ArticulatedMethod) {
  return kArticulatedMethodNames;
}

inline std::string_view name(EngineKind kind) { return kEngineNames[static_cast<std::size_t>(kind)]; }
inline std::string_view name(const Method& method) {
  return std::visit([](auto own) { return names_beside(own)[static_cast<std::size_t>(own)]; }, method);
}

/// What a guarded step must keep to; a step beyond, or one whose LCP solver gave up, is taken back to the bit
/// and tried again: with 100 x the CFM, as two half steps, with quick_step at 200 iterations. Every retry is
/// counted.
struct GuardLimits {
  double joint_gap = 1e-3;      ///< largest gap of any joint after the step [m]
  double speed = 30;            ///< fastest body [m/s]
  double angular_speed = 1000;  ///< fastest spin [rad/s]
};

struct OdeSettings {
  OdeMethod method = OdeMethod::world_step;
  /// Share of a joint's positional error that one step corrects, 0..1. Low: joints drift apart under load;
  /// high (above about 0.8): jitter, and rebound at stops.
  double erp = 0.2;
  /// Constraint force mixing (softness of every constraint row), above 0 to 1. Low: redundant rows make the
  /// LCP fail; high: joints feel like rubber.
  double cfm = 1e-9;
  int iterations = 20;  ///< quick_step and auto
  /// After every step impulses of the joints close them to 1e-13 m, positions and velocities both (SHAKE).
  /// Contacts and stops do not see it. Off: gaps of the order of step^2 acceleration / erp.
  bool projection = false;
  std::uint64_t seed = 1;  ///< quick_step shuffles its rows with ODE's random generator
  /// Contacts that bodies are about to make within a step are kept before they happen, where a pair of shapes
  /// goes further in a step than half the smaller of their smallest radii. Off: such bodies end steps within
  /// and behind each other.
  bool speculative = true;
  /// world_step makes a step so many times at most, where friction of pads is off by more than 0.1 %; 1:
  /// limits of friction are of the last step's normal forces.
  int friction_passes = 3;
  std::optional<GuardLimits> guard;  ///< absent: steps are taken as they come
};

struct DaeSettings {
  DaeMethod method = DaeMethod::stabilised_gear;
  double erp = 0.2;  ///< euler_linearised: as OdeSettings::erp
  /// stabilised_gear: error aimed for in smooth motion of some seconds, relative, and absolute in units of 1
  /// m, 1 m/s, 1 rad, 1 rad/s; each of the integrator's own steps is held to a share of it. 1e-11 to 1e-2.
  /// Ten times smaller costs 1.2 to 1.9 times as much. High: energy drifts; lower: drowned in rounding.
  double tolerance = 1e-9;
};

struct ArticulatedSettings {
  ArticulatedMethod method = ArticulatedMethod::semi_implicit_euler;
  /// Share of an angle beyond its stop, and of a contact's depth, that a step corrects, 0..1.
  double erp = 0.2;
  double tolerance = 1e-9;  ///< dormand_prince: as DaeSettings::tolerance
  bool speculative = true;  ///< semi_implicit_euler: as OdeSettings::speculative
};

struct Settings {
  double step = 1e-3;  ///< [s], above 0 to 0.1
  /// Contacts tell their forces; costs some percent of a step with contacts.
  bool contact_forces = false;
  model::Effects effects;
  std::variant<OdeSettings, DaeSettings, ArticulatedSettings> own;  ///< of the engine that is to run

  EngineKind engine() const { return static_cast<EngineKind>(own.index()); }
  Method method() const {
    return std::visit([](const auto& of_engine) { return Method(of_engine.method); }, own);
  }
  /// All three engines have one.
  double erp() const {
    return std::visit([](const auto& of_engine) { return of_engine.erp; }, own);
  }
  /// An engine with its defaults, unless it is the engine already.
  void use(EngineKind engine);
  /// The method, with the same of its engine.
  void use(const Method& method);
  /// Of the engine in force. @throws std::bad_variant_access of another.
  OdeSettings& ode() { return std::get<OdeSettings>(own); }
  const OdeSettings& ode() const { return std::get<OdeSettings>(own); }
  DaeSettings& dae() { return std::get<DaeSettings>(own); }
  const DaeSettings& dae() const { return std::get<DaeSettings>(own); }
  ArticulatedSettings& articulated() { return std::get<ArticulatedSettings>(own); }
  const ArticulatedSettings& articulated() const { return std::get<ArticulatedSettings>(own); }
};

/// Calls visit(key, value) for each key that an engine has of its own.
template <class Visit>
void each_setting(const OdeSettings& of, Visit visit) {
  visit("method", name(Method(of.method)));
  visit("erp", of.erp);
  visit("cfm", of.cfm);
  visit("iterations", of.iterations);
  visit("projection", of.projection);
  visit("seed", of.seed);
  visit("speculative", of.speculative);
  visit("guard", of.guard);
}
template <class Visit>
void each_setting(const DaeSettings& of, Visit visit) {
  visit("method", name(Method(of.method)));
  visit("erp", of.erp);
  visit("tolerance", of.tolerance);
}
template <class Visit>
void each_setting(const ArticulatedSettings& of, Visit visit) {
  visit("method", name(Method(of.method)));
  visit("erp", of.erp);
  visit("tolerance", of.tolerance);
  visit("speculative", of.speculative);
}

/// `speculative` of the engine in force; null where it has none.
bool* speculative(Settings& settings);

/// Settings out of range. Empty for settings that every engine takes.
std::vector<Problem> defects(const Settings& settings);

/// Effects that the engine or its method does not have, under the key `effects`.
/// @param with_stops whether the model has any: without, their effect is idle
std::vector<Problem> missing_effects(const Settings& settings, bool with_stops);

}  // namespace handsim::engine
