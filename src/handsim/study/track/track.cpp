#include "handsim/study/track/track.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <random>

#include <fmt/format.h>

#include "handsim/control/motion_file.h"
#include "handsim/core/error.h"
#include "handsim/study/report.h"
#include "handsim/study/track/person_fit.h"
#include "handsim/study/track/track_checks.h"

namespace handsim::study {

namespace {

/// Tracking goes on after a gap of at most this from the last pose [s]; then the hand is searched anew.
constexpr double kLongestGap = 0.1;
/// No wrist moves as fast between frames [m/s]: a tracker had another thing for a hand, or the hand
/// elsewhere.
constexpr double kFastest = 20;
/// Frames between two such jumps, or one and an end, are left out where they last less [s].
constexpr double kShortestVisit = 0.25;
/// Wrists that would have to move this much farther without a swap are swapped [m].
constexpr double kSwapDistance = 0.1;
/// Assumed noise where the points leave none to see [m].
constexpr double kUnknownNoise = 1e-3;
/// Smallest noise, so that weights stay finite [m].
constexpr double kLeastNoise = 1e-9;

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// The person with the size of the hand that the points show, and where they lie on it.
PersonFit fitted_person(const TrackInput& input, const hand::BuiltHand& hand, const Recording& recording,
                        std::vector<std::string>& warnings) {
  std::vector<HandFrames> hands;
  const bool convention = input.markers && input.markers->is_convention();
  for (const model::Side side : {model::Side::right, model::Side::left})
    if (input.fit_bones || convention) {
      hands.emplace_back(recording, features_for(input, hand, side), side);
      if (!hands.back().any(Feature::Kind::point)) hands.pop_back();
    }
  if (!hands.empty())
    return fit_person(hands, input.model, {input.person, input.person_named, !input.fit_bones}, convention,
                      recording.file, warnings);
  if (!input.person_named)
    warnings.push_back(fmt::format(
        "{}: {}: the hand is that of the {}, as no --person is given", recording.file,
        input.fit_bones ? "sensors show no sizes" : "--keep-person fits no sizes", input.person.title));
  PersonFit out;
  out.person = input.person;
  return out;
}

/// The person whose hands a recording shows, by fitted_person. @throws Error (input) that names the
/// recording where its points make no hand.
PersonFit measured_person(const TrackInput& input, const Recording& recording,
                          std::vector<std::string>& warnings) {
  const hand::BuiltHand hand =
      hand::build_hand(input.model, input.person);  // or a problem of the person's own
  try {
    return fitted_person(input, hand, recording, warnings);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::input || !error.problems().front().place) throw;
    const Problem& first = error.problems().front();
    throw input_error(recording.file, fmt::format("points that make no hand: {} of {}", first.key, first.got),
                      "points of one hand by their names or in order (docs/motion.md), or --keep-person");
  }
}

/// @throws Error (input) for a hand that no person file may have.
void check_person(const hand::Person& person, const std::string& recording) {
  Diagnostics diagnostics;
  YamlNode node = parse_yaml(person_text(person), recording + ": the fitted person.yaml");
  hand::read_person(node, "", diagnostics);
  diagnostics.throw_if_any();
}

/// Tracks one hand.
class HandTracker {
 public:
  HandTracker(const TrackInput& input, const Recording& recording, const hand::BuiltHand& hand,
              std::vector<Feature> features, model::Side side)
      : input_(input),
        recording_(recording),
        own_(HandTree(input.model, hand, side), features),
        other_(
            HandTree(input.model, hand, side == model::Side::right ? model::Side::left : model::Side::right),
            std::move(features)),
        frames_(recording, own_.features(), side) {
    out_.name = side_name(side);
    out_.side = side;
    for (const TreeAxis& axis : own_.tree().axes()) out_.axes.push_back(axis.name);
    for (const Feature& feature : own_.features()) out_.features.push_back(feature.name);
    out_.frames.resize(recording.times.size());
  }

  /// Learns from some frames how far points of a convention are off.
  void look() {
    if (!input_.markers || !input_.markers->is_convention()) return;
    constexpr std::size_t kLooked = 30;
    std::vector<double> rms;
    const std::size_t stride = 1 + frames_.size() / kLooked;
    for (std::size_t k = 0; k < frames_.size(); k += stride)
      if (const MeasuredFrame frame = frames_.at(k); enough(frame))
        rms.push_back(own_.find(frame, input_.outlier).rms);
    if (rms.empty()) return;
    const double points = 3 * static_cast<double>(own_.features().size()),
                 spare = points - static_cast<double>(own_.tree().size());
    if (spare > 0) own_.set_noise(median(rms) * std::sqrt(points / 3 / spare));
  }
  bool any() const { return frames_.any(Feature::Kind::point) || frames_.any(Feature::Kind::orientation); }

  /// Position of the wrist's point, where there is one and it was seen.
  std::optional<Vec3> wrist(std::size_t k) const {
    const auto found = std::ranges::find(own_.features(), out_.name + ".wrist", &Feature::name);
    if (found == own_.features().end()) return std::nullopt;
    return frames_.at(k)[as_index(found - own_.features().begin())].point;
  }
  /// The wrist of the last tracked frame, if it is not long ago.
  std::optional<Vec3> last_wrist(std::size_t k) const {
    return last_ && recording_.times[k] - recording_.times[*last_] <= kLongestGap
               ? std::optional(out_.frames[*last_].pose.wrist.p)
               : std::nullopt;
  }
  void mark(std::size_t k, FrameStatus status) { out_.frames[k].status = status; }

  void track(std::size_t k) {
    TrackedFrame& frame = out_.frames[k];
    const MeasuredFrame measured = frames_.at(k);
    if (!enough(measured)) return;
    static_cast<FitResult&>(frame) = follow(k, measured);
    frame.status = status_of(measured, frame);
    if (frame.status == FrameStatus::tracked) last_ = k;
  }

  /// Leaves out short visits elsewhere, smooths all stretches of tracked frames, and measures the distances
  /// again. @returns a warning, or nothing
  std::string finish() {
    const std::string warning = leave_out_visits();
    compute_determined();
    estimate_noise();
    for (std::size_t k = 0; k < out_.frames.size();) {
      std::size_t end = k;
      while (is_tracked(end) && (end == k || !jumps(end - 1, end))) ++end;
      if (input_.smooth && end - k >= 3) smooth_stretch(k, end);
      k = std::max(end, k + 1);
    }
    return warning;
  }
  TrackedHand take() { return std::move(out_); }

 private:
  /// A third of the points does not determine a hand.
  bool enough(const MeasuredFrame& measured) const {
    const auto count = static_cast<std::size_t>(std::ranges::count_if(measured, &MeasuredPoint::seen));
    return count >= 3 && 3 * count >= own_.features().size();
  }

  /// From the last two poses, or searched.
  FitResult follow(std::size_t k, const MeasuredFrame& measured) {
    if (!last_wrist(k)) return own_.find(measured, input_.outlier);
    HandPose start = out_.frames[*last_].pose;
    if (*last_ == k - 1 && k >= 2 && out_.frames[k - 2].status == FrameStatus::tracked) {
      const HandPose& before = out_.frames[k - 2].pose;
      const double share = (recording_.times[k] - recording_.times[k - 1]) /
                           (recording_.times[k - 1] - recording_.times[k - 2]);
      start.wrist.p += share * (start.wrist.p - before.wrist.p);
      for (std::size_t i = 0; i < start.angles.size(); ++i)
        start.angles[i] += share * (start.angles[i] - before.angles[i]);
    }
    FitResult out = own_.fit(measured, start, input_.outlier);
    if (out.rms <= input_.limit && !out.rejects()) return out;
    FitResult searched = own_.find(measured, input_.outlier);
    return searched.rms < out.rms ? searched : out;
  }

  bool is_tracked(std::size_t k) const {
    return k < out_.frames.size() && out_.frames[k].status == FrameStatus::tracked;
  }
  bool jumps(std::size_t from, std::size_t to) const {
    return (out_.frames[to].pose.wrist.p - out_.frames[from].pose.wrist.p).norm() >
           kFastest * (recording_.times[to] - recording_.times[from]);
  }

  /// Marks frames as poor that a jump parts from the others for a short time.
  std::string leave_out_visits() {
    std::vector<std::vector<std::size_t>> visits(1);
    for (std::size_t k = 0; k < out_.frames.size(); ++k) {
      if (!is_tracked(k)) continue;
      if (!visits.back().empty() && jumps(visits.back().back(), k)) visits.emplace_back();
      visits.back().push_back(k);
    }
    std::size_t count = 0, first = 0;
    for (const auto& visit : visits) {
      if (visits.size() == 1 ||
          recording_.times[visit.back()] - recording_.times[visit.front()] > kShortestVisit)
        continue;
      if (count == 0) first = visit.front();
      count += visit.size();
      for (const std::size_t k : visit) mark(k, FrameStatus::poor);
    }
    return count == 0 ? ""
                      : fmt::format(
                            "{}: {} frames are left out, the first at {:.3g} s: the hand jumps there, faster "
                            "than {:g} m/s",
                            out_.name, count, recording_.times[first], kFastest);
  }

  /// A hand whose mirror image fits much better has the points of the other hand.
  FrameStatus status_of(const MeasuredFrame& measured, const FitResult& fit) {
    constexpr double kSuspicious = 0.004, kMuchBetter = 0.6;
    if (fit.rms > kSuspicious || fit.rejects()) {
      const FitResult mirrored = other_.find(measured, input_.outlier);
      if (!mirrored.rejects() && mirrored.rms < kMuchBetter * fit.rms) return FrameStatus::swapped;
      if (fit.rejects() && !mirrored.rejects()) return FrameStatus::swapped;
    }
    const auto left_out = std::ranges::count(fit.rejected, true);
    return fit.rms <= input_.limit && left_out < 5 ? FrameStatus::tracked : FrameStatus::poor;
  }

  /// Axes that move a feature by more than rounding in one of the first tracked frames.
  void compute_determined() {
    constexpr std::size_t kFrames = 20;
    constexpr double kLeast = 1e-12;  // [m^2/rad^2]
    out_.determined.assign(out_.axes.size(), false);
    std::size_t looked = 0;
    for (std::size_t k = 0; k < out_.frames.size() && looked < kFrames; ++k) {
      const TrackedFrame& frame = out_.frames[k];
      if (frame.status != FrameStatus::tracked) continue;
      const Rows rows = rows_at(k, frame.pose);
      for (std::size_t i = 0; i < out_.axes.size(); ++i)
        if (rows.jacobian.col(static_cast<Eigen::Index>(6 + i)).squaredNorm() > kLeast)
          out_.determined[i] = true;
      ++looked;
    }
  }

  /// By what residuals change from frame to frame: where the points of a tracker lie, and a hand that is not
  /// quite this one, leaves residuals that stay. Of white noise both ways give the same.
  void estimate_noise() {
    double squares = 0, spare = 0;
    const auto parameters = 6 + std::ranges::count(out_.determined, true);
    std::optional<std::size_t> last;
    Eigen::VectorXd before;
    for (std::size_t k = 0; k < out_.frames.size(); ++k) {
      if (!is_tracked(k)) continue;
      Eigen::VectorXd now = in_palm(k);
      double residuals = 0;
      for (std::size_t i = 0; i < own_.features().size() && last; ++i) {
        if (!out_.frames[k].distances[i] || !out_.frames[*last].distances[i]) continue;
        const auto row = static_cast<Eigen::Index>(3 * i);
        squares += 0.5 * (now.segment<3>(row) - before.segment<3>(row)).squaredNorm();
        residuals += 3;
      }
      if (last) spare += residuals - static_cast<double>(parameters);
      last = k;
      before = std::move(now);
    }
    out_.noise = spare > 0 ? std::max(kLeastNoise, std::sqrt(squares / spare)) : kUnknownNoise;
  }

  void smooth_stretch(std::size_t first, std::size_t end) {
    std::vector<double> times(recording_.times.begin() + static_cast<std::ptrdiff_t>(first),
                              recording_.times.begin() + static_cast<std::ptrdiff_t>(end));
    std::vector<HandPose> poses;
    for (std::size_t k = first; k < end; ++k) poses.push_back(out_.frames[k].pose);
    smooth(
        times, [&](std::size_t k, const HandPose& pose) { return rows_at(first + k, pose); }, out_.noise,
        input_.prior, own_.tree(), poses);
    for (std::size_t k = first; k < end; ++k) {
      FitResult& fit = out_.frames[k];
      fit = own_.measure(frames_.at(k), std::move(poses[k - first]), std::move(fit.rejected));
    }
  }

  /// Residuals of the features in the axes of the hand frame.
  Eigen::VectorXd in_palm(std::size_t k) {
    const HandPose& pose = out_.frames[k].pose;
    const auto count = static_cast<Eigen::Index>(own_.features().size());
    const Mat3 turn = pose.wrist.q.toRotationMatrix().transpose();
    return Eigen::MatrixXd(turn * rows_at(k, pose).residuals.head(3 * count).reshaped(3, count)).reshaped();
  }

  Rows rows_at(std::size_t k, const HandPose& pose) {
    return own_.rows(frames_.at(k), pose, out_.frames[k].rejected);
  }

  const TrackInput& input_;
  const Recording& recording_;
  PoseFit own_, other_;
  HandFrames frames_;
  std::optional<std::size_t> last_;  ///< frame that was tracked last
  TrackedHand out_;
};

/// Normal noise of each coordinate, for trials of the tracking.
void add_noise(Recording& recording, double noise, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, noise);
  for (auto& [name, channel] : recording.channels)
    for (Vec3& point : channel.points.values()) point += Vec3(normal(random), normal(random), normal(random));
}

/// True if both wrists are where the other one was: moving there without a swap would be far.
bool wrists_swapped(const HandTracker& a, const HandTracker& b, std::size_t k) {
  const auto wrist_a = a.wrist(k), wrist_b = b.wrist(k), last_a = a.last_wrist(k), last_b = b.last_wrist(k);
  if (!wrist_a || !wrist_b || !last_a || !last_b) return false;
  const double kept = (*wrist_a - *last_a).norm() + (*wrist_b - *last_b).norm();
  const double swapped = (*wrist_a - *last_b).norm() + (*wrist_b - *last_a).norm();
  return kept > swapped + kSwapDistance && kept > 2 * swapped;  // else both have jumped
}

}  // namespace

std::string_view name(FrameStatus status) {
  // In the order of FrameStatus.
  constexpr std::string_view kNames[] = {"tracked", "missing", "swapped", "poor"};
  return kNames[static_cast<std::size_t>(status)];
}

std::size_t TrackedHand::count(FrameStatus status) const {
  return static_cast<std::size_t>(
      std::ranges::count_if(frames, [&](const auto& frame) { return frame.status == status; }));
}

std::vector<Feature> features_for(const TrackInput& input, const hand::BuiltHand& hand, model::Side side) {
  if (input.markers) return features_of(*input.markers, input.model, side);
  std::vector<Feature> out = keypoints(input.model, hand);
  for (Feature& feature : out) feature.name = fmt::format("{}.{}", side_name(side), feature.name);
  return out;
}

TrackResult run_track(const TrackInput& input, const std::function<void(double)>& progress) {
  RecordingFormat format;
  if (input.markers && input.markers->format) format = *input.markers->format;
  format.up = input.up.value_or(format.up);
  format.left_handed = input.left_handed.value_or(format.left_handed);
  Recording recording = read_recording(input.recording, format);
  if (input.noise > 0) add_noise(recording, input.noise, input.seed);
  return run_track(input, recording, progress);
}

TrackResult run_track(const TrackInput& input, const Recording& recording,
                      const std::function<void(double)>& progress) {
  const double start = cpu_seconds();
  TrackResult out;
  out.times = recording.times;
  out.warnings = recording.warnings;
  const std::vector<std::string> doubts = recording_warnings(input, recording);
  out.warnings.insert(out.warnings.end(), doubts.begin(), doubts.end());
  std::vector<std::string> of_fit, swapped_sides;
  PersonFit fitted = measured_person(input, recording, of_fit);
  out.person = std::move(fitted.person);
  out.shares = std::move(fitted.shares);
  out.not_shown = std::move(fitted.not_shown);
  check_person(out.person, recording.file);
  const hand::BuiltHand hand = hand::build_hand(input.model, out.person);
  std::vector<HandTracker> trackers;
  trackers.reserve(2);
  for (const model::Side side : {model::Side::right, model::Side::left}) {
    if (input.markers && features_of(*input.markers, input.model, side).empty()) continue;
    std::vector<Feature> features = features_for(input, hand, side);
    for (std::size_t i = 0; i < out.shares.size(); ++i) features[i].shares = out.shares[i];
    trackers.emplace_back(input, recording, hand, std::move(features), side);
    if (!trackers.back().any())
      trackers.pop_back();
    else
      trackers.back().look();
  }
  if (trackers.empty())
    throw input_error(recording.file, "no frame in which a point of a hand was seen",
                      "three frames that show a hand");
  const std::size_t count = out.times.size();
  for (std::size_t k = 0; k < count; ++k) {
    const bool swapped = trackers.size() == 2 && wrists_swapped(trackers[0], trackers[1], k);
    for (HandTracker& tracker : trackers) swapped ? tracker.mark(k, FrameStatus::swapped) : tracker.track(k);
    if (progress && k % 100 == 0) progress(static_cast<double>(k) / static_cast<double>(count));
  }
  for (HandTracker& tracker : trackers) {
    if (const std::string warning = tracker.finish(); !warning.empty()) out.warnings.push_back(warning);
    out.hands.push_back(tracker.take());
    // A hand of the other side explains what the fit has found.
    if (const std::string warning = swap_warning(out.hands.back()); !warning.empty())
      swapped_sides.push_back(warning);
  }
  if (swapped_sides.empty() && fitted.no_hand)
    throw input_error(recording.file, "points that make no hand: most are far from where they should be",
                      "points of one hand by their names or in order (docs/motion.md), or --keep-person");
  const auto& said = swapped_sides.empty() ? of_fit : swapped_sides;
  out.warnings.insert(out.warnings.end(), said.begin(), said.end());
  out.cpu = cpu_seconds() - start;
  shift_times(out, recording.file);
  part_hands(input.model, hand, out);
  for (TrackedHand& tracked : out.hands) {
    collect_overlaps(hand, out.times, tracked);
    if (input.truth) compare(control::read_motion(*input.truth), recording.times, tracked);
  }
  return out;
}

}  // namespace handsim::study
