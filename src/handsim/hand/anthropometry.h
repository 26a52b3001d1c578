// Predicts the size of a hand from stature, mass, sex and age: allometric regressions of adults with their
// residual covariance, and of children, read from handmodels/anthropometry.yaml.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "handsim/hand/person.h"

namespace handsim::hand {

/// The survey's hand dimensions; vectors and matrices are by length, breadth, palm length, circumference.
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

/// Where fits come from, and the least and largest value there.
struct Survey {
  std::string source;
  std::pair<double, double> stature{0, 3}, mass{0, 1000}, age{0, 150};  ///< [m, kg, years]
};

inline constexpr const char* kMeasuredFingers[] = {"thumb", "index", "middle"};

/// Survey of children. A fit has a table for each sex, male first, with a row for each knot x of age [years]
/// or stature [m]: x; intercept, stature and mass of ln length; the same of ln breadth; ln (finger / hand
/// length) of each measured finger; median stature [m]. Linear between rows, constant beyond them.
struct Children {
  using Tables = std::array<Eigen::MatrixXd, 2>;
  Survey survey;
  /// From a child's fit to the adults': ages, or of unknown age both statures and masses per stature [kg/m].
  std::pair<double, double> adult_age, adult_stature, adult_mass_per_stature;
  double stature_deviation = 1;         ///< of ln H at one age and sex
  std::array<double, 2> scatter{1, 1};  ///< of ln length and ln breadth, over the adults'
  double finger_of_length = 0;  ///< a hand exp(d) times as long as predicted has fingers exp(this d) times
  Tables by_age, by_stature;
};

/// Centre of mass and radii of gyration of a whole hand as shares of its length (wrist to middle fingertip).
struct HandInertiaShares {
  double centre_of_mass = 0;
  double gyration_sagittal = 0;      ///< about the dorso-palmar axis
  double gyration_transverse = 0;    ///< about the radio-ulnar axis
  double gyration_longitudinal = 0;  ///< about the long axis
};

struct Anthropometry {
  Survey survey;
  Fit by_sex;
  Fit pooled;  ///< for persons of unknown sex; `female` is 0
  std::optional<Children> children;
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
  struct Finger {
    double length = 0;  ///< from the crease at its base to its tip
    double scale = 1;   ///< measured length over the predicted one
  };
  std::map<std::string, Finger> fingers;  ///< thumb, index, middle; none without a survey of children
};

Anthropometry read_anthropometry(const YamlNode& node, const std::string& path, Diagnostics& diagnostics);

/// Size of a person's hand: measured dimensions as given, the others predicted given the measured ones.
/// @throws Error (input) for impossible dimensions, e.g. a circumference too small for the breadth.
HandSize hand_size(const Anthropometry& anthropometry, const Person& person);

/// Covariance of ln y about the predictions: the adults', widened for children.
Eigen::Matrix4d scatter_of(const Anthropometry& anthropometry, const Person& person);

/// The survey with the larger part in this person's hand.
const Survey& survey_of(const Anthropometry& anthropometry, const Person& person);

/// A sentence for each property outside the surveys, and a child's stature beyond 0.1 to 99.9 % of its age.
std::vector<std::string> extrapolations(const Anthropometry& anthropometry, const Person& person);

/// Thickness of a stadium: (circumference - 2 breadth) / (pi - 2).
double stadium_thickness(double circumference, double breadth);

/// Quantile of the standard normal distribution, p in (0, 1).
double normal_quantile(double p);

}  // namespace handsim::hand
