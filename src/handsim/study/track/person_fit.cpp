#include "handsim/study/track/person_fit.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "handsim/core/error.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {
constexpr std::size_t kMostHandFrames = 60;     ///< of a hand
constexpr double kLeastCoordinateNoise = 1e-7;  ///< of a coordinate [m]
constexpr double kOutlier = 0.05;               ///< a point farther from the fit is left out [m]
constexpr double kStep = 1e-6;                  ///< of a size, to differentiate
constexpr double kNoHand = 15e-3;               ///< the same, of one that is no such point: chosen [m]
constexpr double kOff = 2e-3;                   ///< mean residual of a point that is always off [m]
/// Without a convention stops give way by this much while sizes and places are fitted [rad], chosen: noise of
/// a finger that lies near its stop would else be one-sided, and places, which nothing else holds, would take
/// it up.
constexpr double kGiveOfStops = 20 * M_PI / 180;

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
  double lagged = 0;              ///< products of residuals with those of the frame before, in the palm [m^2]
  std::size_t frames = 0;

  /// Frames that count as one: what goes on from frame to frame does not average out.
  double together() const {
    const double c = std::clamp(lagged / std::max(squares, 1e-300), 0.0, 1.0);
    return 1 - c + static_cast<double>(frames) * c;
  }

  explicit Normal(Eigen::Index size)
      : matrix(Eigen::MatrixXd::Zero(size, size)), right(Eigen::VectorXd::Zero(size)) {}

  /// @param r residuals, J by the pose, D by the sizes. @param points their rows of features
  void add(const Eigen::VectorXd& r, const Eigen::MatrixXd& J, const Eigen::MatrixXd& D,
           Eigen::Index points) {
    const Eigen::MatrixXd own = J.transpose() * J;
    const double least = 1e-12 * own.diagonal().maxCoeff();
    const Eigen::LDLT<Eigen::MatrixXd> factor(own +
                                              least * Eigen::MatrixXd::Identity(own.rows(), own.cols()));
    const Eigen::MatrixXd rest = D - J * factor.solve(J.transpose() * D);
    matrix += rest.transpose() * rest;
    right -= rest.transpose() * r;
    squares += r.head(points).squaredNorm();
    spare += static_cast<double>(points - J.cols());
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

class Fit {
 public:
  Fit(const std::vector<HandFrames>& hands, const hand::HandSpec& spec, const KnownPerson& person,
      bool fit_shares, bool convention)
      : hands_(hands),
        spec_(spec),
        unknowns_(spec, person, hands.front().features, fit_shares, convention),
        now_(unknowns_.expected) {
    std::vector<PoseFit> fits = fits_at(now_);
    for (std::size_t h = 0; h < hands.size(); ++h) used_.push_back(frames_of(hands[h], fits[h]));
  }

  std::size_t frames() const {
    std::size_t out = 0;
    for (const auto& each : used_) out += each.size();
    return out;
  }

  /// Gauss-Newton; after each step the poses are fitted again.
  void run() {
    constexpr int kMostRounds = 25;
    for (int round = 0; round < kMostRounds; ++round) {
      std::vector<PoseFit> fits = fits_at(now_);
      for (std::size_t h = 0; h < used_.size(); ++h)
        for (Used& each : used_[h]) each.fit = fits[h].fit(each.frame, each.fit.pose, kOutlier);
      const Normal normal = linearise(fits);
      noise_ = std::max(kLeastCoordinateNoise, std::sqrt(normal.squares / std::max(1.0, normal.spare)));
      const double variance = noise_ * noise_ * normal.together();
      const Eigen::VectorXd prior = unknowns_.prior(now_);
      Eigen::MatrixXd matrix = normal.matrix / variance;
      matrix.diagonal() += prior;
      const Eigen::VectorXd right = normal.right / variance + prior.cwiseProduct(unknowns_.expected - now_);
      const Eigen::LDLT<Eigen::MatrixXd> factor(matrix);
      Eigen::VectorXd most = 0.1 * now_;
      most.tail(now_.size() - unknowns_.first_share()).setConstant(0.3);
      const Eigen::VectorXd step = factor.solve(right).cwiseMax(-most).cwiseMin(most);
      now_ += step;
      const auto size = now_.size();
      left_ = factor.solve(Eigen::MatrixXd::Identity(size, size)).diagonal().cwiseProduct(prior);
      if (step.cwiseAbs().maxCoeff() < 1e-9) break;
    }
  }
  hand::Person person() const {
    hand::Person out = unknowns_.person(now_);
    // What is as uncertain as before was not measured.
    for (std::size_t i = 0; i < unknowns_.bones.size(); ++i)
      if (left_[static_cast<Eigen::Index>(2 + i)] > 0.99)
        out.bones.erase(spec_.segments[unknowns_.bones[i]].name);
    return out;
  }
  std::vector<Vec3> shares() const {
    std::vector<Vec3> out;
    for (const Feature& feature : unknowns_.placed(hands_.front().features, now_))
      out.push_back(feature.shares);
    return out;
  }
  /// The uncertainty of the length is less than half of what it was before.
  bool shows_length() const { return left_[0] < 0.25; }

  /// Mean residual of each feature of the first hand in the palm over the frames [m], where it is more than
  /// the noise's.
  std::vector<double> off() const {
    std::vector<Vec3> sums(hands_.front().features.size(), Vec3::Zero());
    std::vector<double> counts(sums.size(), 0), out;
    std::vector<PoseFit> fits = fits_at(now_);
    for (const Used& each : used_.front()) {
      const Eigen::VectorXd r =
          in_palm(fits.front().rows(each.frame, each.fit.pose, each.fit.rejected), each);
      for (std::size_t i = 0; i < sums.size(); ++i) {
        if (!each.fit.distances[i]) continue;
        sums[i] += r.segment<3>(static_cast<Eigen::Index>(3 * i));
        counts[i] += 1;
      }
    }
    for (std::size_t i = 0; i < sums.size(); ++i) {
      const double mean = sums[i].norm() / std::max(1.0, counts[i]);
      out.push_back(mean > 4 * noise_ / std::sqrt(std::max(1.0, counts[i])) ? mean : 0);
    }
    return out;
  }

 private:
  std::vector<PoseFit> fits_at(const Eigen::VectorXd& values) const {
    const hand::BuiltHand built = hand::build_hand(spec_, unknowns_.person(values));
    std::vector<PoseFit> out;
    for (const HandFrames& hand : hands_) {
      HandTree tree(spec_, built, hand.side);
      if (!unknowns_.convention) tree.open(kGiveOfStops);
      out.emplace_back(std::move(tree), unknowns_.placed(hand.features, values))
          .set_noise(unknowns_.convention ? noise_ : 0);
    }
    return out;
  }

  /// Residuals of features in the axes of the hand frame.
  static Eigen::VectorXd in_palm(const Rows& at, const Used& of) {
    const auto count = static_cast<Eigen::Index>(of.frame.size());
    const Mat3 turn = of.fit.pose.wrist.q.toRotationMatrix().transpose();
    return Eigen::MatrixXd(turn * at.residuals.head(3 * count).reshaped(3, count)).reshaped();
  }

  Normal linearise(std::vector<PoseFit>& fits) const {
    const Eigen::Index count = now_.size(), sizes = unknowns_.first_share();
    std::vector<std::vector<PoseFit>> moved;
    for (Eigen::Index i = 0; i < sizes; ++i) {
      Eigen::VectorXd values = now_;
      values[i] += kStep;
      moved.push_back(fits_at(values));
    }
    Normal out(count);
    for (std::size_t h = 0; h < used_.size(); ++h) {
      Eigen::VectorXd before;
      for (const Used& each : used_[h]) {
        const Rows at = fits[h].rows(each.frame, each.fit.pose, each.fit.rejected);
        Eigen::MatrixXd D = Eigen::MatrixXd::Zero(at.residuals.size(), count);
        const Mat3 turn = each.fit.pose.wrist.q.toRotationMatrix();
        for (Eigen::Index i = sizes; i < count; ++i) {
          const auto& [feature, axis] = unknowns_.shares[as_index(i - sizes)];
          if (each.fit.distances[feature])
            D.block<3, 1>(static_cast<Eigen::Index>(3 * feature), i) =
                each.frame[feature].weight * turn * fits[h].by_shares(feature).col(axis);
        }
        // A thumb that would pass into the palm moves aside; it does not make the palm narrower.
        const auto points = static_cast<Eigen::Index>(3 * each.frame.size());
        for (Eigen::Index i = 0; i < sizes; ++i) {
          const Rows there = moved[as_index(i)][h].rows(each.frame, each.fit.pose, each.fit.rejected);
          D.col(i).head(points) = (there.residuals - at.residuals).head(points) / kStep;
        }
        out.add(at.residuals, free_columns(at.jacobian, each.fit.pose, fits[h].tree()), D, points);
        const Eigen::VectorXd now = in_palm(at, each);
        if (before.size() > 0) out.lagged += before.dot(now);
        ++out.frames;
        before = now;
      }
    }
    return out;
  }

  const std::vector<HandFrames>& hands_;
  const hand::HandSpec& spec_;
  Unknowns unknowns_;
  Eigen::VectorXd now_, left_;  ///< left_: variance over that before
  double noise_ = 0;
  std::vector<std::vector<Used>> used_;
};

/// The points of a hand lie 2 to 60 cm apart: others are in another unit.
void check_unit(const std::vector<HandFrames>& hands, const std::string& recording) {
  double longest = 0;
  for (const HandFrames& hand : hands)
    for (std::size_t k = 0; k < hand.size(); ++k) {
      const MeasuredFrame frame = hand.at(k);
      for (const MeasuredPoint& a : frame)
        if (a.point && frame.front().point)
          longest = std::max(longest, (*a.point - *frame.front().point).norm());
    }
  if (longest > 0 && (longest < 0.02 || longest > 0.6))
    throw input_error(recording, fmt::format("points of one hand up to {:.3g} m apart", longest),
                      "0.02 to 0.6 m: the unit is in the head of a .trc, behind the names of columns in a "
                      ".csv, in .json as \"unit\"");
}

/// Says what of the hand is beyond percentile 1 or 99 of the survey, among people like this one.
std::string implausible(const hand::HandSpec& spec, const KnownPerson& known, const hand::Person& fitted) {
  constexpr double kBeyond = 2.326;
  const hand::Person like = known.named ? known.person : adult();
  const hand::HandSize size = hand::hand_size(spec.anthropometry, like);
  const Eigen::Matrix4d scatter = hand::scatter_of(spec.anthropometry, like);
  std::string out;
  const auto compare = [&](const char* what, double value, double expected, double deviation) {
    const double z = std::log(value / expected) / deviation;
    if (std::abs(z) > kBeyond)
      out += fmt::format("{}a {} of {:.0f} mm is at percentile {:.3g}", out.empty() ? "" : ", ", what,
                         1e3 * value, 50 * std::erfc(-z / std::sqrt(2.0)));
  };
  compare("hand length", *fitted.hand_length, size.length,
          known.named ? std::sqrt(scatter(0, 0)) : kAdultSpread);
  compare("hand breadth", *fitted.hand_breadth, size.breadth,
          known.named ? std::sqrt(scatter(1, 1)) : kAdultBreadthSpread);
  return out.empty() ? out : out + (known.named ? " among people of this body" : " among adults");
}

}  // namespace

PersonFit fit_person(const std::vector<HandFrames>& hands, const hand::HandSpec& spec,
                     const KnownPerson& person, bool convention, const std::string& recording,
                     std::vector<std::string>& warnings) {
  check_unit(hands, recording);
  const std::vector<Feature>& features = hands.front().features;
  // Keypoints are the joints' centres until they turn out to be others.
  std::optional<Fit> fit(std::in_place, hands, spec, person, convention, convention);
  if (fit->frames() < 3)
    throw input_error(recording, "fewer than three frames that show a hand",
                      "frames with two thirds of the points, or --keep-person");
  fit->run();
  const std::vector<double> off = fit->off();
  std::string which;
  for (std::size_t i = 0; i < off.size(); ++i)
    if (off[i] > kOff)
      which += fmt::format("{}{} by {:.0f} mm", which.empty() ? "" : ", ",
                           features[i].name.substr(features[i].name.find('.') + 1), 1e3 * off[i]);
  const bool free = std::ranges::any_of(features, [](const Feature& each) { return !each.spread.isZero(); });
  PersonFit out;
  // No tracker puts most of its points so far from the joints: they are in another order, or of something
  // else.
  out.no_hand = !convention &&
                2 * std::ranges::count_if(off, [](double each) { return each > kNoHand; }) > std::ssize(off);
  if (!which.empty() && free && !convention) {
    fit.emplace(hands, spec, person, true, false);
    fit->run();
    warnings.push_back(
        fmt::format("{}: points are not where joints are ({} off in the mean): where they lie on the hand "
                    "was fitted; --points "
                    "names the tracker's convention",
                    recording, which));
  } else if (!which.empty()) {
    warnings.push_back(fmt::format("{}: points are always off: {}", recording, which));
  }
  if (convention || !which.empty()) out.shares = fit->shares();
  out.person = person.person;
  if (person.keep) return out;
  out.person = fit->person();
  if (!fit->shows_length())
    warnings.push_back(fmt::format(
        "{}: the markers hardly show the length of the hand: {:.0f} mm are near those of the {}{}", recording,
        1e3 * *out.person.hand_length, person.named ? person.person.title : adult().title,
        person.named ? "" : ", as no --person is given"));
  if (const std::string text = implausible(spec, person, out.person); !text.empty())
    warnings.push_back(fmt::format(
        "{}: {}: a child's (--person), points in another order, or of another convention (--points)",
        recording, text));
  out.person.title =
      person.person.title + ", hand measured from " + std::filesystem::path(recording).filename().string();
  return out;
}

}  // namespace handsim::study
