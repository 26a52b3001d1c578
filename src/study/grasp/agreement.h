// Do engines agree on what is held? Random grasps drawn around a scene, each run on ODE and on the
// articulated engine, there at a quarter of the step, too. Grasps of which the two differ, and some others
// where asked, run on ODE at a quarter of the step as well, which costs four times all the rest.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "handsim/simulation/watch/grasp_figures.h"

namespace handsim::study {

/// Draws: the object's place in the hand within this of the scene's along each axis [m], its mass [kg], the
/// friction of every surface; the one shake.
inline constexpr double kDrawnShift = 6e-3;
inline constexpr double kLeastMass = 0.15, kMostMass = 0.6;
inline constexpr double kLeastFriction = 0.3, kMostFriction = 1;

struct AgreementStudy {
  std::filesystem::path scene;         ///< with one grasp
  std::vector<std::string> overrides;  ///< `key.path=value`
  int draws = 100;
  std::uint64_t seed = 1;
  int quarter_steps = 0;  ///< the first so many draws run on ODE at a quarter of the step, whatever they say
  int threads = 0;        ///< 0: as many as the machine has
  std::filesystem::path out;
  std::function<void(double)> progress;  ///< told the share done, 0..1; may throw, which ends the study
};

struct AgreementRow {
  Vec3 place = Vec3::Zero();  ///< of the object in the palm's frame [m]
  double mass = 0;            ///< [kg]
  double friction = 0;
  std::vector<simulation::GraspFigures>
      figures;          ///< by kWays; the last may be absent, and all where it has not run
  std::string turning;  ///< what of 5 % friction or mass turns the articulated engine's verdict; empty: none
  double cpu = 0;       ///< of all its runs [s]

  bool done() const { return !figures.empty(); }
  bool differs() const { return done() && figures[0].held != figures[1].held; }
};

/// Below this a slip is what the softness of an engine's friction lets creep, of which other engines and
/// steps have other amounts [m/s]: up to 0.5 um/s in what has settled.
inline constexpr double kSlipFloor = 1e-6;

/// Engines and steps, the scene's and a quarter of it.
inline constexpr std::array<const char*, 4> kWays = {"ode", "articulated", "articulated/4", "ode/4"};

struct AgreementTable {
  std::vector<AgreementRow> rows;    ///< as drawn
  std::size_t quarter_rows = 0;      ///< the first of them, whose quarter steps on ODE are counted
  std::vector<std::string> refused;  ///< why: further draws, which the scene's grip cannot hold at all

  /// Of how many two ways say the same.
  struct Count {
    int same = 0, of = 0;
  };
  struct Pair {
    Count all, clear;  ///< of all rows; of those that are not marginal
    /// Median and largest difference of the grip force at the hold's end, as a share, where both hold; and in
    /// how many it is at most a tenth.
    double grip_median = 0, grip_most = 0;
    Count grip_within;
    double slip = 0, other_slip = 0;  ///< medians where both hold [m/s]
    /// In how many that both hold the slip of each is below kSlipFloor; in how many of the others the slips
    /// differ by at most a tenth of the greater.
    int slip_below = 0;
    Count slip_within;
  };
  /// @param way, other by kWays
  Pair compare(std::size_t way, std::size_t other) const;
  std::size_t done() const;  ///< rows that have run
};

/// The study's overrides and those of a row's place, mass and shake; its friction is set_friction()'s.
std::vector<std::string> drawn_overrides(const AgreementStudy& study, const AgreementRow& row);

/// Which ways are compared: the engines, each with its own quarter step, and these.
std::vector<std::pair<std::size_t, std::size_t>> agreement_pairs(const AgreementTable& table);

/// Runs the study; OUT/agreement.csv and OUT/agreement.json, written after each draw of the draws done.
/// @throws Error (input) for a scene without a grasp, or whose grip refuses more draws than it takes.
AgreementTable run_agreement(const AgreementStudy& study);

}  // namespace handsim::study
