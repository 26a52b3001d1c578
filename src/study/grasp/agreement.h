// Do engines agree on what is held? Random grasps drawn around a scene, each run on ODE and on the
// articulated engine, at the scene's step and where asked at a quarter of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
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
  bool quarter_steps = false;
  std::filesystem::path out;
  std::function<void(double)> progress;  ///< told the share done, 0..1
};

struct AgreementRow {
  Vec3 place = Vec3::Zero();  ///< of the object in the palm's frame [m]
  double mass = 0;            ///< [kg]
  double friction = 0;
  std::vector<simulation::GraspFigures> figures;  ///< by the table's ways
  std::string turning;  ///< what of 5 % friction or mass turns the articulated engine's verdict; empty: none
};

struct AgreementTable {
  std::vector<std::string> ways;  ///< ode, articulated, and then both with `/4`
  std::vector<AgreementRow> rows;

  /// Of how many that are not marginal two ways say the same, and how many these are.
  struct Count {
    int same = 0, of = 0;
  };
  Count agree(std::size_t way, std::size_t other) const;
  /// Median and largest difference of the grip force at the hold's end, as a share, where both hold.
  struct Difference {
    double median = 0, most = 0;
  };
  Difference grip(std::size_t way, std::size_t other) const;
};

/// Runs the study; OUT/agreement.csv and OUT/agreement.json.
/// @throws Error (input) for a scene without a grasp.
AgreementTable run_agreement(const AgreementStudy& study);

}  // namespace handsim::study
