// Predicts the size of a hand from stature, mass and sex: allometric regressions with their residual
// covariance, read from handmodels/anthropometry.yaml.
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "handsim/hand/person.h"

namespace handsim::hand {

/// The survey's hand dimensions; every vector and matrix here has the order length, breadth, palm length,
/// circumference.
inline constexpr int kHandDimensions = 4;

/// ln y = intercept + stature ln H + mass ln m + female [woman]; y = smearing exp(ln y) [m].
struct Allometry {
  double intercept = 0;
  double stature = 0;
  double mass = 0;
  double female = 0;
  double smearing = 1;
};

struct Fit {
  std::array<Allometry, kHandDimensions> dimensions;
  Eigen::Matrix4d residual_covariance = Eigen::Matrix4d::Identity();  ///< of ln y
};

/// Centre of mass and radii of gyration of a whole hand as shares of its length (wrist to middle fingertip).
struct HandInertiaShares {
  double centre_of_mass = 0;
  double gyration_sagittal = 0;      ///< about the dorso-palmar axis
  double gyration_transverse = 0;    ///< about the radio-ulnar axis
  double gyration_longitudinal = 0;  ///< about the long axis
};

struct Anthropometry {
  std::string source;
  std::pair<double, double> stature_range;  ///< of the survey [m]
  std::pair<double, double> mass_range;     ///< of the survey [kg]
  Fit by_sex;
  Fit pooled;  ///< for persons of unknown sex; `female` is 0
  std::string reference_source;
  HandInertiaShares reference_male;
  HandInertiaShares reference_female;
};

/// Size of one hand [m].
struct HandSize {
  double length = 0;
  double breadth = 0;
  double palm_length = 0;
  double circumference = 0;
  double thickness = 0;  ///< of a stadium (slab with half-round edges) of this breadth and circumference
  std::array<bool, kHandDimensions> measured{};
};

Anthropometry read_anthropometry(YamlNode& node, const std::string& path, Diagnostics& diagnostics);

/// Size of a person's hand: measured dimensions as given, the others predicted given the measured ones.
/// @throws Error (input) for impossible dimensions, e.g. a circumference too small for the breadth.
HandSize hand_size(const Anthropometry& anthropometry, const Person& person);

/// A sentence for each property of the person that is outside the survey's range.
std::vector<std::string> extrapolations(const Anthropometry& anthropometry, const Person& person);

/// Thickness of a stadium: (circumference - 2 breadth) / (pi - 2).
double stadium_thickness(double circumference, double breadth);

/// Quantile of the standard normal distribution, p in (0, 1).
double normal_quantile(double p);

}  // namespace handsim::hand
