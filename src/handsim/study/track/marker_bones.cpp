#include "handsim/study/track/marker_bones.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "handsim/core/error.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

constexpr std::size_t kMostHandFrames = 40;  ///< of a hand
constexpr double kSpread = 0.05;             ///< of a size, relative to the predicted one: chosen
constexpr double kUnknownSpread = 0.25;      ///< of the length of a hand of which nobody says whose: chosen
constexpr double kLeastCoordinateNoise = 1e-7;  ///< of a coordinate [m]
constexpr double kOutlier = 0.05;               ///< a marker farther from the fit is left out [m]
constexpr double kStep = 1e-6;                  ///< of a size, to differentiate

/// The sizes that markers show: hand length, then breadth and every bone that carries another, over those of
/// a person of that length. Markers of a last segment are placed in metres: its length does not move them.
struct Sizes {
  const hand::HandSpec* spec;
  const hand::Person* of;
  hand::HandSize size;
  std::vector<std::size_t> bones;     ///< rows of the hand model's segments
  Eigen::VectorXd predicted, spread;  ///< length [m], ratios; their deviations

  Sizes(const hand::HandSpec& model, const MarkerPerson& person)
      : spec(&model), of(&person.predicted), size(hand::build_hand(model, *of).size) {
    for (std::size_t i = 0; i < model.segments.size(); ++i)
      if (model.segments[i].has_child) bones.push_back(i);
    predicted = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(2 + bones.size()));
    spread = kSpread * predicted;
    predicted[0] = size.length;
    spread[0] = (person.named ? kSpread : kUnknownSpread) * size.length;
  }

  hand::Person person(const Eigen::VectorXd& values) const {
    hand::HandSize now = size;
    now.length = values[0];
    now.breadth = values[1] * size.breadth * values[0] / size.length;
    hand::Person out = *of;
    out.hand_length = now.length;
    out.hand_breadth = now.breadth;
    out.hand_length_percentile.reset();
    for (std::size_t i = 0; i < bones.size(); ++i) {
      const hand::SegmentSpec& bone = spec->segments[bones[i]];
      const auto own = of->bones.find(bone.name);
      out.bones[bone.name] = values[static_cast<Eigen::Index>(2 + i)] *
                             (own != of->bones.end() ? own->second : bone.length.value(now));
    }
    return out;
  }
};

/// A frame that takes part, and its pose so far.
struct Used {
  MeasuredFrame frame;
  FitResult fit;
};

/// The frames of one hand, evenly over those that show two thirds of its features.
std::vector<Used> frames_of(const HandFrames& hand, PoseFit& fit) {
  std::vector<std::size_t> good;
  for (std::size_t k = 0; k < hand.size(); ++k) {
    const MeasuredFrame frame = hand.at(k);
    const auto seen = std::ranges::count_if(frame, &MeasuredPoint::seen);
    if (seen >= 3 && 3 * seen >= 2 * static_cast<std::ptrdiff_t>(frame.size())) good.push_back(k);
  }
  std::vector<Used> out;
  const std::size_t stride = 1 + good.size() / kMostHandFrames;
  for (std::size_t i = 0; i < good.size(); i += stride) {
    out.push_back({hand.at(good[i]), {}});
    out.back().fit = fit.find(out.back().frame, kOutlier);
  }
  // A frame far from the others is another hand's, or wrongly found.
  std::vector<double> rms;
  for (const Used& each : out) rms.push_back(each.fit.rms);
  if (rms.empty()) return out;
  const double most = 2 * median(rms) + 1e-6;
  std::erase_if(out, [&](const Used& each) { return each.fit.rms > most; });
  return out;
}

/// Normal equations of the sizes, with the poses eliminated.
struct Normal {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd right;
  double squares = 0, spare = 0;  ///< squared residuals [m^2]; their number less that of pose parameters

  explicit Normal(Eigen::Index size)
      : matrix(Eigen::MatrixXd::Zero(size, size)), right(Eigen::VectorXd::Zero(size)) {}

  /// @param r residuals, J by the pose, D by the sizes.
  void add(const Eigen::VectorXd& r, const Eigen::MatrixXd& J, const Eigen::MatrixXd& D) {
    const Eigen::MatrixXd own = J.transpose() * J;
    const double least = 1e-12 * own.diagonal().maxCoeff();
    const Eigen::LDLT<Eigen::MatrixXd> factor(own +
                                              least * Eigen::MatrixXd::Identity(own.rows(), own.cols()));
    const Eigen::MatrixXd rest = D - J * factor.solve(J.transpose() * D);
    matrix += rest.transpose() * rest;
    right -= rest.transpose() * r;
    squares += r.squaredNorm();
    spare += static_cast<double>(r.size() - J.cols());
  }
};

/// Angles at a stop do not move.
Eigen::MatrixXd free_columns(const Eigen::MatrixXd& J, const HandPose& pose, const HandTree& tree) {
  constexpr double kNear = 1e-9;
  std::vector<Eigen::Index> kept;
  for (Eigen::Index k = 0; k < J.cols(); ++k) {
    const auto axis = as_index(k) - 6;
    const bool held = k >= 6 && (pose.angles[axis] <= tree.axes()[axis].low + kNear ||
                                 pose.angles[axis] >= tree.axes()[axis].high - kNear);
    if (!held) kept.push_back(k);
  }
  return J(Eigen::all, kept);
}

class SizeFit {
 public:
  SizeFit(const std::vector<HandFrames>& hands, const hand::HandSpec& spec, const MarkerPerson& person)
      : hands_(hands), spec_(spec), sizes_(spec, person), now_(sizes_.predicted) {
    std::vector<PoseFit> fits = fits_at(now_);
    for (std::size_t h = 0; h < hands.size(); ++h) used_.push_back(frames_of(hands[h], fits[h]));
  }

  std::size_t frames() const {
    std::size_t out = 0;
    for (const auto& each : used_) out += each.size();
    return out;
  }

  /// Gauss-Newton on the sizes; after each step the poses are fitted again.
  hand::Person run() {
    constexpr int kMostRounds = 20;
    for (int round = 0; round < kMostRounds; ++round) {
      std::vector<PoseFit> fits = fits_at(now_);
      for (std::size_t h = 0; h < used_.size(); ++h)
        for (Used& each : used_[h]) each.fit = fits[h].fit(each.frame, each.fit.pose, kOutlier);
      const Normal normal = linearise(fits);
      const double noise =
          std::max(kLeastCoordinateNoise, std::sqrt(normal.squares / std::max(1.0, normal.spare)));
      const Eigen::VectorXd prior = sizes_.spread.cwiseAbs2().cwiseInverse();
      Eigen::MatrixXd matrix = normal.matrix / (noise * noise);
      matrix.diagonal() += prior;
      const Eigen::VectorXd right =
          normal.right / (noise * noise) + prior.cwiseProduct(sizes_.predicted - now_);
      const Eigen::LDLT<Eigen::MatrixXd> factor(matrix);
      const Eigen::VectorXd step = factor.solve(right);
      now_ += step.cwiseMax(-0.1 * now_).cwiseMin(0.1 * now_);
      const auto size = now_.size();
      left_ = factor.solve(Eigen::MatrixXd::Identity(size, size)).diagonal().cwiseProduct(prior);
      if (step.cwiseAbs().maxCoeff() < 1e-9) break;
    }
    hand::Person out = sizes_.person(now_);
    // What is as uncertain as before was not measured.
    for (std::size_t i = 0; i < sizes_.bones.size(); ++i)
      if (left_[static_cast<Eigen::Index>(2 + i)] > 0.99)
        out.bones.erase(spec_.segments[sizes_.bones[i]].name);
    return out;
  }
  /// The uncertainty of the length is less than half of what it was before.
  bool shows_length() const { return left_[0] < 0.25; }

 private:
  std::vector<PoseFit> fits_at(const Eigen::VectorXd& values) const {
    const hand::BuiltHand built = hand::build_hand(spec_, sizes_.person(values));
    std::vector<PoseFit> out;
    for (const HandFrames& hand : hands_) out.emplace_back(HandTree(spec_, built, hand.side), hand.features);
    return out;
  }

  Normal linearise(std::vector<PoseFit>& fits) const {
    const Eigen::Index count = now_.size();
    std::vector<std::vector<PoseFit>> moved;
    for (Eigen::Index i = 0; i < count; ++i) {
      Eigen::VectorXd values = now_;
      values[i] += kStep;
      moved.push_back(fits_at(values));
    }
    Normal out(count);
    for (std::size_t h = 0; h < used_.size(); ++h)
      for (const Used& each : used_[h]) {
        const Rows at = fits[h].rows(each.frame, each.fit.pose, each.fit.rejected);
        Eigen::MatrixXd D(at.residuals.size(), count);
        for (Eigen::Index i = 0; i < count; ++i)
          D.col(i) = (moved[static_cast<std::size_t>(i)][h]
                          .rows(each.frame, each.fit.pose, each.fit.rejected)
                          .residuals -
                      at.residuals) /
                     kStep;
        out.add(at.residuals, free_columns(at.jacobian, each.fit.pose, fits[h].tree()), D);
      }
    return out;
  }

  const std::vector<HandFrames>& hands_;
  const hand::HandSpec& spec_;
  Sizes sizes_;
  Eigen::VectorXd now_, left_;  ///< left_: variance over that before
  std::vector<std::vector<Used>> used_;
};

/// The markers of a hand lie 2 to 60 cm apart: others are in another unit.
void check_marker_unit(const std::vector<HandFrames>& hands, const std::string& recording) {
  double longest = 0;
  for (const HandFrames& hand : hands)
    for (std::size_t k = 0; k < hand.size(); ++k) {
      const MeasuredFrame frame = hand.at(k);
      for (const MeasuredPoint& a : frame)
        if (a.point && frame.front().point)
          longest = std::max(longest, (*a.point - *frame.front().point).norm());
    }
  if (longest > 0 && (longest < 0.02 || longest > 0.6))
    throw input_error(
        recording, fmt::format("markers of one hand up to {:.3g} m apart", longest),
        "0.02 to 0.6 m: the unit is in the header of a .trc, behind the names of columns in a .csv");
}

}  // namespace

HandFrames::HandFrames(const Recording& recording, std::vector<Feature> of, model::Side of_side)
    : side(of_side), features(std::move(of)), size_(recording.times.size()) {
  for (const Feature& feature : features) {
    const auto found = recording.channels.find(feature.name);
    channels_.push_back(found == recording.channels.end() ? nullptr : &found->second);
  }
}

MeasuredFrame HandFrames::at(std::size_t frame) const {
  MeasuredFrame out(features.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!channels_[i]) continue;
    if (features[i].kind == Feature::Kind::point) {
      if (const Vec3* point = channels_[i]->points.at(frame)) out[i].point = *point;
    } else if (const Quat* orientation = channels_[i]->orientations.at(frame)) {
      out[i].orientation = *orientation;
    }
  }
  return out;
}

bool HandFrames::any(Feature::Kind kind) const {
  for (std::size_t i = 0; i < features.size(); ++i)
    if (features[i].kind == kind && channels_[i] &&
        !(kind == Feature::Kind::point ? channels_[i]->points.empty() : channels_[i]->orientations.empty()))
      return true;
  return false;
}

hand::Person fit_bones_to_markers(const std::vector<HandFrames>& hands, const hand::HandSpec& spec,
                                  const MarkerPerson& person, const std::string& recording,
                                  std::vector<std::string>& warnings) {
  check_marker_unit(hands, recording);
  SizeFit fit(hands, spec, person);
  if (fit.frames() < 3)
    throw input_error(recording, "fewer than three frames that show a hand",
                      "frames with two thirds of the markers of --markers, or --keep-person");
  hand::Person out = fit.run();
  if (!fit.shows_length())
    warnings.push_back(fmt::format(
        "{}: the markers hardly show the length of the hand: {:.0f} mm are near those of the {}{}", recording,
        1e3 * *out.hand_length, person.predicted.title, person.named ? "" : ", as no --person is given"));
  out.title =
      person.predicted.title + ", hand measured from " + std::filesystem::path(recording).filename().string();
  return out;
}

}  // namespace handsim::study
