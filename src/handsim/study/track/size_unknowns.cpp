#include "handsim/study/track/size_unknowns.h"

#include <cmath>

namespace handsim::study {

namespace {

constexpr double kSpread = 0.05;         ///< of a size by the predicted one, where no file gives it: chosen
constexpr double kUnknownSpread = 0.25;  ///< of the length of an unknown hand: chosen
constexpr double kHeld = 1e-6;           ///< of its spread, for a size that is kept
constexpr double kTail = 4;              ///< degrees of freedom of the prior of shares (Student's t)

}  // namespace

/// Whose sizes are predicted where nobody is named: between the survey's mean man and woman.
hand::Person adult() {
  hand::Person out;
  out.title = "mean adult";
  out.stature = 1.690;
  out.mass = 75.1;
  return out;
}

Unknowns::Unknowns(const hand::HandSpec& model, const KnownPerson& person,
                   const std::vector<Feature>& features, bool fit_shares, bool by_convention)
    : spec(&model),
      of(&person.person),
      like(person.named || person.keep ? person.person : adult()),
      named(person.named || person.keep),
      convention(by_convention) {
  size = hand::build_hand(model, like).size;
  std::vector<bool> shown(model.segments.size(), false);
  for (const Feature& feature : features)
    if (feature.segment && feature.shares.y() != 0) shown[*feature.segment] = true;
  for (std::size_t i = 0; i < model.segments.size(); ++i) {
    const hand::SegmentSpec& segment = model.segments[i];
    // A metacarpal that is a part of the palm, or a carrier, is no bone of a person's file.
    if (segment.carrier || !segment.of_palm.empty()) continue;
    if (segment.has_child || shown[i]) bones.push_back(i);
  }
  for (std::size_t i = 0; i < features.size() && fit_shares; ++i)
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      if (features[i].spread[axis] > 0) shares.push_back({i, axis});
  const auto given = [&](const char* name) {
    const auto found = model.spread.find(name);
    return found == model.spread.end() ? kSpread : found->second;
  };
  const Eigen::Matrix4d scatter = hand::scatter_of(model.anthropometry, like);
  expected = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(2 + bones.size() + shares.size()));
  spread = expected;
  expected.head(2 + as_row(bones.size())).setOnes();
  spread.head(2 + as_row(bones.size())).setConstant(given("segments"));
  expected[0] = size.length;
  spread[0] = size.length * (!named             ? (fit_shares ? kAdultSpread : kUnknownSpread)
                             : like.hand_length ? given("measured")
                                                : std::sqrt(scatter(0, 0)));
  spread[1] = !named              ? kAdultShapeSpread
              : like.hand_breadth ? given("measured")
                                  : std::sqrt(scatter(1, 1) - scatter(0, 1) * scatter(0, 1) / scatter(0, 0));
  for (std::size_t i = 0; i < bones.size(); ++i)
    if (of->bones.contains(model.segments[bones[i]].name)) spread[2 + as_row(i)] = given("measured");
  if (person.keep) spread.head(first_share()) *= kHeld;
  for (std::size_t i = 0; i < shares.size(); ++i)
    spread[first_share() + as_row(i)] = features[shares[i].feature].spread[shares[i].axis];
}

hand::Person Unknowns::person(const Eigen::VectorXd& values) const {
  hand::Person out = like;
  out.hand_length = values[0];
  out.hand_length_percentile.reset();
  // Among people of all statures hands are alike; those of one stature differ less in breadth.
  hand::HandSize now = size;
  now.length = values[0];
  now.breadth = values[1] * (named ? hand::hand_size(spec->anthropometry, out).breadth
                                   : size.breadth * values[0] / size.length);
  out = *of;
  out.hand_length = now.length;
  out.hand_breadth = now.breadth;
  out.hand_length_percentile.reset();
  for (std::size_t i = 0; i < bones.size(); ++i) {
    const hand::SegmentSpec& bone = spec->segments[bones[i]];
    const auto own = of->bones.find(bone.name);
    out.bones[bone.name] =
        values[2 + as_row(i)] * (own != of->bones.end() ? own->second : bone.length.value(now));
  }
  return out;
}

std::vector<Feature> Unknowns::placed(std::vector<Feature> features, const Eigen::VectorXd& values) const {
  for (std::size_t i = 0; i < shares.size(); ++i)
    features[shares[i].feature].shares[shares[i].axis] += values[first_share() + as_row(i)];
  return features;
}

Eigen::VectorXd Unknowns::prior(const Eigen::VectorXd& values) const {
  Eigen::VectorXd out = spread.cwiseAbs2().cwiseInverse();
  if (convention) return out;
  std::map<std::size_t, std::pair<double, double>> off;  // by feature: squares, their number
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const Eigen::Index row = first_share() + as_row(i);
    off[shares[i].feature].first += values[row] * values[row] * out[row];
    off[shares[i].feature].second += 1;
  }
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const auto& [squares, count] = off[shares[i].feature];
    out[first_share() + as_row(i)] *= (kTail + count) / (kTail + squares);
  }
  return out;
}

}  // namespace handsim::study
