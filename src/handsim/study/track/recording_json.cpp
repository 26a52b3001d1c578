#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include "handsim/study/track/recording_reader.h"

namespace handsim::study {

namespace {

/// Bytes of a file for the parser; reading them moves a place along. NaN, which Python writes and JSON does
/// not have, is null.
struct PlacedBytes {
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;
  const char* at = nullptr;  ///< of text that a zero byte ends
  Place* place = nullptr;
  std::string_view instead;  ///< of NaN, what is left of null

  reference operator*() const { return instead.empty() ? *at : instead.front(); }
  PlacedBytes& operator++() {
    if (!instead.empty()) {
      instead.remove_prefix(1);
      if (!instead.empty()) return *this;
      at += 2, place->column += 2;
    }
    const bool ends = *at++ == '\n';
    place->line += ends ? 1 : 0;
    place->column = ends ? 1 : place->column + 1;
    if (at[0] == 'N' && at[1] == 'a' && at[2] == 'N') instead = "null";
    return *this;
  }
  bool operator==(const PlacedBytes& other) const { return at == other.at; }
};

using Document = nlohmann::json;

/// Reads frames of keypoints from JSON, of which the parser keeps one frame at a time.
class JsonReader : public RecordingReader {
 public:
  using RecordingReader::RecordingReader;

  Recording read() {
    const char* const begin = text_.data();
    const auto keep = [this](int depth, Document::parse_event_t event, const Document& value) {
      return keeps(depth, event, value);
    };
    try {
      const Document head = Document::parse(PlacedBytes{begin, &place_, {}},
                                            PlacedBytes{begin + text_.size(), &place_, {}}, keep);
      if (!any_frames_) fail("no frames", "JSON with a list of frames", "frames");
      if (head.is_object())
        finish(head.value("rate", 0.0), head.value("unit", ""));
      else
        finish(0, "");
    } catch (const Document::exception& error) {
      fail(printable(error.what(), 200), "JSON with a list of frames", any_frames_ ? key() : "");
    }
    if (doubled_ > 0)
      out_.warnings.push_back(fmt::format(
          "{}: {} frames have two hands of one side, the first of them frames.{}: neither is used there",
          out_.file, doubled_, first_doubled_));
    return std::move(out_);
  }

 private:
  std::string key() const { return fmt::format("frames.{}", count_); }

  /// False for a frame that has been read, and for what is no part of a recording.
  bool keeps(int depth, Document::parse_event_t event, const Document& value) {
    using Event = Document::parse_event_t;
    const bool list = event == Event::array_start;
    if (depth == 0) in_frames_ = in_frames_ || list;
    if (depth == 1 && event == Event::key) {
      in_frames_ = value == "frames";
      if (in_frames_ && any_frames_) fail("a second list", "one list of frames", "frames");
      return in_frames_ || value == "rate" || value == "unit";
    }
    if (!in_frames_) return true;
    if (!any_frames_) {
      any_frames_ = list;
      level_ = depth + 1;
    } else if (depth == level_ &&
               (event == Event::object_end || event == Event::array_end || event == Event::value)) {
      add_frame(value);
      ++count_;
      return false;
    }
    return true;
  }

  void add_frame(const Document& frame) {
    const Document& hands = frame.at("hands");
    if (!hands.is_array())
      fail("hands that are no list", "a list of hands, empty where none was seen", key());
    if (frame.contains("time")) {
      add_time(frame["time"].get<double>());
    } else {
      if (++untimed_ > kMostFrames) fail("more frames", fmt::format("at most {}", kMostFrames));
      out_.times.push_back(0);
    }
    std::array<std::vector<const Document*>, 2> of_side;
    for (const Document& hand : hands) {
      const std::string side = lower_case(hand.at("side").get<std::string>());
      if (side != "right" && side != "left")
        fail(fmt::format("the side {}", printable(side)), "right or left", key());
      of_side[side == "right" ? 0 : 1].push_back(&hand);
      if (const Document& points = hand.at("points");
          points.is_array() && points.size() != format_.names.size())
        fail(fmt::format("{} points", points.size()),
             fmt::format("{} points, null for those not seen; --points names other trackers",
                         format_.names.size()),
             key());
    }
    // Nobody knows which of two right hands is the right one.
    if ((of_side[0].size() > 1 || of_side[1].size() > 1) && doubled_++ == 0) first_doubled_ = count_;
    if (of_side[0].size() == 1) add_hand("right.", *of_side[0][0]);
    if (of_side[1].size() == 1) add_hand("left.", *of_side[1][0]);
  }

  void add_hand(const std::string& side, const Document& hand) {
    const Document& points = hand["points"];
    std::vector<const Document*> of_point(format_.names.size());
    if (points.is_array())
      for (std::size_t p = 0; p < of_point.size(); ++p) of_point[p] = &points[p];
    else
      for (const auto& [name, point] : points.get_ref<const Document::object_t&>())
        if (const auto p = index_of(name)) of_point[*p] = &point;
    for (std::size_t p = 0; p < of_point.size(); ++p) {
      if (!of_point[p]) continue;
      const Document& point = *of_point[p];
      std::array<std::optional<double>, 3> x;
      for (std::size_t i = 0; i < 3 && !point.is_null(); ++i)
        if (const Document& value = point.is_array() ? point.at(i) : point.at(std::string(1, "xyz"[i]));
            !value.is_null())
          x[i] = value.get<double>();
      if (!x[0] || !x[1] || !x[2]) continue;
      const std::string name = side + format_.names[p];
      Channel& channel = out_.channels[name];
      channel.points.add(count_, {*x[0], *x[1], *x[2]});
      // Of the point, or else of the whole hand.
      for (const Document* of : {&point, &hand})
        if (const auto found = of->is_object() ? of->find(format_.confidence) : of->end();
            found != of->end() && found->is_number()) {
          add_confidence(channel, fmt::format("{}: {}", key(), name), found->get<double>());
          break;
        }
    }
  }

  /// Ends the reading: keys of the head may stand behind the frames.
  void finish(double rate, const std::string& unit) {
    place_ = {place_.file, 1, 1};
    const double size = unit.empty() ? format_.unit : unit == "m" ? 1 : unit == "cm" ? 1e-2 : 1e-3;
    if (!unit.empty() && unit != "m" && unit != "cm" && unit != "mm")
      fail(printable(unit), "m, cm or mm", "unit");
    for (auto& [name, channel] : out_.channels)
      for (std::size_t i = 0; i < channel.points.values().size(); ++i) {
        Vec3& point = channel.points.values()[i];
        point *= size;
        check_place(point, fmt::format("frames.{}: {}", channel.points.frames()[i], name));
      }
    if (untimed_ == 0) return;
    if (untimed_ < count_ || rate == 0)
      fail(fmt::format("no time in {} of {} frames", untimed_, count_),
           "a time in s in every frame, or a rate in Hz", "frames");
    if (!(rate > 0 && rate * kShortestInterval <= 1))
      fail(fmt::format("{:g}", rate), "a rate above 0 to 1e6 Hz", "rate");
    for (std::size_t i = 0; i < count_; ++i) out_.times[i] = static_cast<double>(i) / rate;
    if (out_.times.back() > kLongestRecording)
      fail(fmt::format("{} frames at {:g} Hz", count_, rate),
           fmt::format("at most {:g} s", kLongestRecording), "rate");
  }

  bool in_frames_ = false, any_frames_ = false;
  int level_ = 0;                                                          ///< depth of a frame
  std::size_t count_ = 0, untimed_ = 0, doubled_ = 0, first_doubled_ = 0;  ///< frames
};

}  // namespace

Recording read_json_recording(const std::filesystem::path& path, const RecordingFormat& format) {
  return JsonReader(path, format).read();
}

}  // namespace handsim::study
