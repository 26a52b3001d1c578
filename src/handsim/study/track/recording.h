// Recordings of hands: positions of keypoints or markers, orientations of sensors, over time.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "handsim/core/pose.h"

namespace handsim::study {

inline constexpr double kLongestRecording = 1e5;  ///< as of a scene [s]

/// Values of the frames that have one; the others take no memory.
template <class T>
class Seen {
 public:
  /// @param frame index in Recording::times, above the last one
  void add(std::size_t frame, const T& value) {
    frames_.push_back(static_cast<std::uint32_t>(frame));
    values_.push_back(value);
  }
  /// Null where the frame has none.
  const T* at(std::size_t frame) const {
    const auto found = std::lower_bound(frames_.begin(), frames_.end(), frame);
    return found != frames_.end() && *found == frame ? &values_[at_(found)] : nullptr;
  }
  T* at(std::size_t frame) { return const_cast<T*>(std::as_const(*this).at(frame)); }
  bool empty() const { return values_.empty(); }
  /// Removes the values of frames that `unseen` names.
  template <class Unseen>
  void remove(const Unseen& unseen) {
    Seen kept;
    for (std::size_t i = 0; i < values_.size(); ++i)
      if (!unseen(frames_[i])) kept.add(frames_[i], values_[i]);
    *this = std::move(kept);
  }
  const std::vector<std::uint32_t>& frames() const { return frames_; }
  std::vector<T>& values() { return values_; }
  const std::vector<T>& values() const { return values_; }

 private:
  std::size_t at_(std::vector<std::uint32_t>::const_iterator it) const {
    return static_cast<std::size_t>(it - frames_.begin());
  }
  std::vector<std::uint32_t> frames_;
  std::vector<T> values_;
};

/// Points and orientations that were recorded under one name.
struct Channel {
  Seen<Vec3> points;         ///< world [m]
  Seen<double> confidences;  ///< of points, where the file states them: to 1
  Seen<Quat> orientations;   ///< q_WorldSensor
};

struct Recording {
  std::string file;
  std::vector<double> times;                ///< [s], increasing
  std::map<std::string, Channel> channels;  ///< keypoints: `right.index_pip`; markers, sensors: their names
  std::vector<std::string> warnings;        ///< what of the file is left out, and why
};

/// The form in which a tracker writes its points.
struct RecordingFormat {
  std::vector<std::string> names;  ///< by number; empty: the 21 keypoints
  char up = 'z';                   ///< the axis that points up; `y`, or -y: `Y`, becomes z by a turn about x
  bool left_handed = false;        ///< axes: the one that is neither x nor up is turned round
  double unit = 1;                 ///< of .json that states none [m]
  bool origin_unseen = false;      ///< 0 0 0 is a point that was not seen
  std::string confidence = "confidence";  ///< name of the number beside a point or hand
  double least_confidence = 0.5;          ///< a point with less was not seen: chosen
};

/// A name of a point as conventions write it: `XR_HAND_JOINT_INDEX_TIP_EXT`, `index-finger-tip` and
/// `INDEX_FINGER_TIP` are `index_tip`, `PINKY_MCP` is `little_mcp`.
std::string plain_name(std::string_view name);

/// Reads a recording by its file's ending:
/// - .csv: `time[s],NAME.x[m],NAME.y[m],NAME.z[m],...` (or [mm]), sensors `NAME.qw,NAME.qx,NAME.qy,NAME.qz`;
///   keypoints are `right.wrist`, ... or by number, `right.0` to `right.20`. Empty or `nan`: not seen.
/// - .json: `{"frames": [{"time": 0, "hands": [{"side": "right", "points": [[x, y, z], ...]}]}]}` with 21
///   points in the usual order, each [x, y, z], {"x":, "y":, "z":} or null; `"rate"` in Hz in place of times,
///   `"unit"`: m (default), cm or mm. Points may be a map by name. Memory grows with the points that were
///   seen, not with the frames.
///   NaN is null.
/// - .trc: markers as OpenSim and Motion Analysis write them, with NumFrames and NumMarkers.
/// A hand whose points are all at one place was not seen. Points may have a confidence: a column
/// `NAME.confidence`, or `right.confidence` of a hand; in .json a number of a point {"x":, ...} or a hand.
/// @throws Error (input) with the place of what cannot be read.
Recording read_recording(const std::filesystem::path& path, RecordingFormat format = {});

}  // namespace handsim::study
