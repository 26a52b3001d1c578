// What readers of all formats of recordings share.
#pragma once

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/index.h"
#include "handsim/core/input_file.h"
#include "handsim/core/text.h"
#include "handsim/core/units.h"
#include "handsim/study/track/recording.h"

namespace handsim::study {

/// A recording being read, and the place in its file.
class RecordingReader {
 public:
  static constexpr std::size_t kMostBytes = 512U << 20U;
  static constexpr std::size_t kMostFrames = 1'000'000;
  static constexpr double kShortestInterval = 1e-6;  ///< between frames [s]
  static constexpr double kFarthest = 1000;          ///< of a point from the origin [m]

  RecordingReader(const std::filesystem::path& path, const RecordingFormat& format)
      : format_(format),
        text_(read_text_file(path, "a recording (.csv, .json, .trc, .c3d)", kMostBytes)),
        place_{path.string(), 1, 1} {
    out_.file = path.string();
  }
  [[noreturn]] void fail(std::string got, std::string need, std::string key = {}) const {
    throw Error({Problem{place_, std::move(key), std::move(got), std::move(need)}});
  }
  void add_time(double time) {
    if (!out_.times.empty() && !(time - out_.times.back() >= kShortestInterval))
      fail(fmt::format("{:.12g} s after {:.12g} s", time, out_.times.back()),
           fmt::format("times in s that increase, by {:g} s at least", kShortestInterval), "time");
    if (!out_.times.empty() && !(time - out_.times.front() <= kLongestRecording))
      fail(fmt::format("{:.6g} s after the first frame", time - out_.times.front()),
           fmt::format("a recording of at most {:g} s", kLongestRecording), "time");
    if (out_.times.size() == kMostFrames) fail("more frames", fmt::format("at most {}", kMostFrames));
    out_.times.push_back(time);
  }
  /// The frame that add_time() has begun.
  std::size_t frame() const { return out_.times.size() - 1; }
  /// Adds how sure the tracker is of a point of this frame.
  void add_confidence(Channel& channel, const std::string& name, double confidence) const {
    if (!(confidence <= 1))
      fail(fmt::format("a {} of {:g}", format_.confidence, confidence), "one of at most 1", name);
    channel.confidences.add(frame(), confidence);
  }
  void check_place(const Vec3& point, const std::string& name) const {
    if (!(point.cwiseAbs().maxCoeff() <= kFarthest))
      fail(fmt::format("a point {:.3g} m away", point.cwiseAbs().maxCoeff()),
           fmt::format("one within {:g} m of the origin: the unit may be another one", kFarthest), name);
  }

 protected:
  /// The number of a point by its name, as the tracker or the convention writes it.
  std::optional<std::size_t> index_of(const std::string& name) const {
    auto found = std::ranges::find(format_.names, name);
    if (found == format_.names.end()) found = std::ranges::find(format_.names, plain_name(name));
    return found == format_.names.end() ? std::nullopt
                                        : std::optional(as_index(found - format_.names.begin()));
  }
  /// `right.index_pip` of `right.6` and of `right.INDEX_FINGER_PIP`.
  std::string point_name(const std::string& name) const {
    const std::size_t dot = name.rfind('.');
    if (dot == std::string::npos) return name;
    const std::string of = name.substr(dot + 1);
    const auto number = parse_number(of);
    const bool numbered = number && *number >= 0 && *number < static_cast<double>(format_.names.size());
    const auto index = numbered ? std::optional(static_cast<std::size_t>(*number)) : index_of(of);
    return index ? name.substr(0, dot + 1) + format_.names[*index] : name;
  }

  const RecordingFormat& format_;
  std::string text_;
  Place place_;
  Recording out_;
};

/// Reads a recording of frames of points in .json, for read_recording.
Recording read_json_recording(const std::filesystem::path& path, const RecordingFormat& format);

}  // namespace handsim::study
