// How an engine is to advance a model: what scenes state and engines obey.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "handsim/model/effects.h"

namespace handsim::model {

enum class EngineKind {
  ode,          ///< Open Dynamics Engine: contacts, stops, speed
  dae,          ///< differential-algebraic solver: the reference for motion without contacts and stops
  articulated,  ///< recursive algorithms in joint coordinates: the fastest
};

enum class Method {
  world_step,  ///< ODE's direct LCP solver (Dantzig): exact, cost grows with the cube of the rows
  quick_step,  ///< ODE's iterative solver (projected SOR): cost grows with rows times iterations
  /// ODE: each step the cheaper of the two above, by the rows of each group of bodies that touch or are
  /// jointed and a measured cost of both (not by the clock: runs stay reproducible). YAML: `auto`.
  automatic,
  /// DAE: variable order and step on the stabilised index-2 form (Gear, Gupta & Leimkuhler 1985), to
  /// `tolerance`. What Adams's GSTIFF SI2 does.
  stabilised_gear,
  /// DAE: augmented Lagrangian (Bayo & Ledesma 1996) with second-order backward differences. MeVEA's way.
  lagrange_penalty,
  /// DAE: linearised implicit Euler at velocity level, gaps pulled back by `erp` a step. Chrono's.
  euler_linearised,
  /// DAE: the same with positions projected onto the joints after every step. Chrono's.
  euler_projected,
  /// Articulated: first order; springs, dampers, servos and stops evaluated at the step's end, stable at any
  /// step; contacts with Coulomb's cone.
  semi_implicit_euler,
  rk4,  ///< articulated: the classical fourth-order Runge-Kutta method, for motion without stops
  /// Articulated: Dormand and Prince's eighth-order Runge-Kutta method with error control to `tolerance`, for
  /// motion without stops.
  dormand_prince,
};

inline constexpr std::array<std::string_view, 3> kEngineNames = {"ode", "dae", "articulated"};
inline constexpr std::array<std::string_view, 10> kMethodNames = {
    "world_step",      "quick_step",          "auto",
    "stabilised_gear", "lagrange_penalty",    "euler_linearised",
    "euler_projected", "semi_implicit_euler", "rk4",
    "dormand_prince"};

inline std::string_view name(EngineKind kind) { return kEngineNames[static_cast<std::size_t>(kind)]; }
inline std::string_view name(Method method) { return kMethodNames[static_cast<std::size_t>(method)]; }

/// The engine that offers a method: a method names its engine, so settings cannot contradict themselves.
inline EngineKind engine_of(Method method) {
  switch (method) {
    case Method::world_step:
    case Method::quick_step:
    case Method::automatic:
      return EngineKind::ode;
    case Method::stabilised_gear:
    case Method::lagrange_penalty:
    case Method::euler_linearised:
    case Method::euler_projected:
      return EngineKind::dae;
    case Method::semi_implicit_euler:
    case Method::rk4:
    case Method::dormand_prince:
      return EngineKind::articulated;
  }
  return EngineKind::ode;
}

/// An engine's method where none is asked for.
inline Method default_method(EngineKind kind) {
  switch (kind) {
    case EngineKind::ode:
      return Method::world_step;
    case EngineKind::dae:
      return Method::stabilised_gear;
    case EngineKind::articulated:
      return Method::semi_implicit_euler;
  }
  return Method::world_step;
}

/// What a guarded step must keep to (effect step_guard); a step beyond, or one whose LCP solver gave up, is
/// taken back to the bit and tried again: with 100 x the CFM, as two half steps, with quick_step at 200
/// iterations. Every retry is counted. ODE only.
struct GuardLimits {
  double joint_gap = 1e-3;      ///< largest gap of any joint after the step [m]
  double speed = 30;            ///< fastest body [m/s]
  double angular_speed = 1000;  ///< fastest spin [rad/s]
};

struct SolverSettings {
  Method method = Method::world_step;
  double step = 1e-3;  ///< [s], above 0 to 0.1
  /// Share of a joint's positional error that one step corrects, 0..1. Low: joints drift apart under
  /// load; high (above about 0.8): jitter, and rebound at stops. ODE and euler_linearised; articulated: of an
  /// angle beyond its stop at the start.
  double erp = 0.2;
  /// Constraint force mixing (softness of every constraint row), above 0 to 1. Low: redundant rows make the
  /// LCP fail; high: joints feel like rubber. ODE only.
  double cfm = 1e-9;
  int iterations = 20;  ///< quick_step and auto
  /// ODE only: after every step impulses of the joints close them to 1e-13 m, positions and velocities both
  /// (SHAKE). Contacts and stops do not see it. Off: gaps of the order of step^2 acceleration / erp.
  bool projection = false;
  std::uint64_t seed = 1;  ///< quick_step shuffles its rows with ODE's random generator
  /// stabilised_gear, dormand_prince: error aimed for in smooth motion of some seconds, relative, and
  /// absolute in units of 1 m, 1 m/s, 1 rad, 1 rad/s; each of the integrator's own steps is held to a share
  /// of it. 1e-11 to 1e-2. Ten times smaller costs 1.2 to 1.9 times as much. High: energy drifts; lower:
  /// drowned in rounding.
  double tolerance = 1e-9;
  /// Contacts that bodies are about to make within a step are kept before they happen, where a pair of shapes
  /// goes further in a step than half the smaller of their smallest radii. Off: such bodies end steps within
  /// and behind each other. ODE and semi_implicit_euler.
  bool speculative = true;
  GuardLimits guard;
  /// Contacts tell their forces; costs some percent of a step with contacts.
  bool contact_forces = false;
  Effects effects;
};

}  // namespace handsim::model
