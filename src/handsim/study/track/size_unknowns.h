// The unknowns of the fit of a hand's size, and what is expected of them.
#pragma once

#include "handsim/hand/hand_file.h"
#include "handsim/study/track/hand_tree.h"

namespace handsim::study {

struct KnownPerson {
  const hand::Person& person;
  bool named = true;  ///< false: taken because nobody was named
  bool keep = false;  ///< only shares are fitted
};

// Of ln length and ln breadth of adults, and of ln breadth given length: the survey's men and women.
inline constexpr double kAdultSpread = 0.063, kAdultBreadthSpread = 0.079, kAdultShapeSpread = 0.056;

/// Whose sizes are predicted where nobody is named: between the survey's mean man and woman.
hand::Person adult();

/// The unknowns of the fit: hand length, breadth and bones over those of a person of that length, then the
/// shares of features with a spread, less those that they have. Markers of a last segment are placed in
/// metres: its length does not move them.
struct Unknowns {
  struct Share {
    std::size_t feature = 0;
    Eigen::Index axis = 0;
  };
  const hand::HandSpec* spec;
  const hand::Person* of;  ///< whose file is written
  hand::Person like;       ///< whose sizes are expected
  bool named, convention;
  hand::HandSize size;
  std::vector<std::size_t> bones;  ///< rows of the hand model's segments
  std::vector<Share> shares;
  Eigen::VectorXd expected, spread;  ///< length [m], ratios, shares; their deviations

  Unknowns(const hand::HandSpec& model, const KnownPerson& person, const std::vector<Feature>& features,
           bool fit_shares, bool by_convention);

  static Eigen::Index as_row(std::size_t i) { return static_cast<Eigen::Index>(i); }
  Eigen::Index first_share() const { return 2 + as_row(bones.size()); }

  hand::Person person(const Eigen::VectorXd& values) const;
  /// The features with these shares.
  std::vector<Feature> placed(std::vector<Feature> features, const Eigen::VectorXd& values) const;
  /// Inverse variances. Without a convention a feature's shares that are far from what is expected are held
  /// less.
  Eigen::VectorXd prior(const Eigen::VectorXd& values) const;
};

}  // namespace handsim::study
