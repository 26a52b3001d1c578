#include "handsim/study/track/person_fit.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "handsim/core/error.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {
constexpr std::size_t kMostHandFrames = 60;       ///< of a hand
constexpr double kLeastCoordinateNoise = 1e-7;    ///< of a coordinate [m]
constexpr double kOutlier = 0.05;                 ///< a point farther from the fit is left out [m]
constexpr double kStep = 1e-6;                    ///< of a size, to differentiate
constexpr double kNoHand = 15e-3;                 ///< the same, of one that is no such point: chosen [m]
constexpr double kOff = 2e-3;                     ///< mean residual of a point that is always off [m]
constexpr double kExact = 1e-9, kRoughly = 1e-4;  ///< sizes and shares that do not move by it are found
/// Without a convention stops give way by this much while sizes and places are fitted [rad], chosen: noise of
/// a finger that lies near its stop would else be one-sided, and places, which nothing else holds, would take
/// it up.
constexpr double kGiveOfStops = 20 * M_PI / 180;

/// Share of the variance before that is left of what was measured.
constexpr double kShown = 0.25;

/// Of a feature, without the hand.
std::string plain(const std::string& name) { return name.substr(name.find('.') + 1); }

/// Points that lie elsewhere by more than kOff, with their distances [m]; nothing without one.
std::string list_of(const std::vector<Feature>& features, const std::vector<double>& by) {
  std::string out;
  for (std::size_t i = 0; i < by.size(); ++i)
    if (by[i] > kOff)
      out += fmt::format("{}{} by {:.0f} mm", out.empty() ? "" : ", ", plain(features[i].name), 1e3 * by[i]);
  return out;
}

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
      : hands_(&hands),
        spec_(&spec),
        unknowns_(spec, person, hands.front().features, fit_shares, convention),
        now_(unknowns_.expected),
        open_(hands.front().features.size(), convention) {
    std::vector<PoseFit> fits = fits_at(now_);
    for (std::size_t h = 0; h < hands.size(); ++h) used_.push_back(frames_of(hands[h], fits[h]));
  }

  std::size_t frames() const {
    std::size_t out = 0;
    for (const auto& each : used_) out += each.size();
    return out;
  }

  /// What errors have in common from frame to frame: as they are in each step, none, or as before.
  enum class Errors { of_step, white, of_start };
  /// Gauss-Newton, until no unknown moves by `least`; after each step the poses are fitted again.
  void run(double least, Errors errors) {
    constexpr int kMostRounds = 25;
    double together = 1;
    for (int round = 0; round < kMostRounds; ++round) {
      std::vector<PoseFit> fits = fits_at(now_);
      for (std::size_t h = 0; h < used_.size(); ++h)
        for (Used& each : used_[h]) each.fit = fits[h].fit(each.frame, each.fit.pose, kOutlier);
      const Normal normal = linearise(fits);
      noise_ = std::max(kLeastCoordinateNoise, std::sqrt(normal.squares / std::max(1.0, normal.spare)));
      spare_ = normal.spare;
      if (errors == Errors::of_step || (errors == Errors::of_start && round == 0))
        together = normal.together();
      const double variance = noise_ * noise_ * together;
      const Eigen::VectorXd prior = unknowns_.prior(now_);
      matrix_ = normal.matrix / variance;
      matrix_.diagonal() += prior;
      right_ = normal.right / variance + prior.cwiseProduct(unknowns_.expected - now_);
      const std::vector<Eigen::Index> free = rows_of_open();
      const Eigen::LDLT<Eigen::MatrixXd> factor(matrix_(free, free));
      Eigen::VectorXd most = 0.1 * now_;
      most.tail(now_.size() - unknowns_.first_share()).setConstant(0.3);
      Eigen::VectorXd step = Eigen::VectorXd::Zero(now_.size());
      step(free) = Eigen::VectorXd(factor.solve(Eigen::VectorXd(right_(free))));
      step = step.cwiseMax(-most).cwiseMin(most);
      now_ += step;
      left_ = Eigen::VectorXd::Ones(now_.size());
      const auto size = std::ssize(free);
      const Eigen::MatrixXd covariance = factor.solve(Eigen::MatrixXd::Identity(size, size));
      left_(free) = Eigen::VectorXd(covariance.diagonal().cwiseProduct(prior(free)));
      if (step.cwiseAbs().maxCoeff() < least) break;
    }
  }
  /// Fewer than half of the places may move, and one of the others is off.
  bool holds_one_that_is_off() const {
    const std::vector<double> off = this->off();
    for (std::size_t i = 0; i < off.size(); ++i)
      if (!open_[i] && off[i] > kOff) return 2 * std::ranges::count(open_, true) < std::ssize(open_);
    return false;
  }
  void open_all() { open_.assign(open_.size(), true); }
  /// Bayesian information criterion of the places that may move: the least is the best.
  double criterion() const {
    return 2 * spare_ * std::log(noise_) + static_cast<double>(rows_of_open().size()) * std::log(spare_);
  }
  /// Of the features whose places are held, lets that one move whose places explain most. @returns whether
  /// there was one
  bool open_next() {
    const std::vector<Eigen::Index> free = rows_of_open();
    const Eigen::LDLT<Eigen::MatrixXd> factor(matrix_(free, free));
    const Eigen::VectorXd known = factor.solve(Eigen::VectorXd(right_(free)));
    std::size_t best = open_.size();
    double most = 0;
    for (std::size_t i = 0; i < open_.size(); ++i) {
      const std::vector<Eigen::Index> own = rows_of(i);
      if (open_[i] || own.empty()) continue;
      const Eigen::MatrixXd shared = matrix_(free, own);
      const Eigen::MatrixXd rest = matrix_(own, own) - shared.transpose() * factor.solve(shared);
      const Eigen::VectorXd right = right_(own) - shared.transpose() * known;
      const double gain = right.dot(rest.ldlt().solve(right));
      if (gain > most) most = gain, best = i;
    }
    if (best < open_.size()) open_[best] = true;
    return best < open_.size();
  }
  hand::Person person() const {
    hand::Person out = unknowns_.person(now_);
    // What is as uncertain as before was not measured.
    for (std::size_t i = 0; i < unknowns_.bones.size(); ++i)
      if (left_[static_cast<Eigen::Index>(2 + i)] > 0.99)
        out.bones.erase(spec_->segments[unknowns_.bones[i]].name);
    return out;
  }
  std::vector<Vec3> shares() const {
    std::vector<Vec3> out;
    for (const Feature& feature : unknowns_.placed(hands_->front().features, now_))
      out.push_back(feature.shares);
    return out;
  }
  /// The uncertainty of the length is less than half of what it was before.
  bool shows_length() const { return left_[0] < kShown; }
  /// Bones, and points whose places may move, of which that is not so.
  std::vector<std::string> not_shown() const {
    std::vector<std::string> out;
    for (std::size_t i = 0; i < unknowns_.bones.size(); ++i)
      if (left_[2 + Unknowns::as_row(i)] >= kShown) out.push_back(spec_->segments[unknowns_.bones[i]].name);
    for (std::size_t i = 0; i < open_.size(); ++i)
      if (open_[i] && std::ranges::any_of(rows_of(i), [&](Eigen::Index row) { return left_[row] >= kShown; }))
        out.push_back("point " + plain(hands_->front().features[i].name));
    return out;
  }
  /// How far each feature's place has moved [m].
  std::vector<double> moved() const {
    const std::vector<Vec3> now = shares();
    std::vector<PoseFit> fits = fits_at(now_);
    std::vector<double> out;
    for (std::size_t i = 0; i < now.size(); ++i)
      out.push_back((fits.front().by_shares(i) * (now[i] - hands_->front().features[i].shares)).norm());
    return out;
  }

  /// Mean residual of each feature of the first hand in the palm over the frames [m], where it is more than
  /// the noise's.
  std::vector<double> off() const {
    std::vector<Vec3> sums(hands_->front().features.size(), Vec3::Zero());
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
    const hand::BuiltHand built = hand::build_hand(*spec_, unknowns_.person(values));
    std::vector<PoseFit> out;
    for (const HandFrames& hand : *hands_) {
      HandTree tree(*spec_, built, hand.side);
      if (!unknowns_.convention) tree.open(kGiveOfStops);
      std::vector<Feature> features = unknowns_.placed(hand.features, values);
      // Where bones point tells of the posture alone.
      for (Feature& feature : features) feature.arm = 0;
      out.emplace_back(std::move(tree), std::move(features)).set_noise(unknowns_.convention ? noise_ : 0);
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

  /// Unknowns of a feature's place.
  std::vector<Eigen::Index> rows_of(std::size_t feature) const {
    std::vector<Eigen::Index> out;
    for (std::size_t i = 0; i < unknowns_.shares.size(); ++i)
      if (unknowns_.shares[i].feature == feature)
        out.push_back(unknowns_.first_share() + Unknowns::as_row(i));
    return out;
  }
  /// Unknowns that may move.
  std::vector<Eigen::Index> rows_of_open() const {
    std::vector<Eigen::Index> out;
    for (Eigen::Index i = 0; i < unknowns_.first_share(); ++i) out.push_back(i);
    for (std::size_t i = 0; i < open_.size(); ++i)
      if (open_[i]) std::ranges::copy(rows_of(i), std::back_inserter(out));
    return out;
  }

  const std::vector<HandFrames>* hands_;
  const hand::HandSpec* spec_;
  Unknowns unknowns_;
  Eigen::VectorXd now_, left_;  ///< left_: variance over that before
  std::vector<bool> open_;      ///< by feature: its place may move
  Eigen::MatrixXd matrix_;      ///< normal equations of the last step, with the prior
  Eigen::VectorXd right_;
  double noise_ = 0, spare_ = 0;
  std::vector<std::vector<Used>> used_;
};

/// Points that are not the joints' centres, without a convention. Where few of them explain the others'
/// places as well as if all could move, the rest are joints: a hand that hardly moves would else have its
/// angles explained by places.
Fit with_places(const std::vector<HandFrames>& hands, const hand::HandSpec& spec, const KnownPerson& person) {
  Fit few(hands, spec, person, true, false), all = few;
  few.run(kRoughly, Fit::Errors::white);
  while (few.holds_one_that_is_off() && few.open_next()) few.run(kRoughly, Fit::Errors::white);
  all.open_all();
  Fit freely = all;
  freely.run(kRoughly, Fit::Errors::white);
  const bool enough = few.criterion() < freely.criterion();
  (enough ? few : all).run(kExact, enough ? Fit::Errors::of_start : Fit::Errors::of_step);
  return enough ? few : all;
}

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
  fit->run(kExact, Fit::Errors::of_step);
  const std::vector<double> off = fit->off();
  const std::string which = list_of(features, off);
  const bool free = std::ranges::any_of(features, [](const Feature& each) { return !each.spread.isZero(); });
  PersonFit out;
  // No tracker puts most of its points so far from the joints: they are in another order, or of something
  // else.
  out.no_hand = !convention &&
                2 * std::ranges::count_if(off, [](double each) { return each > kNoHand; }) > std::ssize(off);
  if (!which.empty() && free && !convention) {
    fit.emplace(with_places(hands, spec, person));
    if (const std::string moved = list_of(features, fit->moved()); !moved.empty())
      warnings.push_back(
          fmt::format("{}: points are not where joints are ({}): where they lie on the hand was fitted; "
                      "--points names the tracker's convention",
                      recording, moved));
  } else if (!which.empty()) {
    warnings.push_back(fmt::format("{}: points are always off: {}", recording, which));
  }
  if (convention || !which.empty()) out.shares = fit->shares();
  out.person = person.person;
  out.not_shown = fit->not_shown();
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
