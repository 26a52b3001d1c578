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
  articulated,  ///< recursive algorithms in joint coordinates: the fastest, without contacts
};

enum class Method {
  world_step,  ///< ODE's direct LCP solver (Dantzig): exact, cost grows with the cube of the rows
  quick_step,  ///< ODE's iterative solver (projected SOR): cost grows with rows times iterations
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
  /// step.
  semi_implicit_euler,
  rk4,  ///< articulated: the classical fourth-order Runge-Kutta method, for motion without stops
  /// Articulated: Dormand and Prince's eighth-order Runge-Kutta method with error control to `tolerance`, for
  /// motion without stops.
  dormand_prince,
};

inline constexpr std::array<std::string_view, 3> kEngineNames = {"ode", "dae", "articulated"};
inline constexpr std::array<std::string_view, 9> kMethodNames = {
    "world_step",       "quick_step",      "stabilised_gear",     "lagrange_penalty",
    "euler_linearised", "euler_projected", "semi_implicit_euler", "rk4",
    "dormand_prince"};

inline std::string_view name(EngineKind kind) { return kEngineNames[static_cast<std::size_t>(kind)]; }
inline std::string_view name(Method method) { return kMethodNames[static_cast<std::size_t>(method)]; }

/// The engine that offers a method: a method names its engine, so settings cannot contradict themselves.
inline EngineKind engine_of(Method method) {
  switch (method) {
    case Method::world_step:
    case Method::quick_step:
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
  int iterations = 20;     ///< quick_step only
  std::uint64_t seed = 1;  ///< quick_step shuffles its rows with ODE's random generator
  /// stabilised_gear, dormand_prince: error aimed for in smooth motion of some seconds, relative, and
  /// absolute in units of 1 m, 1 m/s, 1 rad, 1 rad/s; each of the integrator's own steps is held to a share
  /// of it. 1e-11 to 1e-2. Ten times smaller costs 1.2 to 1.9 times as much. High: energy drifts; lower:
  /// drowned in rounding.
  double tolerance = 1e-9;
  Effects effects;
};

}  // namespace handsim::model
