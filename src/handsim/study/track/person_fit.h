// Estimates the size of a hand, and where a tracker's points lie on it, together with the poses of some
// frames.
#pragma once

#include "handsim/study/track/hand_frames.h"
#include "handsim/study/track/size_unknowns.h"

namespace handsim::study {

struct PersonFit {
  hand::Person person;
  /// Shares of each feature (Feature::shares), of both hands; empty: as they were.
  std::vector<Vec3> shares;
  /// Bones, and points whose places were fitted, that are hardly better known than before; `point wrist`.
  std::vector<std::string> not_shown;
  bool no_hand = false;  ///< keypoints lie far from where they should be, most of them
};

/// The person with hand length, hand breadth and bones, and the shares of features with a spread, that bring
/// the features nearest to where they were seen. All are held to what is expected, with its deviation:
/// breadth to the survey's of the fitted length, bones to the hand model's with its spread between people
/// (`segments`), the length to the person's, or to an adult's where nobody is named; shares to those of their
/// convention, without a convention with a prior of heavy tails, so that a point that is always off does not
/// move the others. Errors that go on from frame to frame do not average out: with
/// the correlation c between neighbours, n frames weigh as n / (1 - c + n c). Without a convention, points
/// that are said to be the joints' centres and are not, by 2 mm in the mean, have their shares fitted: of as
/// few points as explain the frames as well as all would (Bayesian information criterion), else of all.
/// @param warnings gets a text for points that are always off, implausible hands, and where the points hardly
/// show the length.
/// @throws Error (input) if fewer than three frames show a hand.
PersonFit fit_person(const std::vector<HandFrames>& hands, const hand::HandSpec& spec,
                     const KnownPerson& person, bool convention, const std::string& recording,
                     std::vector<std::string>& warnings);

}  // namespace handsim::study
